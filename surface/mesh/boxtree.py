"""A bounding box tree over triangles sorted along a space-filling curve, for searches in a mesh that moves.

The order is computed once, at rest; for a pose only the boxes are computed again.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel

LEAF = 4  # triangles in a leaf
BITS = 10  # of each coordinate on the curve


@kernel
def _refit(corners: Any, low: Any, high: Any, leaves: int) -> None:
    """Write the boxes ``low``, ``high`` (2 leaves, 3) of a complete tree over triangles ``corners (t, 3, 3)``."""
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


class BoxTree:
    """A complete binary tree of boxes around triangles (t, 3) over vertices at rest (n, 3).

    order : (t,) indices of the triangles, sorted along the curve. triangles : (t, 3) in that order.
    corners : (t, 3, 3) their corners where the mesh is now, in that order.
    low, high : (2 leaves, 3) boxes of the nodes. Node 1 is the root, 2 k and 2 k + 1 are the children of node k. Leaf j
        is node ``leaves`` + j and holds LEAF triangles from LEAF * j on.
    """

    def __init__(self, rest: Floats, triangles: Ints) -> None:
        self.order = np.argsort(_curve(rest[triangles].mean(axis=1)), kind="stable")
        self.triangles = np.asarray(triangles, np.int64)[self.order]
        self.leaves = 1 << max(0, int(np.ceil(np.log2(max(1, -(-len(triangles) // LEAF))))))
        self.low, self.high = np.zeros((2 * self.leaves, 3)), np.zeros((2 * self.leaves, 3))
        self.corners = np.zeros((0, 3, 3))
        self.move(rest)

    def move(self, vertices: Floats) -> None:
        """Set the positions of the vertices (n, 3) and compute the boxes again."""
        self.corners = np.ascontiguousarray(np.asarray(vertices, np.float64)[self.triangles])
        _refit(self.corners, self.low, self.high, self.leaves)


def _curve(points: Floats) -> Ints:
    """Return the positions (m,) of points (m, 3) along the Morton curve."""
    low, extent = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-12)
    cell = ((points - low) / extent * ((1 << BITS) - 1)).astype(np.int64)
    key = np.zeros(len(points), np.int64)
    for bit in range(BITS):
        for k in range(3):
            key |= ((cell[:, k] >> bit) & 1) << (3 * bit + k)
    return key
