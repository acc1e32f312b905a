"""Spatial index of control points: a regular grid over (u, v) that lists, per bin, those whose support reaches it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints, median


@dataclass(frozen=True)
class Bins:
    """Lists of control points by bin.

    grid : (6,) float64, u0, v0, bins per unit of u, bins per unit of v, u1, v1
    shape : (2,) int64, bins along u and v
    start : (bins + 1,) int64, where the list of each bin starts in ``ids``
    ids : (entries,) int32 control points
    """

    grid: Floats
    shape: Ints
    start: Ints
    ids: np.ndarray


def build_bins(knots_u: Floats, knots_v: Floats) -> Bins:
    """Return bins about as large as the median support of points with these padded knots, (n, w) float64 each."""
    from . import kernels  # compiled: loaded when first used

    axes = [_axis(knots_u), _axis(knots_v)]
    shape = np.array([count for _, _, count in axes], dtype=np.int64)
    while int(shape.prod()) > max(64, 8 * len(knots_u)):
        shape = np.maximum(1, shape // 2)
    scales = [n / (high - low) for (low, high, _), n in zip(axes, shape, strict=True)]
    grid = np.array([axes[0][0], axes[1][0], *scales, axes[0][1], axes[1][1]])
    start = np.zeros(int(shape.prod()) + 1, dtype=np.int64)
    ids = np.zeros(0, dtype=np.int32)
    kernels.fill_bins(knots_u, knots_v, grid, shape, start[1:], ids, True)
    np.cumsum(start, out=start)
    ids = np.zeros(int(start[-1]), dtype=np.int32)
    kernels.fill_bins(knots_u, knots_v, grid, shape, start[:-1].copy(), ids, False)
    return Bins(grid, shape, start, ids)


def _axis(knots: Floats) -> tuple[float, float, int]:
    """Return low end, high end and wanted number of bins along one direction."""
    low, high = float(knots[:, 0].min()), float(knots[:, -1].max())
    if high <= low:
        high = low + 1.0
    support = max(median(knots[:, -1] - knots[:, 0]), (high - low) / 1024)
    return low, high, int(np.clip(6.0 * (high - low) / support, 1, 1024))
