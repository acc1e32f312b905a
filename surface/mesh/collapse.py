"""Mesh decimation by edge collapse: fewer triangles over the same vertices, cheapest collapse first.

The measure is the quadric of Garland and Heckbert, "Simplifying Surfaces with Color and Texture using Quadric Error
Metrics" (1998): squared distance from the planes of the original triangles, in as many dimensions as a vertex has
coordinates. Several poses of one mesh, concatenated as coordinates, are thereby approximated together.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.mesh.mesh import border_edges

Ids = NDArray[np.integer]
_MIN_COS = 0.3  # between a triangle's normals before and after; less counts as flipped
_BORDER_WEIGHT = 4.0  # relative to that of a triangle's plane
_CHUNK_EDGES = 4096  # edges, or triangles, that are computed at a time


class Collapse:
    """A mesh while its edges are collapsed.

    places : (m, d) coordinates of every vertex, mm; the first three are its position at rest.
    locked : (m,) bool, vertices that stay.
    """

    def __init__(self, places: Floats, triangles: Ids, locked: NDArray[np.bool_]) -> None:
        self._places, self._locked = np.asarray(places, np.float64), locked
        self._triangles = [tuple(row) for row in triangles.tolist()]
        self._alive = np.ones(len(triangles), bool)
        self._around: list[set[int]] = [set() for _ in places]
        for t, corners in enumerate(self._triangles):
            for v in corners:
                self._around[v].add(t)
        m, d = self._places.shape
        self._a, self._b = np.zeros((m, d, d)), np.zeros((m, d))
        self._c, self._weight = np.zeros(m), np.zeros(m)
        self._border = np.zeros(m, bool)
        self._version = np.zeros(m, np.int64)
        self._heap: list[tuple[float, int, int, int, int]] = []
        self._add_quadrics(np.asarray(triangles, np.int64))

    def _add_quadrics(self, triangles: Ids) -> None:
        """Compute the quadrics of planes and borders, and the cost of every edge."""
        rim = border_edges(triangles.astype(np.int32))
        self._border[rim] = True
        for corners, scale in ((triangles, 1.0), (rim, _BORDER_WEIGHT)):
            for start in range(0, len(corners), _CHUNK_EDGES):
                self._add_flats(corners[start : start + _CHUNK_EDGES], scale)
        edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        edges = np.unique(np.vstack([edges, edges[:, ::-1]]), axis=0)
        edges = edges[~self._locked[edges[:, 0]]]
        for start in range(0, len(edges), _CHUNK_EDGES):
            self._push_collapses(*edges[start : start + _CHUNK_EDGES].T)

    def _add_flats(self, corners: Ids, scale: float) -> None:
        """Add to each corner's quadric the squared distance from the lines or planes through ``corners (k, 2 or 3)``.

        They are weighted by the square of the length or by the area, and by ``scale``.
        """
        points = self._places[corners]
        axes, size = _orthonormal_axes(points[:, 1:] - points[:, :1])
        weight = scale * (size if corners.shape[1] == 3 else size**2)
        away = weight[:, None, None] * (np.eye(points.shape[2]) - np.swapaxes(axes, 1, 2) @ axes)
        b = -np.einsum("kde,ke->kd", away, points[:, 0])
        c = -np.einsum("kd,kd->k", b, points[:, 0])
        for ids in corners.T:
            for sums, more in ((self._a, away), (self._b, b), (self._c, c), (self._weight, weight)):
                np.add.at(sums, ids, more)

    def _push_collapses(self, gone: Ids, kept: Ids) -> None:
        """Push the collapses of vertices ``gone (k,)`` into ``kept (k,)`` onto the heap.

        The key is the root mean square distance, mm, of the kept vertex from the planes of both.
        """
        p = self._places[kept]
        a, b = self._a[gone] + self._a[kept], self._b[gone] + self._b[kept]
        square = np.einsum("kd,kd->k", (a @ p[:, :, None])[:, :, 0] + 2.0 * b, p) + self._c[gone] + self._c[kept]
        weight = np.maximum(self._weight[gone] + self._weight[kept], 1e-12)
        costs = np.sqrt(np.maximum(square, 0.0) / weight)
        versions = self._version[gone].tolist(), self._version[kept].tolist()
        for entry in zip(costs.tolist(), gone.tolist(), kept.tolist(), *versions, strict=True):
            heapq.heappush(self._heap, entry)

    def run(self, error: float) -> NDArray[np.int32]:
        """Collapse edges that cost less than ``error`` mm; return the remaining triangles (k, 3) int32.

        May be called again with a larger error to continue.
        """
        while self._heap and self._heap[0][0] < error:
            _, gone, kept, one, two = heapq.heappop(self._heap)
            if self._version[gone] == one and self._version[kept] == two and self._may_merge(gone, kept):
                self._merge(gone, kept)
        left = [corners for corners, alive in zip(self._triangles, self._alive, strict=True) if alive]
        return np.array(left, np.int32).reshape(-1, 3)

    def _neighbours(self, v: int) -> set[int]:
        return {w for t in self._around[v] for w in self._triangles[t]} - {v}

    def _may_merge(self, gone: int, kept: int) -> bool:
        """Whether the mesh stays a manifold, no border vertex moves inside, and no triangle turns over."""
        shared = self._around[gone] & self._around[kept]
        if self._border[gone] and (not self._border[kept] or len(shared) != 1):
            return False
        opposite = {w for t in shared for w in self._triangles[t]} - {gone, kept}
        if not shared or (self._neighbours(gone) & self._neighbours(kept)) != opposite:
            return False
        return self._keeps_orientation(self._around[gone] - shared, gone, kept)

    def _keeps_orientation(self, triangles: set[int], gone: int, kept: int) -> bool:
        """Whether ``triangles`` at rest keep their orientation with ``kept`` in place of ``gone``."""
        before = np.array([self._triangles[t] for t in triangles], np.int64).reshape(-1, 3)
        n = _normals(self._places[before, :3])
        m = _normals(self._places[np.where(before == gone, kept, before), :3])
        size = np.sqrt(np.einsum("kd,kd->k", n, n) * np.einsum("kd,kd->k", m, m))
        return bool(((size > 0.0) & (np.einsum("kd,kd->k", n, m) > _MIN_COS * size)).all())

    def _merge(self, gone: int, kept: int) -> None:
        for t in self._around[gone]:
            if kept in self._triangles[t]:
                self._alive[t] = False
                for v in self._triangles[t]:
                    if v != gone:
                        self._around[v].discard(t)
            else:
                self._triangles[t] = tuple(kept if v == gone else v for v in self._triangles[t])
                self._around[kept].add(t)
        self._around[gone] = set()
        for sums in (self._a, self._b, self._c, self._weight):
            sums[kept] += sums[gone]
        self._version[[gone, kept]] += 1
        near = np.array(sorted(self._neighbours(kept)), np.int64)
        pairs = np.array([[*near, *[kept] * len(near)], [*[kept] * len(near), *near]], np.int64)
        self._push_collapses(*pairs[:, ~self._locked[pairs[0]]])


def _orthonormal_axes(edges: Floats) -> tuple[Floats, Floats]:
    """Return orthonormal axes (k, n, d) of the lines or planes that edges (k, n, d) span, and their sizes (k,).

    n is 1 for lines, with lengths, and 2 for planes, with areas. Axes of lines or planes without a direction are 0.
    """
    first = np.linalg.norm(edges[:, 0], axis=1)
    axes = np.zeros_like(edges)
    axes[:, 0] = edges[:, 0] / np.maximum(first, 1e-12)[:, None]
    if edges.shape[1] == 1:
        return axes, first
    rest = edges[:, 1] - np.einsum("kd,kd->k", edges[:, 1], axes[:, 0])[:, None] * axes[:, 0]
    second = np.linalg.norm(rest, axis=1)
    axes[:, 1] = rest / np.maximum(second, 1e-12)[:, None]
    return axes, 0.5 * first * second


def _normals(corners: Floats) -> Floats:
    """Return the normals (k, 3) of triangles (k, 3, 3), whose lengths are twice their areas."""
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return p[:, [1, 2, 0]] * q[:, [2, 0, 1]] - p[:, [2, 0, 1]] * q[:, [1, 2, 0]]
