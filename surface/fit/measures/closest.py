"""Distances of points from a triangle mesh that moves, by a tree of boxes.

The nearest triangle of the pose before gives the first bound of a search, so most of the tree is never looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import inlined, kernel
from surface.mesh.boxtree import LEAF, BoxTree


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


class ClosestTree(BoxTree):
    """Distances from a mesh of triangles (t, 3) over vertices at rest (n, 3)."""

    def distances(self, points: Floats, near: Ints) -> Floats:
        """(m,) mm of points (m, 3); ``near (m,)`` is where the search begins, zeros at first, and is brought up to
        date."""
        out = np.empty(len(points))
        at = np.ascontiguousarray(points, np.float64)
        _search(at, self.corners, self.low, self.high, self.leaves, near, out)
        return out
