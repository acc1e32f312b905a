"""Lay the gum of a row of teeth up to their necks on the side that is seen.

Seen into an open mouth, the inner sides of the lower side teeth show. Where the mesh's gum lies low there, their roots
stand free, as a serrated ridge; of the upper teeth the outer sides show, and dark gaps between their necks. The gum is
lifted between the teeth, and laid over this side up to their necks, which are arches: lowest in the middle of a tooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from surface.base.arrays import Floats
from surface.dcp import DCPSurface
from surface.fit.features.tooth_rows import row_order

STEP_MM = 0.5  # of the tables of a row, along it and in height
FLANK_MM, FLANK_SMOOTH = 0.6, 2.0  # how near samples count for a place of a table; smoothing along it, in steps
ROOT_WIDE = 5  # steps: below the necks gum goes over the most that a root reaches inwards within so many
THICK_MM, TOP_MM = (7.5, 3.5), 2.0  # how thick they are so far below their tips
ROUND = 0.5  # power of a sine: less is a flatter arch with steeper flanks
MOST_MM = 5.0  # no more than this it is lifted
LIFTED = -3.5, -1.5  # mm inwards of the row's middle: what lies further out stays, what lies further in is lifted
DEEP_MM = 8.0  # below the lifted edge, where the gum stays
UNDER_MM = 0.3  # how far the gum lies inside a tooth above its neck
SOFT_MM = 1.0  # over which it comes out of the tooth there
ROOT_MM = 4.0, 9.0  # below the neck, where it begins to lie where it was, and does
SEWN = 5.0  # weight with which borders meet, beside a sample's
KEPT = 0.25  # weight with which control points go where the space around them goes, beside a sample's


@dataclass(frozen=True)
class Side:
    """A side of a row of teeth. ``crown_mm`` : of a crown that is free, from its tip, of a molar and of a front tooth;
    ``papilla_mm`` : below the tips, where the gum between two teeth ends; ``over_mm`` : how far the gum lies on a tooth
    below its neck; ``upper`` : tips point down."""

    crown_mm: tuple[float, float]
    papilla_mm: float
    over_mm: float
    upper: bool = False
    outer: bool = False


LOWER_INNER = Side((4.0, 5.8), 3.0, 0.8)
UPPER_OUTER = Side((8.0, 10.3), 7.2, 0.3, upper=True, outer=True)


def laid_to_necks(
    points: Floats, surface: DCPSurface, uv: Floats, teeth: Sequence[Floats], side: Side = LOWER_INNER,
    seams: Sequence[tuple[Floats, Floats]] = (),
) -> Floats:  # fmt: skip
    """Return the control points (n, 3), mm, of the gums of a row of teeth, laid up to their necks on one side.

    points : (n, 3). surface : with these points. uv : (m, 2) places all over it. teeth : samples (s, 3) of each tooth.
    seams : places (k, 2) of one border and of the other one, which are to meet. Front is +z, up is y.
    """
    upright = np.array([1.0, -1.0 if side.upper else 1.0, 1.0])
    order = row_order(teeth)  # of a row that runs the other way round, the inner side is the outer one
    row = _Row([teeth[k] * upright for k in (order[::-1] if side.outer else order)], side)
    at = surface.evaluate(uv) * upright
    known = np.isfinite(at).all(axis=1)
    uv, at = uv[known], at[known]
    row.find_edge(at)
    apart = [(surface.basis_matrix(a) - surface.basis_matrix(b)).toarray() for a, b in seams]
    system = np.vstack([surface.basis_matrix(uv).toarray(), KEPT * np.eye(len(points)), *(SEWN * b for b in apart)])
    away = [-SEWN * b @ (points * upright) for b in apart]
    wanted = np.vstack([row.moves(at), KEPT * row.moves(points * upright), *away])
    laid: Floats = points + np.linalg.lstsq(system, wanted, rcond=None)[0] * upright
    return laid


class _Row:
    """A row of teeth along the line through their middles: tips, necks and inner sides by length and height."""

    def __init__(self, teeth: Sequence[Floats], side: Side) -> None:
        self._side = side
        middles = np.array([0.5 * (t.min(axis=0) + t.max(axis=0)) for t in teeth])[:, [0, 2]]
        ends = middles[[0, -1]] + 15.0 * _unit(middles[[0, -1]] - middles[[1, -2]])
        self._line = _rounded(np.vstack([ends[:1], middles, ends[1:]]))
        self._length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self._line, axis=0), axis=1))])
        placed = [self._place(t) for t in teeth]
        thick = [_thickness(d, t[:, 1]) for (_, d), t in zip(placed, teeth, strict=True)]
        self._s = np.arange(0.0, self._length[-1], STEP_MM)
        self._tip, self._neck = self._necks(placed, thick, [float(t[:, 1].max()) for t in teeth])
        every = np.concatenate([np.column_stack([s, d, t[:, 1]]) for (s, d), t in zip(placed, teeth, strict=True)])
        self._y = np.arange(every[:, 2].min(), every[:, 2].max(), STEP_MM)
        inner = _inner_sides(every, self._s, self._y)
        self._inner = _smoothed(inner)
        self._roots = _smoothed(maximum_filter1d(inner, ROOT_WIDE, axis=0))
        self._edge = np.zeros(len(self._s))

    def _necks(
        self, placed: Sequence[tuple[Floats, Floats]], thick: Sequence[float], tips: Sequence[float]
    ) -> tuple[Floats, Floats]:
        """Heights of tips and of the gum's edge, (k,) along the row."""
        centre = np.array([0.5 * (s.min() + s.max()) for s, _ in placed])
        free = np.interp(-np.array(thick), [-THICK_MM[0], -THICK_MM[1]], self._side.crown_mm)
        borders = 0.5 * (centre[1:] + centre[:-1])
        tip = np.interp(self._s, centre, tips)
        nearest = np.abs(self._s[:, None] - borders).min(axis=1)
        half = np.interp(self._s, centre, [0.5 * float(np.ptp(s)) for s, _ in placed])
        arch = np.sin(0.5 * np.pi * np.clip(nearest / half, 0.0, 1.0)) ** ROUND
        return tip, tip - self._side.papilla_mm - (np.interp(self._s, centre, free) - self._side.papilla_mm) * arch

    def find_edge(self, gum: Floats) -> None:
        """Find how high gums lie in the middle of the row, from samples (m, 3) of them."""
        s, d = self._place(gum)
        low = self._tip - self._side.papilla_mm
        for k, at in enumerate(self._s):
            near = (np.abs(s - at) < 1.5) & (np.abs(d) < 1.5)
            self._edge[k] = gum[near, 1].max() if near.any() else low[k]
        self._edge = gaussian_filter1d(self._edge, FLANK_SMOOTH)

    def moves(self, at: Floats) -> Floats:
        """(m, 3) by how much places (m, 3) of the gum move, mm."""
        s, d = self._place(at)
        tip, neck, edge = (np.interp(s, self._s, row) for row in (self._tip, self._neck, self._edge))
        lift = np.clip(tip - self._side.papilla_mm - edge, 0.0, MOST_MM)
        lift *= _eased(d, *LIFTED) * _eased(at[:, 1] - edge, -DEEP_MM, 0.0)
        inwards = self._inwards(s, d, at[:, 1] + lift, neck)
        _, slope = self._nearest(at)
        return np.column_stack([slope[:, 1] * inwards, lift, -slope[:, 0] * inwards])

    def _inwards(self, s: Floats, d: Floats, y: Floats, neck: Floats) -> Floats:
        """How much further inwards (m,) places of the gum go, mm, from their lengths, distances, heights and necks."""
        below = neck - y
        out = _eased(below, -SOFT_MM, SOFT_MM)
        crown, root = self._at(self._inner, s, y) - UNDER_MM, self._at(self._roots, s, y) + self._side.over_mm
        side = (1.0 - out) * crown + out * root
        return np.clip(side - d, 0.0, None) * _eased(d, -0.5, 1.0) * _eased(-below, -ROOT_MM[1], -ROOT_MM[0])

    def _at(self, table: Floats, s: Floats, y: Floats) -> Floats:
        """The values (m,) of a table (k, h) at lengths and heights (m,)."""
        i = np.clip(np.round(s / STEP_MM).astype(int), 0, len(self._s) - 1)
        j = np.clip(np.round((y - self._y[0]) / STEP_MM).astype(int), 0, len(self._y) - 1)
        return np.asarray(table[i, j])

    def _place(self, at: Floats) -> tuple[Floats, Floats]:
        """Length along the row and distance inwards of it, (m,) each, of places (m, 3)."""
        k, slope = self._nearest(at)
        off = at[:, [0, 2]] - self._line[k]
        along = (off * slope).sum(axis=1)
        return self._length[k] + along, slope[:, 1] * off[:, 0] - slope[:, 0] * off[:, 1]

    def _nearest(self, at: Floats) -> tuple[Floats, Floats]:
        """The nearest point (m,) of the line to places (m, 3), and its direction there (m, 2)."""
        square = ((at[:, None, [0, 2]] - self._line) ** 2).sum(axis=2)
        k = square.argmin(axis=1)
        slope = _unit(self._line[np.minimum(k + 1, len(self._line) - 1)] - self._line[np.maximum(k - 1, 0)])
        return k, slope


def _thickness(inwards: Floats, height: Floats) -> float:
    """How thick a tooth is near its tip, from samples (s,), mm."""
    return float(np.ptp(inwards[height > height.max() - TOP_MM]))


def _inner_sides(samples: Floats, s: Floats, y: Floats) -> Floats:
    """(k, h) how far inwards samples, (m, 3) length, distance and height, reach at lengths (k,) and heights (h,)."""
    out = np.full((len(s), len(y)), -np.inf)
    for k, at in enumerate(s):
        near = samples[np.abs(samples[:, 0] - at) < FLANK_MM]
        for j, height in enumerate(y):
            own = near[np.abs(near[:, 2] - height) < FLANK_MM, 1]
            out[k, j] = own.max(initial=-np.inf)
        known = np.flatnonzero(np.isfinite(out[k]))
        out[k] = np.interp(y, y[known], out[k, known]) if len(known) else -10.0
    return out


def _smoothed(table: Floats) -> Floats:
    return np.asarray(gaussian_filter1d(gaussian_filter1d(table, FLANK_SMOOTH, axis=0, mode="nearest"), 1.0, axis=1))


def _rounded(line: Floats) -> Floats:
    """A polyline (k, 2) with many points, smooth, from end to end."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    fine = np.linspace(0.0, length[-1], 400)
    dense = np.column_stack([np.interp(fine, length, line[:, i]) for i in range(2)])
    return np.asarray(gaussian_filter1d(dense, 12.0, axis=0, mode="nearest"))


def _eased(value: Floats, low: float, high: float) -> Floats:
    share = np.clip((value - low) / (high - low), 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))


def _unit(way: Floats) -> Floats:
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9))
