"""Smooth maps of space that bring the points of a template to where they belong on a scan.

A map of space also moves what lies behind the skin. Lips stay closed, and their inner sides, sockets and teeth stay
behind them, which a map of only the skin would not ensure.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solve

from surface.base.arrays import Floats
from surface.base.jit import kernel

STEP_MM = 0.5  # of the central differences
LEAST_WEIGHT = 1e-3


@kernel
def add_splines(at: Any, centres: Any, weights: Any, out: Any) -> None:
    """Add to ``out (m, 3)`` the thin-plate splines r² log r about centres (n, 3) with weights (n, 3) at ``at (m, 3)``.

    Point by point: a matrix of all distances, as scipy's RBFInterpolator makes it, takes five times as long.
    """
    for i in range(len(at)):
        a, b, c = 0.0, 0.0, 0.0
        for j in range(len(centres)):
            x, y, z = at[i, 0] - centres[j, 0], at[i, 1] - centres[j, 1], at[i, 2] - centres[j, 2]
            square = x * x + y * y + z * z
            if square > 0.0:
                value = 0.5 * square * np.log(square)
                a += value * weights[j, 0]
                b += value * weights[j, 1]
                c += value * weights[j, 2]
        out[i, 0] += a
        out[i, 1] += b
        out[i, 2] += c


@kernel
def add_slopes(at: Any, centres: Any, weights: Any, out: Any, slopes: Any) -> None:
    """As :func:`add_splines`, and add to ``slopes (m, 3, 3)`` their derivatives: column k belongs to coordinate k."""
    for i in range(len(at)):
        for j in range(len(centres)):
            x, y, z = at[i, 0] - centres[j, 0], at[i, 1] - centres[j, 1], at[i, 2] - centres[j, 2]
            square = x * x + y * y + z * z
            if square > 0.0:
                log = np.log(square)
                for k in range(3):
                    out[i, k] += 0.5 * square * log * weights[j, k]
                    slope = (log + 1.0) * weights[j, k]
                    slopes[i, k, 0] += slope * x
                    slopes[i, k, 1] += slope * y
                    slopes[i, k, 2] += slope * z


@kernel
def fill_splines(centres: Any, out: Any) -> None:
    """Fill the upper left (n, n) of ``out`` with the splines about each of centres (n, 3) at each of them."""
    for i in range(len(centres)):
        out[i, i] = 0.0
        for j in range(i):
            x, y, z = centres[i, 0] - centres[j, 0], centres[i, 1] - centres[j, 1], centres[i, 2] - centres[j, 2]
            square = x * x + y * y + z * z
            out[i, j] = out[j, i] = 0.5 * square * np.log(square) if square > 0.0 else 0.0


class Warp:
    """An affine map plus thin-plate splines in space, which moves points close to their goals.

    The smoothing spline of Wahba, "Spline Models for Observational Data" (1990), with r² log r: displacements are the
    splines' sum plus an affine map, the splines' weights being orthogonal to affine maps.

    points, goals : (n, 3), mm. weight : (n,) how closely each goal is reached, relative to ``stiffness``.
    """

    def __init__(self, points: Floats, goals: Floats, weight: Floats, stiffness: float) -> None:
        count = len(points)
        self._centres, self._middle = np.ascontiguousarray(points, np.float64), points.mean(axis=0)
        self._size = float(np.abs(points - self._middle).max()) or 1.0
        system = np.zeros((count + 4, count + 4))
        fill_splines(self._centres, system)
        system[np.arange(count), np.arange(count)] = stiffness / np.maximum(weight, LEAST_WEIGHT)
        system[:count, count:] = self._affine(self._centres)
        system[count:, :count] = system[:count, count:].T
        moves = np.vstack([goals - points, np.zeros((4, 3))])
        found = solve(system, moves, overwrite_a=True, overwrite_b=True, check_finite=False, assume_a="gen")
        self._weights, self._map = np.ascontiguousarray(found[:count]), found[count:]

    def __call__(self, points: Floats) -> Floats:
        """Points (m, 3) moved."""
        moved: Floats = points + self._affine(points) @ self._map
        add_splines(np.ascontiguousarray(points, np.float64), self._centres, self._weights, moved)
        return moved

    def _affine(self, points: Floats) -> Floats:
        """(m, 4) rows of ones and coordinates, about the middle of the centres and in units of their size."""
        return np.hstack([np.ones((len(points), 1)), (points - self._middle) / self._size])

    def jacobians(self, points: Floats, reach: float = STEP_MM) -> Floats:
        """(m, 3, 3) derivatives at points: column k belongs to coordinate k; ``reach`` mm to either side."""
        step = reach * np.eye(3)
        columns = [(self(points + s) - self(points - s)) / (2.0 * reach) for s in step]
        return np.stack(columns, axis=2)

    def turned(self, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Points (m, 3) moved, and unit normals (m, 3) of the moved surface through them."""
        at: Floats = points + self._affine(points) @ self._map
        slopes = np.tile(np.eye(3) + self._map[1:].T / self._size, (len(points), 1, 1))
        add_slopes(np.ascontiguousarray(points, np.float64), self._centres, self._weights, at, slopes)
        first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
        along, across = (np.einsum("nij,nj->ni", slopes, way) for way in (first, np.cross(normals, first)))
        normal = np.cross(along, across)
        unit: Floats = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
        return at, unit
