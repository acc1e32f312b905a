"""Good files of heads and of what they wear."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from surface.head import Head, save_data
from surface.head.model.accessories import write_accessories
from surface.head.model.data import Contact, HeadData, Rule
from surface.head.model.file import load_data
from surface.head.model.identity import Identity, fingerprint, save_identities
from surface.head.model.look import Worn
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.model.wardrobe import read_garment, with_garments
from surface.head.posing.baked import write_decimated, write_shade
from surface.head.posing.fit_error import write_fit_error
from tests.fuzz.kind import FIT_S, Kind
from tests.fuzz.reading import reports
from tests.surface.cards import RED, card, picture
from tests.surface.small_head import all_points, small_head

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


@cache
def _shipped_head() -> HeadData:
    return load_data(CONFIGS / "heads" / "ict")


def _wear(path: Path) -> None:
    """Put a garment on the shipped head."""
    with_garments(_shipped_head(), (read_garment(Worn(path, (0.1, 0.1, 0.1))),), str(path))


def head_kinds(folder: Path) -> list[Kind]:
    """A head's files and a garment; `folder` takes what is written on the way."""
    return [*_garments(), *_heads(folder)]


def _garments() -> list[Kind]:
    seed = (CONFIGS / "wardrobe" / "hair-crop.npz").read_bytes()
    words = ("render", "--person", "{folder}/person.toml", "--size", "64x64", "-o", "{out}.png")
    person = b'name = "worn"\n[hair]\nstyle = "hair.npz"\ncolour = "#222222"\n'
    return [Kind("garment", "hair.npz", [seed], reports(_wear), {"person.toml": person}, words, FIT_S)]


def _save_head(folder: Path) -> None:
    """A small head with everything that a folder can hold."""
    u, v = np.meshgrid(np.linspace(0.3, 0.7, 5), np.linspace(0.05, 0.4, 6), indexing="ij")
    places = np.stack([np.stack([u, 0.5 + v], axis=-1), np.stack([u, 0.5 - v], axis=-1)])
    rule = Rule("frown", ({"mouthPucker": 0.5, "jawOpen": 0.5},), 2.0)
    data = small_head(contacts=[Contact("lips", "a", ("b",), -1, 60.0, 0.5, places)], rules=[rule])
    parts = [replace(p, mesh=pack(tessellate(p, make_surface(p), data.seams), p.budget)) for p in data.parts]
    save_data(folder, replace(data, parts=parts))
    head = Head.load(folder)
    wide = Identity("wide", {"a": all_points("wide", (1, 0, 0))}, {}, np.zeros((2, 3)), np.zeros(3), fingerprint(data))
    save_identities(folder, [wide])
    write_shade(folder, {part.name: np.full(len(part.vertices), 0.5) for part in head.parts}, head.parts)
    write_fit_error(folder, {"a": np.linspace(0.0, 2.0, len(head.part("a").vertices))}, head.parts)
    write_decimated(folder, head.parts, {f"{part.name}/full": part.triangles for part in head.parts})
    glasses = card(name="Glasses", kind="glasses", texture=picture(RED[:3], kind="JPEG"), alpha="BLEND")
    write_accessories(folder, [card(), glasses, card(name="Band", texture=b"", colour=(0.2, 0.1, 0.1, 1.0))])


def _heads(folder: Path) -> list[Kind]:
    _save_head(folder / "head")
    files = {path.name: path.read_bytes() for path in sorted((folder / "head").iterdir())}
    return [
        Kind(name, f"head/{name}", [data], beside={f"head/{n}": d for n, d in files.items() if n != name})
        for name, data in files.items()
    ]
