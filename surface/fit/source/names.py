"""Map shape names of other heads to ARKit's 52.

The table is ``names.toml`` beside this module; a user's own table comes before it::

    [names]
    "MyHead_grin_links" = "mouthSmileLeft"
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from surface.base import files
from surface.base.errors import FitError
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import SHAPES

SIDES = {"l": "Left", "left": "Left", "lft": "Left", "r": "Right", "right": "Right", "rgt": "Right"}
WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
EXAMPLE = 'a table looks like: [names] "My_Smile_L" = "mouthSmileLeft"'
MIDDLE = 0.06  # half the band about the middle in which a shape for both sides fades from one to the other, in widths


@dataclass(frozen=True)
class Source:
    """One shape of the mesh that adds to a parameter; ``side`` cuts it: "" for all of it."""

    index: int
    side: str = ""


@dataclass(frozen=True)
class NameMap:
    """Which shapes of a mesh make which of ARKit's 52.

    sources : parameter -> the shapes that add up to it, in the order of ARKit's list.
    missing : parameters that no shape makes; left_out : shapes of the mesh that make none.
    """

    sources: dict[str, list[Source]]
    missing: tuple[str, ...]
    left_out: tuple[str, ...]


def sources_of(names: tuple[str, ...]) -> dict[str, list[int]]:
    """For each of ARKit's 52 that the mesh has as a whole: indices of the mesh's shapes that add up to it."""
    found = map_names(names).sources
    return {n: [s.index for s in every] for n, every in found.items() if not any(s.side for s in every)}


def map_names(names: tuple[str, ...], own: Mapping[str, str] | None = None) -> NameMap:
    """Find ARKit's 52 among shape names; ``own`` maps further names and comes first."""
    own, start = own or {}, len(_common(names))
    exact = {n: i for i, n in enumerate(names) if n in SHAPES and n not in own}
    exact |= {own[n]: i for i, n in enumerate(names) if n in own}
    found: dict[str, dict[str, int]] = {}
    read = [(i, _read(n[start:]) or _read(n)) for i, n in enumerate(names) if n not in own]
    understood = [(i, r) for i, r in read if r is not None]
    for i, (key, side, _) in sorted(understood, key=lambda x: not x[1][2]):  # ARKit's own words before other ways
        found.setdefault(key, {}).setdefault(side, i)
    every = {s: [Source(exact[s])] if s in exact else _made(s, found) for s in SHAPES}
    sources = {shape: made for shape, made in every.items() if made}
    used = {s.index for made in sources.values() for s in made}
    missing = tuple(s for s in SHAPES if s not in sources)
    return NameMap(sources, missing, tuple(n for i, n in enumerate(names) if i not in used))


def _made(shape: str, found: dict[str, dict[str, int]]) -> list[Source]:
    """Sources of a parameter: one shape, two halves, or a half of a shape for both sides."""
    side = next((s for s in ("Left", "Right") if shape.endswith(s)), "")
    key = shape.removesuffix(side)
    by_side = found.get(key, {})
    if side in by_side:
        return [Source(by_side[side])]
    if not side and len(by_side) == 2:
        return [Source(by_side["Left"]), Source(by_side["Right"])]
    if side and set(by_side) == {""} and key in _table()["sided"]:
        return [Source(by_side[""], side)]
    return []


@cache
def _table() -> dict[str, dict[str, list[str]]]:
    return files.read_toml(Path(__file__).with_name("names.toml"))


@cache
def _keys() -> dict[str, str]:
    """Every way to say it, without spaces and sides -> key of the table."""
    every = [(key, way) for group in _table().values() for key, ways in group.items() for way in (key.lower(), *ways)]
    return {way.replace(" ", ""): key for key, way in every}


def _read(name: str) -> tuple[str, str, bool] | None:
    """Key of the table and side that a name means, and whether it is ARKit's own word.

    Everything before the last dot or colon is ignored.
    """
    words = [w.lower() for w in WORDS.findall(re.split(r"[.:|](?=[^.:|]{3})", name)[-1])]
    sides = [SIDES[w] for w in words if w in SIDES]
    base = "".join(w for w in words if w not in SIDES)
    key = _keys().get(base)
    if key is None or len(set(sides)) > 1 or len(sides) > 1:
        return None
    return key, sides[0] if sides else "", base == key.lower()


def _common(names: tuple[str, ...]) -> str:
    """What all names begin with, up to a separator."""
    low, high = (min(names), max(names)) if len(names) > 3 else ("", "")
    same = next((i for i, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), 0)
    return low[: max(low[:same].rfind(c) for c in "_. :|-") + 1]


def read_names(path: Path) -> dict[str, str]:
    """A user's table of names.

    Raises FitError: the file cannot be read, or maps to something that is not one of ARKit's 52.
    """
    with files.reading(path, FitError, hint=EXAMPLE):
        table = files.read_toml(path).get("names")
    if not isinstance(table, dict):
        raise FitError(f"{path}: there is no table [names]", hint=EXAMPLE)
    for name, shape in table.items():
        if not isinstance(shape, str) or shape not in SHAPES:
            raise FitError(f"{path}: names.{name}: {shape!r} is not one of ARKit's 52", hint="for example jawOpen")
    return table


def to_arkit(mesh: FitMesh, mapped: NameMap) -> FitMesh:
    """The mesh with only ARKit's shapes: halves added up, shapes for both sides cut in two down the middle."""
    x = mesh.vertices[:, 0]
    t = np.clip((x - 0.5 * (x.min() + x.max())) / (MIDDLE * max(x.max() - x.min(), 1e-9)), -1.0, 1.0)
    left = 0.5 + 0.25 * t * (3.0 - t * t)
    share = {"": np.ones(len(mesh.vertices)), "Left": left, "Right": 1.0 - left}
    deltas = np.zeros((len(mapped.sources), len(mesh.vertices), 3))
    for row, every in zip(deltas, mapped.sources.values(), strict=True):
        for source in every:
            row += share[source.side][:, None] * mesh.deltas[source.index]
    return replace(mesh, names=tuple(mapped.sources), deltas=deltas)
