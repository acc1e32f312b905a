"""Bring accessories within what a head can hold: long names are cut, large meshes and very many pieces are not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from surface.base.arrays import Bools, Ints
from surface.fit.source.kinds import listed
from surface.head.model.accessories import MAX_ACCESSORIES, MAX_NAME, MAX_TRIANGLES, MAX_VERTICES, Accessory, fault_of

ARRAYS = ("vertices", "normals", "uv", "shade")
"""Of an accessory, with a row for each vertex."""


class Piece(NamedTuple):
    """An accessory, and names of all pieces of the mesh of which it has some."""

    accessory: Accessory
    names: tuple[str, ...]


class Limited(NamedTuple):
    """Accessories that a head can hold, notes on what was changed, and names of the pieces that were left out."""

    accessories: tuple[Accessory, ...]
    notes: list[str]
    gone: list[str]


def within_limits(found: list[Accessory]) -> Limited:
    """Accessories as a head can hold them. Those that cannot be read again are left out, and those of the same look are
    joined where they are too many."""
    pieces = [Piece(_named(part), (one.name,)) for one in found for part in _cut(one)]
    faults = [fault_of(piece.accessory) for piece in pieces]
    good = [piece for piece, fault in zip(pieces, faults, strict=True) if not fault]
    kept = _joined(good) if len(good) > MAX_ACCESSORIES else good
    lost = dict.fromkeys(name for piece in kept[MAX_ACCESSORIES:] for name in piece.names)
    notes = [f"left out, because it could not be read again: {fault}" for fault in dict.fromkeys(faults) if fault]
    notes += [f"pieces of the same look are joined, {MAX_ACCESSORIES} accessories are the most"] * (
        len(kept) < len(good)
    )
    notes += [f"left out, {MAX_ACCESSORIES} accessories are the most: {listed([*lost])}"] * bool(lost)
    cut = dict.fromkeys(one.name for one in found if len(one.name) > MAX_NAME)
    notes += [f"names cut to {MAX_NAME} letters: {listed([_short(name) for name in cut])}"] * bool(cut)
    still = {name for piece in kept[:MAX_ACCESSORIES] for name in piece.names}
    gone = [name for name in dict.fromkeys(one.name for one in found) if name not in still]
    return Limited(tuple(piece.accessory for piece in kept[:MAX_ACCESSORIES]), notes, gone)


def some_triangles(accessory: Accessory, which: Bools | Ints) -> Accessory:
    """An accessory with some of its triangles, and the vertices of these."""
    used, corner = np.unique(accessory.triangles[which], return_inverse=True)
    rows: dict[str, Any] = {key: getattr(accessory, key)[used] for key in ARRAYS}
    return replace(accessory, triangles=corner.reshape(-1, 3).astype(np.int32), **rows)


def _named(accessory: Accessory) -> Accessory:
    return replace(accessory, name=_short(accessory.name))


def _short(name: str) -> str:
    return name if len(name) <= MAX_NAME else f"{name[: MAX_NAME - 1]}…"


def _cut(accessory: Accessory) -> list[Accessory]:
    """An accessory in as many pieces as it takes for each to be small enough."""
    count = len(accessory.triangles)
    if len(accessory.vertices) <= MAX_VERTICES and count <= MAX_TRIANGLES:
        return [accessory]
    parts = -(-count // (MAX_VERTICES // 3))  # no triangle has more than three vertices
    return [some_triangles(accessory, rows) for rows in np.array_split(np.arange(count), parts)]


def _joined(pieces: list[Piece]) -> list[Piece]:
    """Accessories of the same look as one, as far as that is not too large."""
    alike = dict[object, list[list[Piece]]]()
    for piece in pieces:
        own = piece.accessory
        look = own.kind, own.texture, own.colour, own.alpha, own.cutoff, own.two_sided, own.repeats
        groups = alike.setdefault(look, [[]])
        if not _fit([*groups[-1], piece]):
            groups.append([])
        groups[-1].append(piece)
    return [_one(group) for groups in alike.values() for group in groups]


def _fit(group: list[Piece]) -> bool:
    every = [piece.accessory for piece in group]
    return sum(len(a.vertices) for a in every) <= MAX_VERTICES and sum(len(a.triangles) for a in every) <= MAX_TRIANGLES


def _one(group: list[Piece]) -> Piece:
    every = [piece.accessory for piece in group]
    first = np.cumsum([0, *(len(a.vertices) for a in every[:-1])])
    rows: dict[str, Any] = {key: np.concatenate([getattr(a, key) for a in every]) for key in ARRAYS}
    triangles = np.concatenate([a.triangles + np.int32(k) for a, k in zip(every, first, strict=True)])
    names = tuple(name for piece in group for name in piece.names)
    return Piece(replace(every[0], triangles=triangles, **rows), names)
