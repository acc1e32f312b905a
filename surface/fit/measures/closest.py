"""Distances of points from a triangle mesh that moves: a tree of boxes over triangles in the order of a space curve.

The tree is made once, at rest; for a pose only its boxes are made again. The nearest triangle of the pose before gives
the first bound of a search, so most of the tree is never looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import inlined, kernel

LEAF = 4  # triangles in a leaf
BITS = 10  # of each coordinate in the space curve


@inlined
def _square(p: Any, a: Any, b: Any, c: Any) -> Any:
    """Square of the distance of p from the triangle a, b, c (Ericson, Real-Time Collision Detection, 2005, 5.1.5)."""
    e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    s0, s1, s2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1, d2 = e0 * s0 + e1 * s1 + e2 * s2, f0 * s0 + f1 * s1 + f2 * s2
    t0, t1, t2 = p[0] - b[0], p[1] - b[1], p[2] - b[2]
    d3, d4 = e0 * t0 + e1 * t1 + e2 * t2, f0 * t0 + f1 * t1 + f2 * t2
    u0, u1, u2 = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    d5, d6 = e0 * u0 + e1 * u1 + e2 * u2, f0 * u0 + f1 * u1 + f2 * u2
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3) if d1 > d3 else 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6) if d2 > d6 else 0.0
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        whole = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / whole if whole > 0.0 else 0.0
        v = 1.0 - w
    else:
        whole = va + vb + vc
        v, w = vb / whole, vc / whole
    x, y, z = s0 - v * e0 - w * f0, s1 - v * e1 - w * f1, s2 - v * e2 - w * f2
    return x * x + y * y + z * z


@kernel
def _refit(corners: Any, low: Any, high: Any, leaves: int) -> None:
    """Boxes ``low``, ``high`` (2 leaves, 3) of a complete tree, with root 1, over triangles ``corners (t, 3, 3)``."""
    for leaf in range(leaves):
        node = leaves + leaf
        for k in range(3):
            low[node, k], high[node, k] = np.inf, -np.inf
        for t in range(leaf * LEAF, min(len(corners), (leaf + 1) * LEAF)):
            for c in range(3):
                for k in range(3):
                    low[node, k] = min(low[node, k], corners[t, c, k])
                    high[node, k] = max(high[node, k], corners[t, c, k])
    for node in range(leaves - 1, 0, -1):
        for k in range(3):
            low[node, k] = min(low[2 * node, k], low[2 * node + 1, k])
            high[node, k] = max(high[2 * node, k], high[2 * node + 1, k])


@inlined
def _outside(p: Any, low: Any, high: Any) -> Any:
    """Square of the distance of p from a box."""
    x = max(low[0] - p[0], 0.0, p[0] - high[0])
    y = max(low[1] - p[1], 0.0, p[1] - high[1])
    z = max(low[2] - p[2], 0.0, p[2] - high[2])
    return x * x + y * y + z * z


@kernel
def _search(points: Any, corners: Any, low: Any, high: Any, leaves: int, nearest: Any, distance: Any) -> None:
    """``distance (m,)`` of points (m, 3) and the triangle ``nearest (m,)``, whose entries are where to begin."""
    stack = np.empty(64, np.int64)
    for i in range(len(points)):
        p, found = points[i], nearest[i]
        best = _square(p, corners[found, 0], corners[found, 1], corners[found, 2])
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if _outside(p, low[node], high[node]) >= best:
                continue
            if node >= leaves:
                first = (node - leaves) * LEAF
                for t in range(first, min(len(corners), first + LEAF)):
                    square = _square(p, corners[t, 0], corners[t, 1], corners[t, 2])
                    if square < best:
                        best, found = square, t
            else:
                left, right = 2 * node, 2 * node + 1
                if _outside(p, low[left], high[left]) < _outside(p, low[right], high[right]):
                    left, right = right, left
                stack[top], stack[top + 1] = left, right  # the nearer one is looked at first
                top += 2
        distance[i], nearest[i] = np.sqrt(best), found


class ClosestTree:
    """Distances from a mesh of triangles (t, 3) over vertices at rest (n, 3).

    order : (t,) the triangles in the tree's order, in which it counts them.
    """

    def __init__(self, rest: Floats, triangles: Ints) -> None:
        self.order = np.argsort(_curve(rest[triangles].mean(axis=1)), kind="stable")
        self._triangles = np.asarray(triangles, np.int64)[self.order]
        self._leaves = 1 << max(0, int(np.ceil(np.log2(max(1, -(-len(triangles) // LEAF))))))
        self._low, self._high = np.zeros((2 * self._leaves, 3)), np.zeros((2 * self._leaves, 3))
        self._corners = np.zeros((0, 3, 3))
        self.move(rest)

    def move(self, vertices: Floats) -> None:
        """Put the mesh's vertices (n, 3) elsewhere."""
        self._corners = np.ascontiguousarray(np.asarray(vertices, np.float64)[self._triangles])
        _refit(self._corners, self._low, self._high, self._leaves)

    def distances(self, points: Floats, near: Ints) -> Floats:
        """(m,) mm of points (m, 3); ``near (m,)`` is where the search begins, zeros at first, and is brought up to
        date."""
        out = np.empty(len(points))
        at = np.ascontiguousarray(points, np.float64)
        _search(at, self._corners, self._low, self._high, self._leaves, near, out)
        return out


def _curve(points: Floats) -> Ints:
    """(m,) places of points (m, 3) on Morton's curve."""
    low, extent = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-12)
    cell = ((points - low) / extent * ((1 << BITS) - 1)).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(BITS):
        for k in range(3):
            key |= ((cell[:, k] >> bit) & 1) << (3 * bit + k)
    return key
