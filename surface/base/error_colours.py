"""The colour scale of pictures that show errors: from blue for none over green, yellow and orange to red."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats

FULL_MM = 1.0  # error at the red end of the scale
SCALE = np.array([[0.16, 0.28, 0.55], [0.15, 0.50, 0.42], [0.72, 0.62, 0.10], [0.75, 0.24, 0.04], [0.55, 0.02, 0.02]])


def error_colours(error: Floats) -> Floats:
    """Return (m, 3): linear RGB of errors (m,), mm."""
    at = np.clip(error / FULL_MM, 0.0, 1.0) * (len(SCALE) - 1)
    return np.stack([np.interp(at, np.arange(len(SCALE)), SCALE[:, k]) for k in range(3)], axis=1)
