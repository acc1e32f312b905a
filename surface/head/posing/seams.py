"""Close seams: two parts of a head that meet in one border are drawn from two surfaces and must not show a crack.

After every pose the second part's border vertices are put onto the first part's border edges, with its normals; slivers
fill the gaps between vertices that only the first part has and the edges of the second. Vertices that only the second
part has lie a little beyond the first one's edges, within its skin: exactly on an edge they would be rounded to either
side of it, and pictures would have holes of a pixel.
"""

from __future__ import annotations

from operator import is_

import numpy as np

from surface.base.addresses import make_table
from surface.base.arrays import Floats, Floats32, Ints
from surface.head.model.data import Seam
from surface.head.posing.kernels import nearest_on_line, stitch_border, stitch_bound
from surface.head.posing.part import HeadPart

NEAR = 2e-3  # in (u, v): vertices nearer than this to the seam's polyline are on it
ARRAYS = ("vertices", "normals", "second vertices", "second normals")
OVERLAP_MM = 0.02  # by which the second part reaches over the first where only it has a vertex
SAME = 1e-4  # along the seam, in points of its polyline: vertices nearer than this coincide


class SeamStitch:
    """Closes one seam: moves the border of the ``second`` part, which gets slivers, onto that of the ``first``.

    ids : (k,) vertices of the second part; low, high : (k,) those of the first that each is put between.
    share : (k,) float32, how far from ``low`` to ``high``. inward : (k,) float32, how far beyond that line, mm; see
    :func:`.kernels.stitch_border`.
    """

    def __init__(self, seam: Seam, first: HeadPart, second: HeadPart) -> None:
        self.first, self.second = first, second
        self._bound: tuple[Floats32, ...] = (np.zeros((0, 3), np.float32),) * len(ARRAYS)
        a_ids, a_at = _vertices_around(*_vertices_along(first, seam.uv_a), seam.uv_a)
        b_ids, b_at = _vertices_along(second, seam.uv_b)
        inside = (b_at >= a_at.min(initial=np.inf) - SAME) & (b_at <= a_at.max(initial=-np.inf) + SAME)
        self.ids, at = b_ids[inside], b_at[inside]
        if len(a_ids) < 2 or not len(self.ids):  # of a closed line, as also two equal points are, one counts thrice
            self.ids = self.low = self.high = self.ids[:0]
            self.share = self.inward = np.zeros(0, np.float32)
            return
        after = np.clip(np.searchsorted(a_at, at), 1, len(a_at) - 1)
        self.low, self.high = a_ids[after - 1], a_ids[after]
        gap = np.maximum(a_at[after] - a_at[after - 1], 1e-12)
        self.share = np.clip((at - a_at[after - 1]) / gap, 0.0, 1.0).astype(np.float32)
        self.inward = OVERLAP_MM * self._inner_side()
        self._fill(a_ids, a_at, *_vertices_around(self.ids, at, seam.uv_a))

    def _fill(self, a_ids: Ints, a_at: Floats, ids: Ints, at: Floats) -> None:
        """Add slivers over the first part's vertices ``a_ids`` that lie between neighbours ``ids`` of the second's."""
        directed = {(int(p), int(q)) for p, q in self.second.borders}
        triangles: list[Ints] = []
        copies: list[int] = []
        like: list[int] = []
        for p, q, start, end in zip(ids, ids[1:], at, at[1:], strict=False):
            between = a_ids[(a_at > start + SAME) & (a_at < end - SAME)]
            forward = (int(p), int(q)) in directed
            if not len(between) or not (forward or (int(q), int(p)) in directed):
                continue
            fan = np.append(len(self.second.vertices) + len(copies) + np.arange(len(between)), q)
            pairs = np.column_stack([np.full(len(between), p), fan[:-1], fan[1:]])
            triangles.append(pairs if forward else pairs[:, [0, 2, 1]])
            copies += between.tolist()
            like += [int(p)] * len(between)
        if copies:
            new = len(self.second.vertices) + np.arange(len(copies))
            self.second.append(np.array(like), np.concatenate(triangles))
            self.ids = np.concatenate([self.ids, new])
            self.low, self.high = np.concatenate([self.low, copies]), np.concatenate([self.high, copies])
            none = np.zeros(len(copies), np.float32)
            self.share, self.inward = np.concatenate([self.share, none]), np.concatenate([self.inward, none])

    def _inner_side(self) -> Floats32:
        """Return (k,): on which side of the way from ``low`` to ``high`` the first part lies, 1 left or -1 right; 0 for
        vertices that are also its own, and where no triangle has that edge."""
        one, out = self.first, np.zeros(len(self.ids), np.float32)
        between = np.flatnonzero((self.share > SAME) & (self.share < 1.0 - SAME))
        ends = np.sort(np.column_stack([self.low, self.high])[between], axis=1)
        corners = np.asarray(one.triangles, np.int64)
        third: dict[tuple[int, ...], int] = {}
        for k in range(3):
            edges = np.sort(corners[:, [k, (k + 1) % 3]], axis=1)
            ours = np.isin(edges @ [len(one.vertices), 1], ends @ [len(one.vertices), 1])
            third |= dict(zip(map(tuple, edges[ours].tolist()), corners[ours, (k + 2) % 3].tolist(), strict=True))
        for i, edge in zip(between.tolist(), map(tuple, ends.tolist()), strict=True):
            if edge in third:
                start, end, inner = (one.vertices[v] for v in (self.low[i], self.high[i], third[edge]))
                across = np.cross(one.normals[self.low[i]], end - start)
                out[i] = np.sign(across @ (inner - start))
        return out

    def close(self) -> None:
        """Put the second part's border onto the first one's, if either has changed."""
        one, two = self.first, self.second
        if not len(self.ids) or not (one.changed or two.changed):
            return
        arrays = one.vertices, one.normals, two.vertices, two.normals
        if not all(map(is_, arrays, self._bound)):  # seams add vertices to parts
            lines = {"ids": self.ids, "low": self.low, "high": self.high, "share": self.share, "inward": self.inward}
            self._table = make_table(dict(zip(ARRAYS, arrays, strict=True)) | lines)
            self._bound = arrays
        stitch_bound(self._table)
        two.touch()

    def join(self, vertices: Floats32, normals: Floats32, second_vertices: Floats32, second_normals: Floats32) -> None:
        """Put the border among the second part's vertices (m, 3) onto that among the first one's (k, 3)."""
        stitch_border(
            vertices, normals, second_vertices, second_normals, self.ids, self.low, self.high, self.share, self.inward
        )


def _vertices_along(part: HeadPart, line: Floats) -> tuple[Ints, Floats]:
    """Return border vertices of a part on a polyline, and how far along it they lie, in its points; in order."""
    ids = np.unique(part.borders)
    distance, at = np.empty(len(ids)), np.empty(len(ids))
    nearest_on_line(part.mesh.uv[ids], np.ascontiguousarray(line, np.float64), False, distance, at)
    on = distance < NEAR
    order = np.argsort(at[on], kind="stable")
    return ids[on][order], at[on][order]


def _vertices_around(ids: Ints, at: Floats, line: Floats) -> tuple[Ints, Floats]:
    """Return vertices along a polyline; on a closed one the last comes before the first, too, and the first after the
    last."""
    if not len(ids) or not np.array_equal(line[0], line[-1]):
        return ids, at
    length = len(line) - 1.0
    return np.concatenate([ids[-1:], ids, ids[:1]]), np.concatenate([at[-1:] - length, at, at[:1] + length])
