"""Write garments: surfaces, and pictures over (u, v) of what they do to the skin below."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Array, Bools, Floats
from surface.fit.wardrobe.beards import Beard
from surface.fit.wardrobe.beards import field as beard_field
from surface.fit.wardrobe.clothes import Neck, hidden_below
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.patches import Patches, arrays
from surface.fit.wardrobe.shade import shade
from surface.fit.wardrobe.skin import ANCHORS, CENTRE, Skin, unit
from surface.fit.wardrobe.styles import step
from surface.head.model.sidecar import write_sidecar
from surface.head.model.wardrobe import outline

SIZE = 192  # pixels of a picture along u and v
FADE_MM = (-6.0, 8.0)  # inside the hairline: where the skin begins to have hair's colour, and where it has it
HIDDEN_MM = 26.0
EAR_MM = 4.0  # from the skull's skin: what stands out further is an ear


def write_garment(
    path: Path, skin: Skin, parts: Mapping[str, tuple[str, list[Patches]]], fields: Mapping[str, Floats]
) -> Path:
    """Write parts, each a material and its patches, and pictures (h, w), 0..1, by "KIND/PART"."""
    every: dict[str, Array] = {"anchors": np.array(ANCHORS), "fit": np.array([outline(skin.data, ANCHORS)], np.int64)}
    every["parts"] = np.array([f"{name}:{material}" for name, (material, _) in parts.items()])
    for name, (_, patches) in parts.items():
        every |= {f"{name}/{key}": array for key, array in arrays(patches, skin).items()}
    every |= {key: np.rint(255 * np.clip(field, 0, 1)).astype(np.uint8) for key, field in fields.items()}
    return write_sidecar(path, every)


def picture(skin: Skin, part: int, values: Floats) -> Floats:
    """(SIZE, SIZE) values (s,) of the skin's samples as a picture over (u, v) of one part: each pixel its nearest."""
    own = np.flatnonzero(skin.part == part)
    at = np.linspace(0.0, 1.0, SIZE)
    grid = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2)
    _, near = cKDTree(skin.uv[own]).query(grid, k=3)
    return np.asarray(values[own][near].mean(axis=1).reshape(SIZE, SIZE))


def hair_fields(
    skin: Skin, line: Hairline, fade: tuple[float, float] = FADE_MM, patches: Sequence[Patches] = ()
) -> dict[str, Floats]:
    """Pictures of hair: skin between roots has its colour, deep inside nobody sees it, and what lies beside ``patches``
    lies in their shade."""
    inside = line.inside(skin.points)
    inside = np.where((skin.normals * (skin.points - (0, 40, 0))).sum(axis=1) > -20.0, inside, -50.0)
    inside = np.where(_stands_out(skin), -50.0, inside)
    cover, hidden = step(inside, *fade), step(inside, HIDDEN_MM - 0.5, HIDDEN_MM + 0.5)
    dark = shade(skin, patches) * (1.0 - cover) if patches else None
    out = {}
    for k, name in enumerate(ANCHORS):
        out[f"cover/{name}"] = picture(skin, k, cover)
        if dark is not None:
            out[f"shadow/{name}"] = picture(skin, k, dark)
        out[f"hidden/{name}"] = picture(skin, k, hidden)
    return out


def _stands_out(skin: Skin) -> Bools:
    """Which samples (s,) stand out from the skull, as ears do: nothing grows there."""
    away = skin.points - CENTRE
    return np.asarray(np.linalg.norm(away, axis=1) - skin.reach(unit(away)) > EAR_MM)


def cloth_fields(skin: Skin, neck: Neck) -> dict[str, Floats]:
    """Pictures of clothes: the skin below is hidden, that at the neck line lies in its shade."""
    hidden = hidden_below(skin, neck)
    return {f"hidden/{name}": picture(skin, k, hidden) for k, name in enumerate(ANCHORS)}


def beard_fields(skin: Skin, beard: Beard) -> dict[str, Floats]:
    """Picture of a beard: stubble on the skin between its locks."""
    return {f"cover/{ANCHORS[0]}": picture(skin, 0, beard_field(skin, beard))}
