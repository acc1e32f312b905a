"""Loops of a trimmed face over (u, v), made from the edges of the face in space.

Points of each edge are inverted to (u, v) and joined by straight lines. Where the surface closes, a point of its seam
lies at both ends of the closed direction: an edge along the seam belongs to the end that closes the loop, and runs
once along either; the ends of other edges belong to the end that the rest of the edge comes from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.dcp import DCPSurface

from .inversion import invert, search_between

MAX_POINTS = 1024  # points along one edge
MAX_DISTANCE = 3e-3  # of the face's size: an edge from its face; modelling tolerances are smaller
SEAM = 1e-3  # of a closed direction: nearer to its ends a point may belong to either
CLOSES = 1e-6  # of the size: two borders that agree so well are one seam
AT_POLE = 1e-3  # of the rectangle: nearer to a border that is a pole, a point is the pole
MAX_SEAMS = 8  # edges along seams in one loop
OPEN = 0.02  # of the rectangle: ends of neighbouring edges that are further apart leave the loop open

Rect = tuple[float, float, float, float]


@dataclass(frozen=True)
class TrimEdge:
    """A piece of a loop: points (k, 3) along it as the loop runs; empty at a pole, where it is no curve in space."""

    points: Floats

    @property
    def is_pole(self) -> bool:
        """Whether all of it is one point of the surface."""
        return not len(self.points)


def polyline(point: Callable[[float], Floats], start: float, end: float, error: float) -> Floats:
    """Return (k, 3): points of a curve whose chords deviate from it by less than ``error``, or :data:`MAX_POINTS`
    points."""
    count = 8
    while True:
        fine = np.array([point(t) for t in np.linspace(start, end, 2 * count + 1)])
        deviation = np.linalg.norm(fine[1::2] - (fine[:-2:2] + fine[2::2]) / 2, axis=1).max()
        if deviation < error or count >= MAX_POINTS:
            return fine[::2] if deviation < error else fine
        count *= 2


def loop_over(surface: DCPSurface, rect: Rect, edges: list[TrimEdge], size: float) -> Floats:
    """Return (k, 2): corners of the loop that ``edges`` make, in order, in the rectangle ``rect``.

    size : of the face, in space.

    ``ValueError`` where an edge does not lie on the surface, the loop does not close, or it crosses a seam elsewhere
    than along it.
    """
    curves = [edge for edge in edges if not edge.is_pole]
    if not curves:
        raise ValueError("has no edge in space")
    uv, distance = invert(surface, np.concatenate([c.points for c in curves]))
    cuts = np.cumsum([len(c.points) for c in curves])[:-1]
    parts, distances = np.split(uv, cuts), np.split(distance, cuts)  # views
    for curve, part, off in zip(curves, parts, distances, strict=True):
        search_between(surface, curve.points, part, off, CLOSES * size)
    if not (distance < MAX_DISTANCE * size).all():
        raise ValueError(f"lies up to {np.nanmax(distance):.3g} from its face")
    for part in parts:
        _leave_poles(part, rect, _poles(surface, rect, size))
    free = _seams(parts, rect, _closes(surface, rect, size))
    if len(free) > MAX_SEAMS:
        raise ValueError(f"runs along seams {len(free)} times, more than the {MAX_SEAMS} that are read")
    loop = _chain(parts, free, rect, _follow_directly(edges))
    extent = np.array([rect[1] - rect[0], rect[3] - rect[2]])
    if any((np.abs(np.diff(part, axis=0)) > extent / 2).any() for part in parts):
        raise ValueError("crosses the seam of its face, which is not read")
    return loop


def _borders(surface: DCPSurface, rect: Rect, axis: int) -> tuple[Floats, Floats]:
    """Return (17, 3): points along the border where the coordinate ``axis`` is least, and along that where it is
    greatest."""
    t = np.linspace(rect[2 - 2 * axis], rect[3 - 2 * axis], 17)
    both = [np.column_stack([np.full(17, end), t]) for end in rect[2 * axis : 2 * axis + 2]]
    low, high = (surface.evaluate(uv[:, ::-1] if axis else uv) for uv in both)
    return low, high


def _poles(surface: DCPSurface, rect: Rect, size: float) -> list[tuple[int, float]]:
    """Return the axis and coordinate of every border of the rectangle that is one point in space."""
    found = []
    for axis in range(2):
        for end, points in zip(rect[2 * axis : 2 * axis + 2], _borders(surface, rect, axis), strict=True):
            if float(np.ptp(points, axis=0).max()) < CLOSES * size:
                found.append((axis, end))
    return found


def _leave_poles(uv: Floats, rect: Rect, poles: list[tuple[int, float]]) -> None:
    """Give points at a pole, where the other coordinate is any, that of the nearest point along the edge;
    ``uv (k, 2)`` is changed."""
    for axis, end in poles:
        at = np.abs(uv[:, axis] - end) < AT_POLE * (rect[2 * axis + 1] - rect[2 * axis])
        sure = np.flatnonzero(~at)
        for k in np.flatnonzero(at) if len(sure) else ():
            uv[k, 1 - axis] = uv[sure[np.argmin(np.abs(sure - k))], 1 - axis]


def _closes(surface: DCPSurface, rect: Rect, size: float) -> tuple[bool, bool]:
    """Whether the surface returns to where it began, along u and along v."""
    out = []
    for axis in range(2):
        low, high = _borders(surface, rect, axis)
        out.append(bool(np.linalg.norm(low - high, axis=1).max() < CLOSES * size))
    return out[0], out[1]


def _seams(parts: list[Floats], rect: Rect, closes: tuple[bool, bool]) -> list[tuple[int, int]]:
    """Return part and axis of every edge along a seam; the ends of the others are put to the side they come from."""
    free = []
    for k, uv in enumerate(parts):
        for axis in np.flatnonzero(closes):
            low, high = rect[2 * axis], rect[2 * axis + 1]
            near = np.minimum(uv[:, axis] - low, high - uv[:, axis]) < SEAM * (high - low)
            if near.all():
                free.append((k, int(axis)))
            elif near.any():
                _settle(uv[:, axis], near, low, high)
    return free


def _settle(x: Floats, near: Bools, low: float, high: float) -> None:
    """Put points near a seam to the side of the nearest point along the edge that is not; ``x (k,)`` is changed."""
    sure = np.flatnonzero(~near)
    middle = (low + high) / 2
    for k in np.flatnonzero(near):
        left = x[sure[np.argmin(np.abs(sure - k))]] < middle
        if left != (x[k] < middle):
            x[k] = low if left else high


def _follow_directly(edges: list[TrimEdge]) -> Bools:
    """Return (c,): of each edge in space, whether the next one follows without a pole between."""
    curves = [k for k, edge in enumerate(edges) if not edge.is_pole]
    following = [*curves[1:], curves[0] + len(edges)]
    return np.array([b == a + 1 for a, b in zip(curves, following, strict=True)])


def _chain(parts: list[Floats], free: list[tuple[int, int]], rect: Rect, joined: Bools) -> Floats:
    """Return the corners of the loop with each edge along a seam at the end that leaves the smallest gaps; among equals
    the one that runs anticlockwise. ``parts`` are changed."""
    extent = np.array([rect[1] - rect[0], rect[3] - rect[2]])
    best: tuple[float, float, tuple[int, ...]] | None = None
    for sides in product((0, 1), repeat=len(free)):
        _put(parts, free, sides, rect)
        starts, ends = np.array([p[0] for p in parts]), np.array([p[-1] for p in parts])
        gap = np.abs(np.roll(starts, -1, axis=0) - ends) / extent
        widest = round(float(gap[joined].max(initial=0.0)), 4)
        area = _area(np.concatenate(parts))
        if best is None or (widest, -area) < best[:2]:
            best = widest, -area, sides
    assert best is not None  # product() yields at least the empty choice
    if best[0] > OPEN:
        raise ValueError("does not close over (u, v)")
    _put(parts, free, best[2], rect)
    return _drop_repeats(np.concatenate(parts))


def _put(parts: list[Floats], free: list[tuple[int, int]], sides: tuple[int, ...], rect: Rect) -> None:
    for (k, axis), side in zip(free, sides, strict=True):
        parts[k][:, axis] = rect[2 * axis + side]


def _area(loop: Floats) -> float:
    """Return signed area, positive anticlockwise."""
    x, y = loop.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _drop_repeats(loop: Floats) -> Floats:
    """Return the closed polyline without points that repeat the one before."""
    step = np.abs(loop - np.roll(loop, 1, axis=0)).max(axis=1)
    kept: Floats = loop[step > 1e-12 * np.abs(loop).max()]
    return kept
