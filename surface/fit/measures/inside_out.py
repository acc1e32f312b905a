"""Find where a fitted surface is inside out: its triangles face the other way than the mesh does at the same (u, v).

Distances do not show this: a fold as deep as the lips' own, or a strip that runs back on itself, stays near the mesh.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats
from surface.fit.points.report import FittedPart
from surface.head.posing.part import HeadPart

NEIGHBOURS = 4  # faces of the mesh about a triangle, all of which must oppose it: a single one may lie beyond a crease
MAX_COSINE = -0.2  # between normals that oppose each other
MIN_WEIGHT = 0.5  # of the usual one: faces in folds and slivers do not show the orientation of the surface


class InsideOutFaces:
    """The triangles of one part of a head, and the faces of the mesh about each in (u, v)."""

    def __init__(self, fitted: FittedPart, part: HeadPart) -> None:
        slopes, triangles = fitted.chart.slopes, part.triangles.astype(np.int64)
        uv = np.asarray(part.uv, np.float64)
        self._triangles, self._uv = triangles[:0], uv[:0]
        if slopes is None or len(slopes.uv) < NEIGHBOURS or not len(triangles):
            return
        middle = uv[triangles].mean(axis=1)
        near = cKDTree(slopes.uv).query(middle, NEIGHBOURS)[1]
        usual = max(float(np.median(slopes.weight)), 1e-12)
        known = (slopes.weight[near] > MIN_WEIGHT * usual).all(axis=1)
        self._triangles, self._uv, self._near = triangles[known], middle[known], near[known]
        self._mix = slopes.mix_u, slopes.mix_v

    def find(self, surface: Floats, mesh: Floats) -> tuple[float, Floats]:
        """Area (mm²) of what is inside out where vertices of the part (m, 3) and of the mesh (n, 3) are, and its
        places (k, 2) in (u, v)."""
        if not len(self._triangles):
            return 0.0, self._uv
        along, across = (mix @ mesh[: mix.shape[1]] for mix in self._mix)
        wanted = _unit(np.cross(along, across))
        a, b, c = (surface[self._triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        cosine = np.einsum("tkx,tx->tk", wanted[self._near], _unit(normal))
        turned: Bools = cosine.max(axis=1) < MAX_COSINE
        return float(0.5 * np.linalg.norm(normal[turned], axis=1).sum()), self._uv[turned]


def _unit(vectors: Floats) -> Floats:
    length: Floats = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(length, 1e-12)
