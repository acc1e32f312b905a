"""Find the triangle that covers each texel of a picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Array
from surface.base.jit import kernel


@kernel
def covering(corners: Array, height: int, width: int) -> Any:
    """Which triangle covers the middle of each texel, and where in it that lies.

    corners : (t, 3, 2) float64, x to the right and y down, in texels; triangles may run either way, and those without
    area cover nothing.

    Returns (height, width) int64, the last triangle that covers a texel, -1 where none does; and (height, width, 3)
    float64, the shares of its corners.
    """
    owner = np.full((height, width), -1, np.int64)
    shares = np.zeros((height, width, 3))
    for t in range(len(corners)):
        ax, ay = corners[t, 0, 0], corners[t, 0, 1]
        bx, by = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay
        cx, cy = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay
        double = bx * cy - by * cx
        if abs(double) < 1e-12:
            continue
        low_x, high_x = ax + min(0.0, bx, cx), ax + max(0.0, bx, cx)
        low_y, high_y = ay + min(0.0, by, cy), ay + max(0.0, by, cy)
        for y in range(max(int(low_y), 0), min(int(high_y) + 1, height)):
            for x in range(max(int(low_x), 0), min(int(high_x) + 1, width)):
                px, py = x + 0.5 - ax, y + 0.5 - ay
                second = (px * cy - py * cx) / double
                third = (bx * py - by * px) / double
                first = 1.0 - second - third
                if min(first, second, third) >= -1e-9:
                    owner[y, x] = t
                    shares[y, x, 0], shares[y, x, 1], shares[y, x, 2] = first, second, third
    return owner, shares
