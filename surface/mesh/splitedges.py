"""Split edges of a triangle mesh in two, and all triangles at them, so that no cracks open."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from surface.base.arrays import Bools, Ints

from .mesh import border_edges

TEMPLATES: dict[int, tuple[tuple[int, int, int], ...]] = {
    0: ((0, 1, 2),),
    1: ((0, 3, 2), (3, 1, 2)),
    2: ((0, 1, 4), (0, 4, 2)),
    4: ((0, 1, 5), (5, 1, 2)),
    3: ((0, 3, 2), (3, 4, 2), (3, 1, 4)),
    5: ((0, 3, 5), (3, 1, 5), (5, 1, 2)),
    6: ((0, 1, 5), (1, 4, 5), (5, 4, 2)),
    7: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}
"""Triangles for each set of split edges, by bits: 1 for the edge from corner 0 to 1, 2 for 1 to 2, 4 for 2 to 0.
Corners 3 to 5 are the middles of these edges."""


class Middles:
    """Numbers the new vertices in the middles of edges; triangles that share an edge share its vertex.

    first : index of the first new vertex.
    """

    def __init__(self, first: int) -> None:
        self._first, self._made = first, {}  # type: tuple[int, dict[tuple[int, int], int]]
        self.ends: list[tuple[int, int]] = []

    def of(self, edges: Ints) -> Ints:
        """Return the vertices (k,) in the middles of ``edges (k, 2)``."""
        return np.array([self._number(min(a, b), max(a, b)) for a, b in edges.tolist()], np.int64)

    def _number(self, a: int, b: int) -> int:
        found = self._made.get((a, b))
        if found is None:
            found = self._made[a, b] = self._first + len(self.ends)
            self.ends.append((a, b))
        return found


def split_edges(triangles: Ints, wanted: Callable[[Ints], Bools], middles: Middles, *, borders: bool = False) -> Ints:
    """Return triangles (t', 3) with every wanted edge split once; border edges only with ``borders``.

    wanted : returns of edges (k, 2), lower end first, which to split. middles : numbers the new vertices.
    """
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    low = np.sort(edges, axis=1)
    unique, back = np.unique(low, axis=0, return_inverse=True)
    chosen = wanted(unique)
    if not borders:
        border = np.sort(border_edges(triangles.astype(np.int32)), axis=1)
        size = int(triangles.max()) + 1
        chosen &= ~np.isin(unique @ [size, 1], border @ [size, 1])
    marked = chosen[back.ravel()].reshape(-1, 3)
    kind = marked @ [1, 2, 4]
    corners = np.hstack([triangles, np.full((len(triangles), 3), -1)]).astype(np.int64)
    at, side = np.nonzero(marked)
    corners[at, 3 + side] = middles.of(low.reshape(-1, 3, 2)[at, side])
    out = [corners[kind == k][:, t] for k, each in TEMPLATES.items() for t in each if (kind == k).any()]
    return np.concatenate(out)
