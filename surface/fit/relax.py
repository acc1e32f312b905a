"""Open up holes that a chart squeezes flat, so that (u, v) is about as long across a lid as along it.

v is replaced by an increasing function of v that is steep near every flat hole; straight lines of constant v,
and with them slits, stay straight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.fit.islands import Island, boundary_loops

OPEN = 0.4  # height over width that a flat hole gets
BAND = 2.0  # half the height of the steep band, in heights of the hole
SAME = 0.01  # holes at the same height (two eyes) are opened once


def open_flat_holes(island: Island) -> Island:
    """The island with v stretched around its flat holes; u is unchanged, v keeps its range."""
    bands = _bands(island)
    if not bands:
        return island
    low, high = island.uv[:, 1].min(), island.uv[:, 1].max()
    ends = _stretch(np.array([low, high]), bands)
    v = low + (_stretch(island.uv[:, 1], bands) - ends[0]) * (high - low) / (ends[1] - ends[0])
    return Island(island.vertex, np.column_stack([island.uv[:, 0], v]), island.faces)


def _bands(island: Island) -> list[tuple[float, float, float]]:
    """Centre, half height and extra steepness of every band."""
    bands: list[tuple[float, float, float]] = []
    for loop in boundary_loops(island)[1:]:
        rim = island.uv[loop]
        width, height = np.ptp(rim, axis=0)
        centre = 0.5 * (rim[:, 1].min() + rim[:, 1].max())
        known = any(abs(centre - c) < SAME for c, _, _ in bands)
        if height < OPEN * width and not known:
            bands.append((centre, BAND * height, OPEN * width / max(height, 1e-6) - 1.0))
    return bands


def _stretch(v: NDArray[np.float64], bands: list[tuple[float, float, float]]) -> NDArray[np.float64]:
    """Integral of 1 + sum a / (1 + ((v - c) / s)^2) over the bands (c, s, a)."""
    return v + sum(a * s * np.arctan((v - c) / s) for c, s, a in bands)
