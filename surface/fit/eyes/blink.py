"""Shut the lids of a mesh whose blink leaves a gap: its displacements are lengthened along the eyeball."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.openings import Opening
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import sources_of
from surface.head.model.parameters import smoothstep

OVERLAP_MM = 1.0  # further than to where they meet: contacts keep lids from passing through each other
UPPER = 0.85  # share of the way that the upper lid goes
BLINKS = 0.6  # of the opening's height: a shape that leaves more open is no whole blink and stays as it is
REACH = 0.7  # rad round the eyeball from a lid's edge: where the change has faded out
CORNER = 0.12  # of the opening's width: how far beyond its corners the change has faded out
COLUMNS = 33
SPREAD = 9  # columns to either side over which what is missing in one fades: lids are no curtains
LEAST_MM = 0.3  # of the way of an edge: in the corners it is none
STILL = 0.2  # of the way of the other lid: one that a blink takes no further follows as a whole
MOVED = 0.5  # of the way that a blink takes a lid: skin that it moves so far follows wholly, what it leaves alone stays


@dataclass(frozen=True)
class _Edges:
    """Both lids' edges as angles round the eyeball (COLUMNS,), over evenly spaced x (COLUMNS,)."""

    x: Floats
    upper: Floats
    lower: Floats

    @property
    def gap(self) -> Floats:
        gap: Floats = self.upper - self.lower
        return gap


def shut_blinks(mesh: FitMesh, openings: list[Opening], eyes: Floats, radius: float) -> tuple[FitMesh, list[str]]:
    """The mesh with blinks that shut the eyes, and what was changed, in words."""
    deltas, notes, sources = mesh.deltas.copy(), list[str](), sources_of(mesh.names)
    for opening, eye in zip(openings, eyes, strict=True):
        indices = sources.get(f"eyeBlink{opening.side}", [])
        if not indices:
            continue
        rest = mesh.vertices - eye
        move = deltas[indices].sum(axis=0)
        open_rest, open_shut = (_edges(at, opening.edge, rest) for at in (rest, rest + move))
        left = float(open_shut.gap.max()) * radius
        if left > BLINKS * float(open_rest.gap.max()) * radius:
            continue
        deltas[indices[0]] += _lengthened(rest, move, open_rest, open_shut, radius)
        if left > 0.5:
            notes.append(f"eyeBlink{opening.side} left {left:.1f} mm open: its displacements were lengthened")
    return replace(mesh, deltas=deltas), notes


def _angle(local: Floats) -> Floats:
    """(n,) angle of points round the eye's x axis, 0 ahead, + up."""
    return np.arctan2(local[:, 1], local[:, 2])


def _edges(local: Floats, edge: Ints, rest: Floats) -> _Edges:
    """The edges of both lids where ``local (n, 3)`` are; upper and lower are distinguished at rest, by the line between
    the corners."""
    at_rest = rest[edge]
    first, last = at_rest[np.argmin(at_rest[:, 0])], at_rest[np.argmax(at_rest[:, 0])]
    line = np.interp(at_rest[:, 0], [first[0], last[0]], [first[1], last[1]])
    above = at_rest[:, 1] >= line
    corners = np.array([np.argmin(at_rest[:, 0]), np.argmax(at_rest[:, 0])])
    x = np.linspace(local[edge[corners[0]], 0], local[edge[corners[1]], 0], COLUMNS)
    sides = []
    for own in (above, ~above):
        ids = edge[np.union1d(np.flatnonzero(own), corners)]
        ids = ids[np.argsort(local[ids, 0])]
        sides.append(np.interp(x, local[ids, 0], _angle(local[ids])))
    return _Edges(x, *sides)


def _spread(need: Floats) -> Floats:
    """What is missing in every column, or a share of what is missing in others beside it."""
    columns = np.arange(len(need))
    share = 1.0 - smoothstep(np.abs(columns[:, None] - columns), 0.0, SPREAD)
    out: Floats = (share * need).max(axis=1)
    return out


def _moved(rest: Floats, move: Floats, is_upper: Bools, before: _Edges, after: _Edges, radius: float) -> Floats:
    """(n,) how much skin follows: as far as the blink itself moves it, by the way of the lid's edge in that column."""
    far, out = np.linalg.norm(move, axis=1), np.ones(len(rest))
    ways = [radius * np.abs(a - b) for a, b in ((before.upper, after.upper), (before.lower, after.lower))]
    most = max(float(way.max()) for way in ways)
    for side, way in zip((is_upper, ~is_upper), ways, strict=True):
        if way.max() > STILL * most:
            edge = np.maximum(np.interp(rest[:, 0], before.x, way), LEAST_MM)
            out = np.where(side, smoothstep(far / (MOVED * edge)), out)
    return out


def _lengthened(rest: Floats, move: Floats, before: _Edges, after: _Edges, radius: float) -> Floats:
    """(n, 3) what to add to a blink's displacements, so that both edges meet and overlap a little."""
    local = rest + move
    along = (local[:, 0] - after.x[0]) / (after.x[-1] - after.x[0])
    inner = 1.0 - smoothstep(np.maximum(-along, along - 1.0), 0.0, CORNER)
    overlap = OVERLAP_MM / radius * np.clip(4.0 * before.gap / max(float(before.gap.max()), 1e-9), 0.0, 1.0)
    need = _spread(np.maximum(after.gap + overlap, 0.0))
    own, angle = np.interp(local[:, 0], after.x, need) * inner, _angle(rest)
    upper, lower = (np.interp(rest[:, 0], before.x, side) for side in (before.upper, before.lower))
    is_upper = angle >= 0.5 * (upper + lower)
    off = np.where(is_upper, angle - upper, lower - angle)
    fade = (
        (1.0 - smoothstep(off, 0.0, REACH)) * (local[:, 2] > 0.3 * radius) * (np.linalg.norm(rest, axis=1) < 2 * radius)
    )
    fade = fade * _moved(rest, move, is_upper, before, after, radius)
    turn = own * fade * np.where(is_upper, -UPPER, 1.0 - UPPER)
    c, s = np.cos(turn), np.sin(turn)
    y, z = c * local[:, 1] + s * local[:, 2], c * local[:, 2] - s * local[:, 1]
    return np.column_stack([np.zeros(len(rest)), y - local[:, 1], z - local[:, 2]])
