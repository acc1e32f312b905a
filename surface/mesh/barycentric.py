"""Barycentric coordinates of a point in many triangles of (u, v)."""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.jit import kernel


@kernel
def fill_barycentric(uv: Any, triangles: Any, point: Any, out: Any) -> Any:
    """Fill ``out (t, 3)`` with the barycentric coordinates of ``point (2,)`` in each of ``triangles (t, 3)``.

    ``uv (m, 2)`` are the vertices. Triangles without area get -inf. Returns the triangle whose least coordinate is
    greatest, the first of several: the one that holds the point, if any does.
    """
    best, greatest, u, v = 0, -np.inf, point[0], point[1]
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        au, av, bu, bv, cu, cv = uv[i, 0], uv[i, 1], uv[j, 0], uv[j, 1], uv[k, 0], uv[k, 1]
        area = (bu - au) * (cv - av) - (bv - av) * (cu - au)
        if area <= 0:
            out[t, :] = -np.inf
            continue
        out[t, 0] = ((bu - u) * (cv - v) - (bv - v) * (cu - u)) / area
        out[t, 1] = ((cu - u) * (av - v) - (cv - v) * (au - u)) / area
        out[t, 2] = ((au - u) * (bv - v) - (av - v) * (bu - u)) / area
        least = min(out[t, 0], out[t, 1], out[t, 2])
        if least > greatest:
            best, greatest = t, least
    return best
