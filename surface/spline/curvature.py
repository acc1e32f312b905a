"""Gaussian and mean curvature from exact derivatives (do Carmo, Differential Geometry of Curves and Surfaces, 3-3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats

from .controlpoints import ControlPoints


def curvatures(surface: ControlPoints, uv: ArrayLike, side: ArrayLike | None = None) -> tuple[Floats, Floats]:
    """Curvatures at ``uv``.

    Parameters
    ----------
    surface : the surface
    uv : (m, 2) float64
    side : as in :meth:`surface.DCPSurface.evaluate`

    Returns
    -------
    gaussian : (m,) float64, per length squared
    mean : (m,) float64, per length; positive where the surface bends towards S_u x S_v
        NaN where nothing covers or S_u x S_v vanishes
    """
    out = surface.sample_derivatives(uv, side, second=True)[1]
    su, sv, suu, suv, svv = (out[:, k] for k in range(1, 6))
    normal = np.cross(su, sv)
    area = np.linalg.norm(normal, axis=1)
    area[area == 0] = np.nan
    normal /= area[:, None]
    e, f, g = _dot(su, su), _dot(su, sv), _dot(sv, sv)
    ll, mm, nn = _dot(suu, normal), _dot(suv, normal), _dot(svv, normal)
    gaussian = (ll * nn - mm * mm) / area**2
    mean = (ll * g - 2 * mm * f + nn * e) / (2 * area**2)
    return gaussian, mean


def _dot(a: Floats, b: Floats) -> Floats:
    products: Floats = (a * b).sum(axis=1)
    return products
