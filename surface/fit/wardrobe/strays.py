"""Stray hairs: narrow fins that stand on a sheet along its strands, of which one sees single hairs against what lies
behind the head. Without them hair ends in a line as smooth as a helmet's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import BARE, Patches, greville
from surface.fit.wardrobe.skin import unit
from surface.fit.wardrobe.styles import ACROSS, ALONG, step

_POINTS, _GRID, _FAST = (2, 7), (3, 10), (2, 5)  # control points and vertices across and along a fin
_SUNK_MM = 0.6  # below the sheet, where fins begin, so that no gap is seen under them
_TILT = 0.45  # by how much fins lean to either side at most: upright ones would all be seen at once
_COVER = 0.62, 0.06  # at the sheet, and at a fin's upper edge: few hairs stand off far
_ENDS = 0.16  # of a fin's length, over which it begins and ends
_RISE_MM = 2.2  # by which hairs come further off the sheet along a fin
_LENGTH = 0.45, 0.75  # of a sheet's, how long fins are
_SHADE = 0.82, 1.22


@dataclass(frozen=True)
class Strays:
    """How stray a sheet's hair is: how many fins stand on it, how high, mm, and the share of its length over which they
    may lie."""

    count: int
    high_mm: float = 4.5
    reach: tuple[float, float] = (0.04, 1.0)


def strays(outer: Patches, how: Strays, middle: Floats, *, seed: int) -> Patches:
    """Fins (one patch each) on a sheet of one patch; ``middle`` (3,) is the place that its outside looks away from."""
    random = np.random.default_rng(seed)
    columns, sway = outer.points[0], outer.sway[0]
    normals = _normals(columns, middle)
    low, high = how.reach
    long = (high - low) * random.uniform(*_LENGTH, how.count)
    begins = low + random.uniform(0.0, 1.0, how.count) * (high - low - long)
    at = (np.arange(how.count) + random.uniform(0.2, 0.8, how.count)) / how.count
    rows = [_along(grid, at, begins, long) for grid in (columns, normals, sway[..., None])]
    base, out = rows[0], unit(rows[1])
    forward = unit(np.gradient(base, axis=1))
    aside = random.uniform(-_TILT, _TILT, how.count)[:, None, None] * unit(np.cross(out, forward))
    s = greville(_POINTS[1], 2)
    tall = how.high_mm * random.uniform(0.6, 1.0, how.count)[:, None] * step(s, 0.0, 0.5)
    points = np.stack([base - _SUNK_MM * out, base + tall[..., None] * unit(out + aside)], axis=1)
    return _patches(points, np.repeat(rows[2][:, None, :, 0], 2, axis=1), how, random)


def _along(grid: Floats, at: Floats, begins: Floats, long: Floats) -> Floats:
    """(k, 7, c) values of a grid (nu, nv, c) along k lines of its v: where they lie in u, begin, and how long they
    are."""
    nu, nv, _ = grid.shape
    i = at * (nu - 1)
    first = np.minimum(i.astype(int), nu - 2)
    share = (i - first)[:, None, None]
    lines = grid[first] * (1.0 - share) + grid[first + 1] * share
    every, s = np.linspace(0.0, 1.0, nv), greville(_POINTS[1], 2)
    return np.array(
        [
            np.column_stack([np.interp(b + n * s, every, line[:, c]) for c in range(line.shape[1])])
            for line, b, n in zip(lines, begins, long, strict=True)
        ]
    )


def _normals(columns: Floats, middle: Floats) -> Floats:
    """(nu, nv, 3) normals of a sheet's grid, away from ``middle``."""
    normals = unit(np.cross(np.gradient(columns, axis=0), np.gradient(columns, axis=1)))
    away = columns - middle
    outside = np.sign((normals * away).sum(axis=2, keepdims=True))
    return np.where(np.linalg.norm(normals, axis=2, keepdims=True) > 0.5, normals * outside, unit(away))


def _patches(points: Floats, sway: Floats, how: Strays, random: np.random.Generator) -> Patches:
    """Fins over control points (k, 2, 7, 3)."""
    count, (gu, gv) = len(points), _GRID
    s, t = np.meshgrid(np.linspace(0.0, 1.0, gu), np.linspace(0.0, 1.0, gv), indexing="ij")
    length = np.linalg.norm(np.diff(points[:, 0], axis=1), axis=2).sum(axis=1)[:, None, None]
    start = random.uniform(0.0, 8.0, (2, count, 1, 1))
    across = start[0] + ACROSS * (how.high_mm * s - _RISE_MM * t)
    ends = step(t, 0.0, _ENDS) * (1.0 - step(t, 1.0 - 2.0 * _ENDS, 1.0))
    cover = (_COVER[0] + (_COVER[1] - _COVER[0]) * s) * ends - BARE * (1.0 - ends)
    strands = np.stack(np.broadcast_arrays(across, start[1] + ALONG * length * t, cover, 1.0), axis=-1)
    shade = np.broadcast_to(random.uniform(*_SHADE, (count, 1, 1)), (count, gu, gv))
    return Patches(points, (1, 2), _GRID, _FAST, strands, np.broadcast_to(t**1.5, (count, gu, gv)), shade, sway)
