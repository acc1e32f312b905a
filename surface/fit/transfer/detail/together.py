"""Bring borders of skin that are one on a head together again, after each part of it has followed a scan by itself.

Parts move along their own normals, which differ most where borders end: their borders would come to lie millimetres
apart, and the seams of the new head, which put one onto the other, would fold the skin beside them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.head import HeadPart, Seam
from surface.head.posing.kernels import nearest_on_line

NEAR = 2e-3  # in (u, v): vertices of a border that are nearer than this to a seam's polyline are on it
ROUNDS = 12  # each halves what is left between two borders; where three meet it takes more of them


@dataclass(frozen=True)
class Side:
    """One border of a seam: vertices ``ids (k,)`` of a part and how far along the seam they lie, ``at (k,)``, in points
    of its polyline, in order."""

    part: str
    ids: Ints
    at: Floats


def sides_of(parts: Mapping[str, HeadPart], seams: Iterable[Seam]) -> list[tuple[Side, Side]]:
    """Both borders of every seam between two of some parts, by their names, or of one with itself."""
    out = []
    for seam in seams:
        if seam.part_a in parts and seam.part_b in parts:
            one, two = (_side(parts[n], uv) for n, uv in ((seam.part_a, seam.uv_a), (seam.part_b, seam.uv_b)))
            if len(one.ids) and len(two.ids):
                out.append((one, two))
    return out


def _side(part: HeadPart, line: Floats) -> Side:
    ids = np.unique(part.borders[part.borders[:, 0] < len(part.mesh.uv)])
    distance, at = np.empty(len(ids)), np.empty(len(ids))
    nearest_on_line(part.mesh.uv[ids], np.ascontiguousarray(line, np.float64), False, distance, at)
    on = distance < NEAR
    order = np.argsort(at[on], kind="stable")
    return Side(part.name, *_around(ids[on][order], at[on][order], line))


def _around(ids: Ints, at: Floats, line: Floats) -> tuple[Ints, Floats]:
    """Vertices along a polyline; where this is closed, the last one comes before the first, too, and the first behind
    the last."""
    if not len(ids) or not np.array_equal(line[0], line[-1]):
        return ids, at
    length = len(line) - 1.0
    return np.concatenate([ids[-1:], ids, ids[:1]]), np.concatenate([at[-1:] - length, at, at[:1] + length])


def brought_together(
    places: Mapping[str, Floats], sides: Iterable[tuple[Side, Side]]
) -> dict[str, tuple[Ints, Floats]]:
    """By part, its vertices (k,) on seams and where these are (k, 3) once both borders of every seam lie half-way.

    places : (n, 3) where all vertices of every part are.
    """
    now = {name: at.copy() for name, at in places.items()}
    pairs = list(sides)
    for _ in range(ROUNDS):
        moves = {name: np.zeros((len(at), 4)) for name, at in now.items()}
        for own, other in (pair for one, two in pairs for pair in ((one, two), (two, one))):
            there = _between(now[other.part][other.ids], other.at, own.at)
            np.add.at(moves[own.part], own.ids, np.column_stack([there - now[own.part][own.ids], np.ones(len(there))]))
        for name, m in moves.items():
            now[name] += 0.5 * m[:, :3] / np.maximum(m[:, 3:], 1.0)
    ids = {name: _ids_of(name, pairs) for name in now}
    return {name: (own, now[name][own]) for name, own in ids.items()}


def _ids_of(part: str, pairs: Iterable[tuple[Side, Side]]) -> Ints:
    """The vertices of a part on any seam, each once."""
    every = [side.ids for pair in pairs for side in pair if side.part == part]
    return np.unique(np.concatenate([np.zeros(0, np.int64), *every]))


def _between(places: Floats, at: Floats, wanted: Floats) -> Floats:
    """(k, 3) places along a polyline (m, 3), whose points lie ``at (m,)`` along it, where ``wanted (k,)`` says."""
    return np.column_stack([np.interp(wanted, at, places[:, k]) for k in range(3)])
