"""NURBS surfaces as control points with local knots."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .basis import Floats


def nurbs_arrays(
    degree_u: int,
    degree_v: int,
    knots_u: ArrayLike,
    knots_v: ArrayLike,
    control_points: ArrayLike,
    weights: ArrayLike | None = None,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Control points of a NURBS surface, each with its own slice of the knot vectors.

    Parameters
    ----------
    degree_u, degree_v : 0 to 7
    knots_u, knots_v : (nu + degree_u + 1,), (nv + degree_v + 1,) float64
    control_points : (nu, nv, 3) float64
    weights : (nu, nv) float64, positive; ones if left out

    Returns
    -------
    points (nu * nv, 3), weights (nu * nv,), knots_u (nu * nv, degree_u + 2), knots_v (nu * nv, degree_v + 2)

    Raises
    ------
    ValueError
        If shapes do not fit together.
    """
    net = np.asarray(control_points, dtype=np.float64)
    if net.ndim != 3 or net.shape[2] != 3:
        raise ValueError(f"control_points: shape {net.shape}, expected (nu, nv, 3)")
    nu, nv = net.shape[:2]
    w = np.ones((nu, nv)) if weights is None else np.asarray(weights, dtype=np.float64)
    if w.shape != (nu, nv):
        raise ValueError(f"weights: shape {w.shape}, expected {(nu, nv)}")
    local_u = _windows(knots_u, "knots_u", nu, degree_u)
    local_v = _windows(knots_v, "knots_v", nv, degree_v)
    return net.reshape(-1, 3), w.ravel(), np.repeat(local_u, nv, axis=0), np.tile(local_v, (nu, 1))


def _windows(knots: ArrayLike, name: str, count: int, degree: int) -> Floats:
    """(count, degree + 2): the knots each blending function along one direction stands on."""
    row = np.asarray(knots, dtype=np.float64)
    if row.shape != (count + degree + 1,):
        raise ValueError(
            f"{name}: shape {row.shape}, expected ({count + degree + 1},): {count} points of degree {degree}"
        )
    return np.lib.stride_tricks.sliding_window_view(row, degree + 2).copy()
