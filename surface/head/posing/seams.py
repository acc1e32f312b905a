"""Seams: two islands of the mesh meet in one border; drawn from two surfaces it must not show a crack.

The first part is the master. After every pose the second part's border vertices are put onto the first part's
border edges, with its normals; slivers fill what is left between vertices that only the first part has and the
edges of the second.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.head.model.data import Seam
from surface.head.posing.kernels import nearest_on_line, stitch_border
from surface.head.posing.part import HeadPart

NEAR = 2e-3  # in (u, v): a vertex nearer than this to the seam's polyline is on it
SAME = 1e-4  # in points of the seam: vertices nearer than this are one


class SeamStitch:
    """One seam, ready to be closed.

    Parameters
    ----------
    seam : polylines of both sides; first, second : the parts they belong to. The second part gets slivers.
    """

    def __init__(self, seam: Seam, first: HeadPart, second: HeadPart) -> None:
        self.first, self.second = first, second
        a_ids, a_at = _around(*_along(first, seam.uv_a), seam.uv_a)
        b_ids, b_at = _along(second, seam.uv_b)
        inside = (b_at >= a_at.min(initial=np.inf) - SAME) & (b_at <= a_at.max(initial=-np.inf) + SAME)
        self.ids, at = b_ids[inside], b_at[inside]
        if len(a_ids) < 2 or not len(self.ids):
            self.ids = self.low = self.high = self.ids[:0]
            self.share = np.zeros(0, np.float32)
            return
        after = np.clip(np.searchsorted(a_at, at), 1, max(len(a_at) - 1, 1))
        self.low, self.high = a_ids[after - 1], a_ids[after]
        gap = np.maximum(a_at[after] - a_at[after - 1], 1e-12)
        self.share = np.clip((at - a_at[after - 1]) / gap, 0.0, 1.0).astype(np.float32)
        self._fill(a_ids, a_at, *_around(self.ids, at, seam.uv_a))

    def _fill(self, a_ids: Ints, a_at: Floats, ids: Ints, at: Floats) -> None:
        """Slivers over the first part's vertices ``a_ids`` that stand between neighbours ``ids`` of the second's."""
        directed = {(int(p), int(q)) for p, q in self.second.borders}
        triangles: list[Ints] = []
        copies: list[int] = []
        like: list[int] = []
        for p, q, start, end in zip(ids, ids[1:], at, at[1:], strict=False):
            between = a_ids[(a_at > start + SAME) & (a_at < end - SAME)]
            forward = (int(p), int(q)) in directed
            if not len(between) or not (forward or (int(q), int(p)) in directed):
                continue
            new = len(self.second.vertices) + len(copies) + np.arange(len(between))
            fan = np.concatenate([new, [q]])
            pairs = np.column_stack([np.full(len(between), p), fan[:-1], fan[1:]])
            triangles.append(pairs if forward else pairs[:, [0, 2, 1]])
            copies += between.tolist()
            like += [int(p)] * len(between)
        if copies:
            new = len(self.second.vertices) + np.arange(len(copies))
            self.second.append(np.array(like), np.concatenate(triangles))
            self.ids = np.concatenate([self.ids, new])
            self.low = np.concatenate([self.low, copies])
            self.high = np.concatenate([self.high, copies])
            self.share = np.concatenate([self.share, np.zeros(len(copies), np.float32)])

    def close(self) -> None:
        """Put the second part's border onto the first one's."""
        if not len(self.ids) or not (self.first.changed or self.second.changed):
            return
        one, two = self.first, self.second
        stitch_border(one.vertices, one.normals, two.vertices, two.normals, self.ids, self.low, self.high, self.share)
        self.second.touch()


def _along(part: HeadPart, line: Floats) -> tuple[Ints, Floats]:
    """Border vertices of a part on a polyline, and how far along it they lie, in its points; in order."""
    ids = np.unique(part.borders)
    distance, at = np.empty(len(ids)), np.empty(len(ids))
    nearest_on_line(part.mesh.uv[ids], np.ascontiguousarray(line, np.float64), False, distance, at)
    on = distance < NEAR
    ids, at = ids[on], at[on]
    order = np.argsort(at, kind="stable")
    return ids[order], at[order]


def _around(ids: Ints, at: Floats, line: Floats) -> tuple[Ints, Floats]:
    """Vertices along a polyline; on a closed one the last also stands before the first, the first after the last."""
    if not len(ids) or not np.array_equal(line[0], line[-1]):
        return ids, at
    length = len(line) - 1.0
    return np.concatenate([ids[-1:], ids, ids[:1]]), np.concatenate([at[-1:] - length, at, at[:1] + length])
