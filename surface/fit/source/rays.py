"""Intersect rays with triangles."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats


def intersect(tri: Floats, origins: Floats, rays: Floats) -> tuple[Floats, Floats, Floats]:
    """Distance (r, t) along each ray to each triangle, NaN where it misses, and the shares (r, t) of the triangle's
    second and third corner there (Moeller and Trumbore, 1997).

    Parameters
    ----------
    tri : (t, 3, 3); origins : (r, 3), or (3,) of all rays; rays : (r, 3) directions.
    """
    e1, e2, s = tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0], origins[..., None, :] - tri[:, 0]
    p, q = np.cross(rays[:, None], e2), np.cross(s, e1)
    det = (p * e1).sum(axis=-1)
    inverse = 1.0 / np.where(np.abs(det) < 1e-12, np.inf, det)
    a = (p * s).sum(axis=-1) * inverse
    b = (q @ rays[:, :, None])[..., 0] * inverse
    t = (q * e2).sum(axis=-1) * inverse
    hit = (a > -1e-6) & (b > -1e-6) & (a + b < 1 + 1e-6) & (t > 1e-6)
    return np.where(hit, t, np.nan), a, b
