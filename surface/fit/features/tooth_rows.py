"""Close the gaps in a row of teeth: crowns are widened until neighbours touch, as grown teeth do.

Meshes of teeth often leave gaps of half a millimetre and more between crowns, through which one looks into the dark.
Each crown is widened about its own middle, along the row, and the more the nearer to the flank; heights and depths
stay. Crowns taper towards the gum, which leaves dark triangles there: these become narrower, too, as where the gum
fills them.
A map of space does it, so control points take it as samples of the surface do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from surface.base.arrays import Floats, Ints
from surface.dcp import DCPSurface
from surface.head.model.data import PartData
from surface.head.model.meshes import make_surface

SAMPLES = 41, 61  # of a tooth, along u and v
OVERLAP_MM = 0.2  # by which neighbours are let into each other, so that no slit opens when one looks from the side
MAX_GAP_MM = 4.0  # teeth that are further apart have lost one between them, and stay
FILLED = 0.85  # share of what two flanks are further apart towards the gum that is closed
FILLED_MM = 2.0  # no more than this counts as further apart: nearer to the root nothing is seen
BANDS, BAND_MM = 15, 0.8  # heights in which flanks are measured, and how far above and below such a height
ROUNDS = 4  # the map is not linear: what is left of a gap is closed again


def closed_row(part: PartData, *, upper: bool) -> Floats:
    """Return the control points (n, 3) of a part of teeth, one patch and one loop each, with its gaps closed."""
    first, row = np.array([loop[:, 0].min() for loop in part.loops]), make_surface(part)
    last = np.array([loop[:, 0].max() for loop in part.loops])
    middle = np.clip(part.knots_u, first[0], last[-1]).mean(axis=1)
    of = np.searchsorted(0.5 * (last[:-1] + first[1:]), middle)
    every = tooth_samples(row, part.loops)
    points = np.array(part.points, float)
    moved = close_gaps([points[of == k] for k in range(len(first))], every, upper=upper)
    for k, rows in enumerate(moved):
        points[of == k] = rows
    return points


def tooth_samples(row: DCPSurface, loops: Sequence[Floats]) -> list[Floats]:
    """Return samples (s, 3) of each tooth, evenly in (u, v)."""
    at = np.stack(np.meshgrid(*(np.linspace(0.0, 1.0, k) for k in SAMPLES), indexing="ij"), axis=-1).reshape(-1, 2)
    return [row.evaluate(loop.min(axis=0) + at * np.ptp(loop, axis=0)) for loop in loops]


def close_gaps(points: Sequence[Floats], samples: Sequence[Floats], *, upper: bool) -> list[Floats]:
    """Return control points (n, 3) of each tooth, widened so that neighbours touch.

    samples : (s, 3) of each tooth's surface, which need not be as many as its control points. Front is +z, up is y.
    upper : the gum is above the crowns, not below.
    """
    order = row_order(samples)
    out, seen = [np.array(p, float) for p in points], [np.array(s, float) for s in samples]
    for turn in range(ROUNDS):
        row = [seen[k] for k in order]
        borders = [_none, *(_needs(a, b, upper=upper, first=turn == 0) for a, b in pairwise(row)), _none]
        for i, (k, towards) in enumerate(zip(order, _directions(row), strict=True)):
            low, high = (seen[k] @ towards).min(), (seen[k] @ towards).max()
            for rows in (out[k], seen[k]):
                side = (rows @ towards - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-9)
                after, before = (borders[j](rows[:, 1]) for j in (i + 1, i))
                move = after * np.maximum(side, 0.0) - before * np.maximum(-side, 0.0)
                rows += move[:, None] * towards
    return out


def row_order(teeth: Sequence[Floats]) -> Ints:
    """Return the places of teeth (n, 3) in their row, from the right molar round the front to the left one."""
    middles = np.array([_middle(tooth) for tooth in teeth])
    behind = middles[:, 2].min() - 10.0
    return np.argsort(np.arctan2(middles[:, 0] - middles[:, 0].mean(), middles[:, 2] - behind))


def row_gaps(row: Sequence[Floats]) -> Floats:
    """Return how far neighbours of a row in its order are apart (k - 1,), mm, along the line between their middles;
    negative where one reaches into the other."""
    out = []
    for one, other in pairwise(row):
        along = _level(_middle(other) - _middle(one))
        out.append(float((other @ along).min() - (one @ along).max()))
    return np.array(out)


def _none(heights: Floats) -> Floats:
    return np.zeros(len(heights))


def _needs(one: Floats, other: Floats, *, upper: bool, first: bool) -> Callable[[Floats], Floats]:
    """By how much, mm, either of two neighbours has to reach further at heights (n,), mm. ``first`` : the taper towards
    the gum is filled once, while what is left of the gap is closed in every round."""
    (gap,) = row_gaps([one, other])
    if gap > MAX_GAP_MM:
        return _none
    touch = 0.5 * max(gap + OVERLAP_MM, 0.0)
    if not first:
        return lambda heights: np.full(len(heights), touch)
    along = _level(_middle(other) - _middle(one))
    low, high = max(one[:, 1].min(), other[:, 1].min()), min(one[:, 1].max(), other[:, 1].max())
    at = np.linspace(low + BAND_MM, high - BAND_MM, BANDS)
    apart = np.array([_apart(one, other, along, height) for height in at])
    more = gaussian_filter1d(np.clip(apart - gap, 0.0, FILLED_MM), 1.0, mode="nearest")
    closest = int(np.argmin(apart))
    more[slice(0, closest) if upper else slice(closest, None)] = 0.0  # towards the edges crowns stay round
    return lambda heights: touch + 0.5 * FILLED * np.interp(heights, at, more)


def _apart(one: Floats, other: Floats, along: Floats, height: float) -> float:
    """How far two teeth are apart at about a height, mm."""
    near, far = (rows[np.abs(rows[:, 1] - height) < BAND_MM] @ along for rows in (one, other))
    return float(far.min() - near.max()) if len(near) and len(far) else 0.0


def _directions(row: Sequence[Floats]) -> list[Floats]:
    """Directions (3,) of a row in its order at each of its teeth, level."""
    middles = np.array([_middle(tooth) for tooth in row])
    return [_level(middles[min(i + 1, len(row) - 1)] - middles[max(i - 1, 0)]) for i in range(len(row))]


def _level(direction: Floats) -> Floats:
    flat = direction * [1.0, 0.0, 1.0]
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-9))


def _middle(points: Floats) -> Floats:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))
