"""Shut the lids of a mesh whose blink leaves a gap: its displacements are lengthened along the eyeball."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.openings import Opening
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import sources_of
from surface.head.model.parameters import smoothstep

OVERLAP_MM = 1.0  # by which a closing lid passes the place where both lids meet; contacts hold them back there
UPPER_FRACTION = 0.85  # of the missing way that the upper lid is moved; the lower lid is moved by the rest
MAX_LEFT_OPEN = 0.6  # of the opening's height: a shape that leaves more open is no complete blink and stays unchanged
FADE_RAD = 0.7  # angle round the eyeball from a lid's edge at which the change has faded out
CORNER_FADE = 0.12  # of the opening's width: distance beyond its corners at which the change has faded out
COLUMNS = 33
SPREAD_COLUMNS = 9  # columns to either side over which what is missing in one column fades out
MIN_WAY_MM = 0.3  # of a lid's edge that is lengthened: in the corners it hardly moves
MIN_MOTION = 0.2  # relative to the other lid: a lid that a blink moves less than this follows as a whole
FULL_MOTION = (
    0.5  # of the lid's own motion: skin that the blink moves this far follows fully, skin that it leaves still does not
)


@dataclass(frozen=True)
class LidEdges:
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
        open_rest, open_shut = (lid_edges(at, opening.edge, rest) for at in (rest, rest + move))
        left = float(open_shut.gap.max()) * radius
        if left > MAX_LEFT_OPEN * float(open_rest.gap.max()) * radius:
            continue
        deltas[indices[0]] += _lengthened(rest, move, open_rest, open_shut, radius)
        if left > 0.5:
            notes.append(f"eyeBlink{opening.side} left {left:.1f} mm open: its displacements were lengthened")
    return replace(mesh, deltas=deltas), notes


def angle_of(local: Floats) -> Floats:
    """(n,) angle of points round the eye's x axis, 0 ahead, + up."""
    return np.arctan2(local[:, 1], local[:, 2])


def lid_edges(local: Floats, edge: Ints, rest: Floats) -> LidEdges:
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
        sides.append(np.interp(x, local[ids, 0], angle_of(local[ids])))
    return LidEdges(x, *sides)


def _spread(need: Floats) -> Floats:
    """What is missing in every column, or a share of what is missing in others beside it."""
    columns = np.arange(len(need))
    share = 1.0 - smoothstep(np.abs(columns[:, None] - columns), 0.0, SPREAD_COLUMNS)
    out: Floats = (share * need).max(axis=1)
    return out


def _moved(rest: Floats, move: Floats, is_upper: Bools, before: LidEdges, after: LidEdges, radius: float) -> Floats:
    """(n,) how much skin follows: as far as the blink itself moves it, by the way of the lid's edge in that column."""
    far, out = np.linalg.norm(move, axis=1), np.ones(len(rest))
    ways = [radius * np.abs(a - b) for a, b in ((before.upper, after.upper), (before.lower, after.lower))]
    most = max(float(way.max()) for way in ways)
    for side, way in zip((is_upper, ~is_upper), ways, strict=True):
        if way.max() > MIN_MOTION * most:
            edge = np.maximum(np.interp(rest[:, 0], before.x, way), MIN_WAY_MM)
            out = np.where(side, smoothstep(far / (FULL_MOTION * edge)), out)
    return out


def _lengthened(rest: Floats, move: Floats, before: LidEdges, after: LidEdges, radius: float) -> Floats:
    """(n, 3) what to add to a blink's displacements, so that both edges meet and overlap a little."""
    local = rest + move
    along = (local[:, 0] - after.x[0]) / (after.x[-1] - after.x[0])
    inner = 1.0 - smoothstep(np.maximum(-along, along - 1.0), 0.0, CORNER_FADE)
    overlap = OVERLAP_MM / radius * np.clip(4.0 * before.gap / max(float(before.gap.max()), 1e-9), 0.0, 1.0)
    need = _spread(np.maximum(after.gap + overlap, 0.0))
    own, angle = np.interp(local[:, 0], after.x, need) * inner, angle_of(rest)
    upper, lower = (np.interp(rest[:, 0], before.x, side) for side in (before.upper, before.lower))
    is_upper = angle >= 0.5 * (upper + lower)
    off = np.where(is_upper, angle - upper, lower - angle)
    fade = (
        (1.0 - smoothstep(off, 0.0, FADE_RAD))
        * (local[:, 2] > 0.3 * radius)
        * (np.linalg.norm(rest, axis=1) < 2 * radius)
    )
    fade = fade * _moved(rest, move, is_upper, before, after, radius)
    turn = own * fade * np.where(is_upper, -UPPER_FRACTION, 1.0 - UPPER_FRACTION)
    c, s = np.cos(turn), np.sin(turn)
    y, z = c * local[:, 1] + s * local[:, 2], c * local[:, 2] - s * local[:, 1]
    return np.column_stack([np.zeros(len(rest)), y - local[:, 1], z - local[:, 2]])
