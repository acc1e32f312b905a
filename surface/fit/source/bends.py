"""How far a mesh bends at its faces, and how far a face's slope can be trusted there."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import corners, directed_edges

HALF_TRUST_RAD = np.radians(20.0)  # bend of the mesh at a face at which its slope gets half the weight


def slope_trust(points: Floats, faces: Ints) -> Floats:
    """(f,) above 0 and up to 1: how much the slopes of faces (f, 4) with corners at points (n, 3) count.

    A face is flat where the surface that it stands for is curved, so its slope is the surface's to within the angle
    between it and its neighbours. Weighted by the inverse of that variance, smooth skin keeps its slopes, and in an ear
    of few faces positions decide.
    """
    trust: Floats = 1.0 / (1.0 + (bends(points, faces) / HALF_TRUST_RAD) ** 2)
    return trust


def bends(points: Floats, faces: Ints) -> Floats:
    """(f,) root mean square of the angles (rad) between a face's normal and those across its edges; 0 of one alone."""
    normal = _normals(points, faces)
    a, b = directed_edges(faces)
    face = np.repeat(np.arange(len(faces)), (faces >= 0).sum(axis=1))
    key, back = a * len(points) + b, b * len(points) + a
    order = np.argsort(key)
    found = order[np.minimum(np.searchsorted(key[order], back), len(key) - 1)] if len(key) else order
    both = key[found] == back
    one, two = face[both], face[found[both]]
    angle = np.arccos(np.clip((normal[one] * normal[two]).sum(axis=1), -1.0, 1.0))
    total, count = np.bincount(one, angle**2, len(faces)), np.bincount(one, minlength=len(faces))
    return np.sqrt(total / np.maximum(count, 1))


def _normals(points: Floats, faces: Ints) -> Floats:
    """(f, 3) unit normals, those of quads across their diagonals."""
    a, b, c, d = (points[i] for i in corners(faces))
    normal = np.cross(c - a, d - b)
    unit: Floats = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return unit
