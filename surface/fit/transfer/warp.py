"""Smooth maps of space that bring the points of a template to where they belong on a scan.

A map of space moves all that lies behind the skin along with it: lips stay closed and their linings, sockets and teeth
stay where they belong, which a map of the skin alone does not ensure.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator

from surface.base.arrays import Floats

STEP_MM = 0.5  # of differences
LEAST_WEIGHT = 1e-3


class Warp:
    """Affine map plus thin-plate splines in space that moves points near to where they shall go.

    points, goals : (n, 3), mm. weight : (n,) how closely each is followed, relative to ``stiffness``.
    """

    def __init__(self, points: Floats, goals: Floats, weight: Floats, stiffness: float) -> None:
        smoothing = stiffness / np.maximum(weight, LEAST_WEIGHT)
        self._spline = RBFInterpolator(points, goals - points, smoothing=smoothing, kernel="thin_plate_spline")

    def __call__(self, points: Floats) -> Floats:
        """Points (m, 3) moved."""
        moved: Floats = points + self._spline(points)
        return moved

    def jacobians(self, points: Floats, reach: float = STEP_MM) -> Floats:
        """(m, 3, 3) derivatives at points: column k belongs to coordinate k; ``reach`` mm to either side."""
        step = reach * np.eye(3)
        columns = [(self(points + s) - self(points - s)) / (2.0 * reach) for s in step]
        return np.stack(columns, axis=2)

    def turned(self, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
        """Points (m, 3) moved, and unit normals (m, 3) of a surface through them as it lies then."""
        first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross(normals, first)
        at, along, across = self(points), self(points + STEP_MM * first), self(points + STEP_MM * second)
        normal = np.cross(along - at, across - at)
        unit: Floats = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
        return at, unit
