"""The box round a part, compiled: numpy's minimum along a short last axis costs more than posing the part."""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.jit import kernel


@kernel
def stretch(points: Any, low: Any, high: Any) -> None:
    """Widen the box ``low``, ``high`` (3,) float64 so that it holds every row of ``points`` (m, 3)."""
    for i in range(points.shape[0]):
        for axis in range(3):
            value = points[i, axis]
            if value < low[axis]:
                low[axis] = value
            if value > high[axis]:
                high[axis] = value


def box_corners(points: np.ndarray) -> np.ndarray:
    """Corners (8, 3) of the axis-parallel box round `points` (m, 3), m > 0."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    stretch(points, low, high)
    pick = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], bool)
    return np.where(pick, high, low)
