"""Border edges as a network: ways along them, and the nearest edge that is not simply the border's own next one.

Memory grows with the number of edges, also where thousands of short ones lie within a millimetre.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.mesh.boxtree import LEAF, BoxTree

DEPTH = 128  # boxes that wait in a search: two for each level of the tree
SLACK = 1.0 + 1e-9  # by which a box may be further away than the nearest edge and still be searched: rounding


class Network:
    """Edges between vertices ``ids (e, 2)``, any whole numbers, of ``length (e,)`` mm along the border."""

    def __init__(self, ids: Ints, length: Floats) -> None:
        names, ends = np.unique(ids, return_inverse=True)
        self.ends = np.ascontiguousarray(ends.reshape(-1, 2), np.int64)
        order = np.argsort(self.ends.ravel(), kind="stable")
        start = np.searchsorted(self.ends.ravel()[order], np.arange(len(names) + 1)).astype(np.int64)
        self._ways = start, order // 2, self.ends[:, ::-1].ravel()[order], np.asarray(length, np.float64)

    def nearest(self, at: Floats, rows: Ints, reach: float, along: float) -> tuple[Floats, Ints]:
        """Return the distance (k,) of the middles of edges ``rows (k,)`` from the nearest other edge, and its number;
        infinite and -1 where none is nearer than ``reach`` mm. Of several in the same distance the first counts.

        at : (e, 2, 3) where the ends of all edges are, mm.
        along : edges with less border than this between them, mm, are neighbours and left out, and so are those that
            share a vertex. Without that a border of very short edges would be nearest to itself everywhere.
        """
        distance, other = np.full(len(rows), np.inf), np.full(len(rows), -1, np.int64)
        if len(rows):
            tree = BoxTree(at.reshape(-1, 3), np.arange(2 * len(self.ends)).reshape(-1, 2)[:, [0, 1, 1]])
            boxes = tree.corners, tree.low, tree.high, tree.leaves, tree.order
            middles = at[rows].mean(axis=1)
            _nearest(rows, middles, *boxes, self.ends, *self._ways, along, reach, distance, other)
        return distance, other


@kernel
def _mark_ways(ends: Any, start: Any, edge: Any, far: Any, length: Any, reach: float, way: Any, waits: Any, queue: Any,
               reached: Any) -> int:  # fmt: skip
    """Write to ``way (v,)``, infinite before, the lengths of the shortest ways below ``reach`` from two vertices
    ``ends (2,)``, and to ``reached`` the vertices that have one; returns how many.

    Vertex v has the edges ``edge[start[v]]`` to ``edge[start[v + 1]]``, of ``length (e,)``, which end at ``far``. Ways
    are corrected from a queue until nothing changes (Moore's algorithm).
    """
    head, size, found = 0, 2, 2
    for side in range(2):
        way[ends[side]], waits[ends[side]], queue[side], reached[side] = 0.0, True, ends[side], ends[side]
    while size > 0:
        v = queue[head]
        head, size, waits[v] = (head + 1) % len(queue), size - 1, False
        for k in range(start[v], start[v + 1]):
            w, total = far[k], way[v] + length[edge[k]]
            if total < reach and total < way[w]:
                if way[w] == np.inf:
                    reached[found], found = w, found + 1
                way[w] = total
                if not waits[w]:
                    queue[(head + size) % len(queue)], waits[w], size = w, True, size + 1
    return found


@kernel
def _edge_square(p: Any, a: Any, b: Any) -> Any:
    """Return the square of the distance of ``p (3,)`` from the edge between ``a`` and ``b``."""
    d0, d1, d2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = d0 * d0 + d1 * d1 + d2 * d2
    t = 0.0
    if length > 0.0:
        t = min(1.0, max(0.0, ((p[0] - a[0]) * d0 + (p[1] - a[1]) * d1 + (p[2] - a[2]) * d2) / length))
    w0, w1, w2 = a[0] + t * d0 - p[0], a[1] + t * d1 - p[1], a[2] + t * d2 - p[2]
    return w0 * w0 + w1 * w1 + w2 * w2


@kernel
def _box_square(p: Any, low: Any, high: Any) -> Any:
    """Return the square of the distance of ``p (3,)`` from a box."""
    square = 0.0
    for k in range(3):
        square += max(low[k] - p[k], p[k] - high[k], 0.0) ** 2
    return square


@kernel
def _counts(own: Any, other: Any, square: float, best: float, j: int, found: int) -> Any:
    """Whether edge j between vertices ``other (2,)`` is nearer than the nearest one so far, ``found``, and ends at none
    of the vertices ``own (2,)``; of two in the same distance the first is nearer."""
    for v in own:
        for w in other:
            if v == w:
                return False
    return square < best or (square == best and 0 <= j < found)


@kernel
def _nearest(
    rows: Any, middles: Any, corners: Any, low: Any, high: Any, leaves: int, order: Any, ends: Any, start: Any,
    edge: Any, far: Any, length: Any, along: float, reach: float, distance: Any, other: Any,
) -> None:  # fmt: skip
    """See :meth:`Network.nearest`. Ways along the border are looked for only where another edge lies near."""
    count = len(start) - 1
    way, waits = np.full(count, np.inf), np.zeros(count, np.bool_)
    queue, reached, stack = np.zeros(count, np.int64), np.zeros(count, np.int64), np.zeros(DEPTH, np.int64)
    for q in range(len(rows)):
        own, best, found, marked, size = ends[rows[q]], reach * reach, -1, 0, 1
        stack[0] = 1
        while size > 0:
            size -= 1
            node = stack[size]
            if _box_square(middles[q], low[node], high[node]) > best * SLACK:
                continue
            if node < leaves:
                stack[size], stack[size + 1], size = 2 * node + 1, 2 * node, size + 2
                continue
            for t in range(LEAF * (node - leaves), min(len(order), LEAF * (node - leaves + 1))):
                j = order[t]
                square = _edge_square(middles[q], corners[t, 0], corners[t, 1])
                if not _counts(own, ends[j], square, best, j, found):
                    continue
                if marked == 0:
                    marked = _mark_ways(own, start, edge, far, length, along, way, waits, queue, reached)
                if way[ends[j, 0]] == np.inf and way[ends[j, 1]] == np.inf:
                    best, found = square, j
        way[reached[:marked]] = np.inf
        if found >= 0:
            distance[q], other[q] = np.sqrt(best), found
