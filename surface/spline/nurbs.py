"""Conversion of NURBS surfaces to control points with local knots."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats
from surface.base.checks import numbers, require, require_weights

from .basis import MAX_DEGREE


def nurbs_arrays(
    degree_u: int,
    degree_v: int,
    knots_u: ArrayLike,
    knots_v: ArrayLike,
    control_points: ArrayLike,
    weights: ArrayLike | None = None,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return control points of a NURBS surface, each with its own slice of the knot vectors.

    degree_u, degree_v : 0 to 9
    knots_u, knots_v : (nu + degree_u + 1,), (nv + degree_v + 1,) float64
    control_points : (nu, nv, 3) float64
    weights : (nu, nv) float64, positive; ones if left out

    Returns points (nu * nv, 3), weights (nu * nv,), knots_u (nu * nv, degree_u + 2), knots_v (nu * nv, degree_v + 2).
    ``ValueError`` for shapes that do not fit together, a degree that is no whole number from 0 to 9, numbers that are
    not finite, weights that are not positive, knots that decrease; names the argument and the index.
    """
    net = numbers(control_points, "control_points")
    if net.ndim != 3 or net.shape[2] != 3:
        raise ValueError(f"control_points: shape {net.shape}, expected (nu, nv, 3)")
    if not net.size:
        raise ValueError(f"control_points: empty, shape {net.shape}")
    require(np.isfinite(net).all(axis=2), net, "control_points")
    nu, nv = net.shape[:2]
    w = np.ones((nu, nv)) if weights is None else numbers(weights, "weights")
    if w.shape != (nu, nv):
        raise ValueError(f"weights: shape {w.shape}, expected {(nu, nv)}")
    require_weights(w)
    local_u = _local_knots(knots_u, "u", nu, degree_u)
    local_v = _local_knots(knots_v, "v", nv, degree_v)
    return net.reshape(-1, 3), w.ravel(), np.repeat(local_u, nv, axis=0), np.tile(local_v, (nu, 1))


def _local_knots(knots: ArrayLike, axis: str, count: int, degree: int) -> Floats:
    """Return (count, degree + 2): the knots of each blending function along one direction."""
    if degree != int(degree) or not 0 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree_{axis}: must be a whole number from 0 to {MAX_DEGREE}, not {degree}")
    row = numbers(knots, f"knots_{axis}")
    if row.shape != (count + degree + 1,):
        raise ValueError(
            f"knots_{axis}: shape {row.shape}, expected ({count + degree + 1},): {count} points of degree {degree}"
        )
    falls = ~(np.diff(row) >= 0)
    if falls.any():
        k = int(np.argmax(falls)) + 1
        raise ValueError(f"knots_{axis}[{k}]: {row[k]} after {row[k - 1]}; knots must be finite and not decrease")
    return np.lib.stride_tricks.sliding_window_view(row, degree + 2).copy()
