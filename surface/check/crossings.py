"""Triangles that pass through each other, and how deep their vertices lie behind the surface that they passed.

Two triangles cross where an edge of one passes through the other (Möller and Trumbore, "Fast, Minimum Storage
Ray/Triangle Intersection", 1997); triangles in one plane only touch. A tree of boxes finds the pairs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.jit import inlined, kernel, merged
from surface.check.components import joined
from surface.mesh.boxtree import LEAF, BoxTree

ENCLOSED = 4.0  # maximum distance to the back of the flesh that encloses a point, in depths that are searched for
NO_KIND = -1
OBLIQUE = 1.5  # maximum depth of a vertex, relative to its distance from the crossing along its own surface: what the
# two surfaces have in common is no nearer to it than the other surface is, which an oblique way meets further away


@inlined
def _passes(p: Any, d0: Any, d1: Any, d2: Any, a: Any, b: Any, c: Any) -> Any:
    """Return where the segment from p by d passes through the triangle a, b, c: 0..1 out of its back, -1..0 into its
    front, 2 where it does not."""
    e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    h0, h1, h2 = d1 * f2 - d2 * f1, d2 * f0 - d0 * f2, d0 * f1 - d1 * f0
    det = e0 * h0 + e1 * h1 + e2 * h2
    out = 2.0
    if abs(det) > 1e-12:
        s0, s1, s2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
        u = (s0 * h0 + s1 * h1 + s2 * h2) / det
        if 0.0 <= u <= 1.0:
            k0, k1, k2 = s1 * e2 - s2 * e1, s2 * e0 - s0 * e2, s0 * e1 - s1 * e0
            v = (d0 * k0 + d1 * k1 + d2 * k2) / det
            t = (f0 * k0 + f1 * k1 + f2 * k2) / det
            if v >= 0.0 and u + v <= 1.0 and 0.0 <= t <= 1.0:
                out = -t if det > 0.0 else t
    return out


@inlined
def _is_on_one_side(x: Any, y: Any) -> Any:
    """Whether all corners of a triangle x (3, 3) lie on one side of the plane of y (3, 3)."""
    e0, e1, e2 = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
    f0, f1, f2 = y[2, 0] - y[0, 0], y[2, 1] - y[0, 1], y[2, 2] - y[0, 2]
    n0, n1, n2 = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    above, below = False, False
    for k in range(3):
        s = n0 * (x[k, 0] - y[0, 0]) + n1 * (x[k, 1] - y[0, 1]) + n2 * (x[k, 2] - y[0, 2])
        above, below = above or s >= 0.0, below or s <= 0.0
    return not (above and below)


@kernel
def _do_cross(x: Any, y: Any) -> Any:
    """Whether two triangles (3, 3) pass through each other."""
    if _is_on_one_side(x, y) or _is_on_one_side(y, x):
        return False
    for k in range(3):
        m = (k + 1) % 3
        if _passes(x[k], x[m, 0] - x[k, 0], x[m, 1] - x[k, 1], x[m, 2] - x[k, 2], y[0], y[1], y[2]) < 2.0:
            return True
        if _passes(y[k], y[m, 0] - y[k, 0], y[m, 1] - y[k, 1], y[m, 2] - y[k, 2], x[0], x[1], x[2]) < 2.0:
            return True
    return False


@inlined
def _is_apart(node: Any, low: Any, high: Any, least: Any, most: Any) -> Any:
    """Whether the box of a node is disjoint from another one."""
    return (
        low[node, 0] > most[0] or high[node, 0] < least[0] or low[node, 1] > most[1] or high[node, 1] < least[1]
        or low[node, 2] > most[2] or high[node, 2] < least[2]
    )  # fmt: skip


@inlined
def _has_vertex(ids: Any, j: Any, v: Any) -> Any:
    """Whether a vertex is a corner of triangle j."""
    return ids[j, 0] == v or ids[j, 1] == v or ids[j, 2] == v


@inlined
def _are_neighbours(ids: Any, i: Any, j: Any) -> Any:
    """Whether two triangles share a corner."""
    return _has_vertex(ids, j, ids[i, 0]) or _has_vertex(ids, j, ids[i, 1]) or _has_vertex(ids, j, ids[i, 2])


@inlined
def _is_outside(j: Any, corners: Any, least: Any, most: Any) -> Any:
    """Whether the box of a triangle is disjoint from another one."""
    out = False
    for k in range(3):
        a, b, c = corners[j, 0, k], corners[j, 1, k], corners[j, 2, k]
        out = out or (a > most[k] and b > most[k] and c > most[k]) or (a < least[k] and b < least[k] and c < least[k])
    return out


@merged
def _next_leaf(stack: Any, top: Any, low: Any, high: Any, leaves: Any, least: Any, most: Any) -> Any:
    """Return the first triangle of the next leaf whose box meets another one, or -1; and how many nodes are on the
    stack.

    ``stack`` holds the nodes of the tree that are still to be searched.
    """
    while top > 0:
        top -= 1
        node = stack[top]
        if _is_apart(node, low, high, least, most):
            continue
        if node >= leaves:
            return (node - leaves) * LEAF, top
        stack[top], stack[top + 1] = 2 * node, 2 * node + 1
        top += 2
    return -1, top


@kernel
def _search(
    rows: Any, ids: Any, kind: Any, meets: Any, moved: Any, corners: Any, low: Any, high: Any, leaves: int, out: Any
) -> int:
    """List pairs of a triangle of ``rows`` and another that cross, in ``out (k, 2)`` as far as it goes; returns how
    many there are. Those with a common corner of ``ids (t, 3)`` are neighbours and left out."""
    used, stack = 0, np.empty(64, np.int64)
    least, most = np.empty(3), np.empty(3)
    for i in rows:
        for k in range(3):
            least[k] = min(corners[i, 0, k], corners[i, 1, k], corners[i, 2, k])
            most[k] = max(corners[i, 0, k], corners[i, 1, k], corners[i, 2, k])
        stack[0], top = 1, 1
        while True:
            first, top = _next_leaf(stack, top, low, high, leaves, least, most)
            if first < 0:
                break
            for j in range(first, min(len(corners), first + LEAF)):
                if (
                    j == i
                    or (moved[j] and j < i)
                    or not meets[kind[i], kind[j]]
                    or _is_outside(j, corners, least, most)
                ):
                    continue
                if not _are_neighbours(ids, i, j) and _do_cross(corners[i], corners[j]):
                    if used < len(out):
                        out[used, 0], out[used, 1] = i, j
                    used += 1
    return used


@kernel
def _inward(pairs: Any, ids: Any, corners: Any, way: Any, cut: Any, away: Any) -> None:
    """For pairs (k, 2) of a triangle and one that it passes: mark in ``cut (k, 3)`` its edges that pass; at the end of
    an edge that lies behind the other triangle, ``way (k, 3, 3)`` is that one's unit normal, and ``away (k, 3)`` how
    far it is from where the edge passes, infinite elsewhere."""
    for p in range(len(pairs)):
        x, y = corners[pairs[p, 0]], corners[pairs[p, 1]]
        e, f = y[1] - y[0], y[2] - y[0]
        normal = np.array([e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]])
        length = np.sqrt((normal * normal).sum())
        for k in range(3):
            m = (k + 1) % 3
            t = _passes(x[k], x[m, 0] - x[k, 0], x[m, 1] - x[k, 1], x[m, 2] - x[k, 2], y[0], y[1], y[2])
            if t < 2.0:
                cut[p, k] = True
                e, behind = x[m] - x[k], k if t > 0.0 else m
                way[p, behind] = normal / length
                passed = abs(t) if t > 0.0 else 1.0 - abs(t)
                away[p, behind] = min(away[p, behind], passed * np.sqrt((e * e).sum()))


@kernel
def _first_back(
    points: Any, ways: Any, own: Any, reach: float, ids: Any, kind: Any, passed: Any, corners: Any, low: Any, high: Any,
    leaves: int, depth: Any,
) -> None:  # fmt: skip
    """``depth (k,)`` of points (k, 3) along ``ways (k, 3)`` to the back of the first triangle of a kind in ``passed``
    within ``reach``; 0 where it is seen from its front, or where there is none."""
    stack, least, most = np.empty(64, np.int64), np.empty(3), np.empty(3)
    for i in range(len(points)):
        p, best, back = points[i], 1.0, False
        d0, d1, d2 = reach * ways[i, 0], reach * ways[i, 1], reach * ways[i, 2]
        stack[0], top = 1, 1
        while True:
            for k in range(3):
                step = best * reach * ways[i, k]
                least[k], most[k] = min(p[k], p[k] + step), max(p[k], p[k] + step)
            first, top = _next_leaf(stack, top, low, high, leaves, least, most)
            if first < 0:
                break
            for j in range(first, min(len(corners), first + LEAF)):
                if not passed[kind[j]] or _is_outside(j, corners, least, most) or _has_vertex(ids, j, own[i]):
                    continue
                t = _passes(p, d0, d1, d2, corners[j, 0], corners[j, 1], corners[j, 2])
                if abs(t) < best:
                    best, back = abs(t), t > 0.0
        depth[i] = reach * best if back else 0.0


@kernel
def _spread(
    start: Any, beside: Any, cut: Any, at: Any, reach: float, way: Any, length: Any, far: Any, queue: Any
) -> int:
    """Carry ``way (n, 3)`` and ``length (n,)`` on from the first vertices of ``queue`` along edges that are not
    ``cut``, no further than ``reach``; ``far (n,)`` is how far each lies from them, infinite beyond. Returns how many
    the queue holds."""
    used = 0
    while used < len(queue) and queue[used] >= 0:
        used += 1
    row = 0
    while row < used:
        v = queue[row]
        row += 1
        for k in range(start[v], start[v + 1]):
            w = beside[k]
            if cut[k] or far[w] < np.inf:
                continue
            step = at[w] - at[v]
            away = far[v] + np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
            if away < reach:
                far[w], way[w], length[w] = away, way[v], length[v]
                queue[used] = w
                used += 1
    return used


class Crossings:
    """Finds what crosses among triangles (t, 3) over vertices at rest (n, 3).

    same : (n,) number of each vertex, equal for those in one place. kind : (t,) of each triangle.
    meets : (kinds, kinds) bool, symmetric: which kinds are tested against each other.
    asked : (t,) bool, triangles of which each pair must have at least one; default: all.
    """

    def __init__(
        self, rest: Floats, triangles: Ints, same: Ints, kind: Ints, meets: Bools, asked: Bools | None = None
    ) -> None:
        self.tree = BoxTree(rest, triangles)
        self.kind, self._meets, self._rest = kind[self.tree.order], meets, np.asarray(rest, np.float64)
        self._asked = np.ones(len(triangles), bool) if asked is None else asked[self.tree.order]
        self._one_of, self._ids = np.unique(same, return_index=True)[1], same[self.tree.triangles]
        self._shown = np.zeros(int(same.max(initial=-1)) + 1, bool)
        self._shown[self._ids[self._asked]] = True
        edges = self._ids[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
        self._count = int(same.max(initial=-1)) + 1
        self._keys, self._beside = edges[:, 0] * self._count + edges[:, 1], edges[:, 1].copy()
        self._start = np.searchsorted(edges[:, 0], np.arange(self._count + 1))

    def pairs(self, vertices: Floats, *, least: float = -1.0) -> Ints:
        """Return (k, 2): rows of ``tree.triangles`` that cross with the mesh's vertices (n, 3) where they are now.

        least : mm; only pairs of which one of those asked for has moved further than that from rest.
        """
        self.tree.move(vertices)
        away = np.abs(vertices - self._rest).max(axis=1) > least
        moved = away[self.tree.triangles].any(axis=1) & self._asked
        rows, out = np.flatnonzero(moved), np.zeros((8192, 2), np.int64)
        t = self.tree
        used = _search(rows, self._ids, self.kind, self._meets, moved, t.corners, t.low, t.high, t.leaves, out)
        if used > len(out):
            out = np.zeros((used, 2), np.int64)
            _search(rows, self._ids, self.kind, self._meets, moved, t.corners, t.low, t.high, t.leaves, out)
        return out[:used]

    def depths(
        self, pairs: Ints, passing: int, passed: int, reach: float, least: float, lining: int = NO_KIND
    ) -> tuple[Ints, Floats]:
        """Return vertices (k,) of triangles asked for, of a kind ``passing``, that lie behind triangles of a kind
        ``passed``, of pairs as :meth:`pairs` found them last, and how deep, mm: more than ``least``, no deeper than
        ``reach``. A vertex is as deep as the back of the first triangle of ``passed`` or of the kind ``lining``."""
        both = np.concatenate([pairs, pairs[:, ::-1]])
        both = both[(self.kind[both[:, 0]] == passing) & (self.kind[both[:, 1]] == passed)]
        if not len(both):
            return np.zeros(0, np.int64), np.zeros(0)
        way, cut, away = np.zeros((len(both), 3, 3)), np.zeros((len(both), 3), bool), np.full((len(both), 3), np.inf)
        _inward(both, self._ids, self.tree.corners, way, cut, away)
        at = np.zeros((self._count, 3))
        at[self._ids] = self.tree.corners
        ways, length, far, queue = self._seeds(both, way, away)
        cut_edges = self._cut(both, cut)
        used = _spread(self._start, self._beside, cut_edges, at, reach, ways, length, far, queue)
        found = queue[:used]
        depth = self._to_back(at, ways, found, reach, np.isin(np.arange(len(self._meets)), (passed, lining)))
        depth[depth >= OBLIQUE * (far[found] + length[found])] = 0.0
        reached = self._reached(found, depth, far, cut_edges)
        deep = (depth > least) & reached & self._shown[found]
        found, depth = found[deep], depth[deep]
        if passing == passed:  # what lies in the flesh sees a back outwards, too; the edge of a fold does not
            enclosed = self._to_back(at, self._normals(at), found, ENCLOSED * reach, np.ones(len(self._meets), bool))
            found, depth = found[enclosed > 0.0], depth[enclosed > 0.0]
        return self._one_of[found], depth

    def _to_back(self, at: Floats, ways: Floats, rows: Ints, reach: float, passed: Bools) -> Floats:
        t, out = self.tree, np.zeros(len(rows))
        _first_back(at[rows], ways[rows], rows, reach, self._ids, self.kind, passed, t.corners, t.low, t.high, t.leaves,
                    out)  # fmt: skip
        return out

    def _normals(self, at: Floats) -> Floats:
        """Return (n, 3): unit normals at vertices."""
        corner = self.tree.corners
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        own = self._ids.ravel()
        out = np.column_stack([np.bincount(own, np.repeat(cross[:, k], 3), len(at)) for k in range(3)])
        unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
        return unit

    def _seeds(self, pairs: Ints, way: Floats, away: Floats) -> tuple[Floats, Floats, Floats, Ints]:
        """Return the ends of edges behind what they pass: ways (n, 3), their distances (n,) from where an edge passes,
        the distance (n,) of others from them, which is 0 there, and a queue (n,) of them."""
        ways, length, far = np.zeros((self._count, 3)), np.full(self._count, np.inf), np.full(self._count, np.inf)
        hit = way.any(axis=2)
        ids = self._ids[pairs[:, 0]]
        ways[ids[hit]], far[ids[hit]] = way[hit], 0.0
        np.minimum.at(length, ids[hit], away[hit])
        queue = np.full(self._count, -1)
        first = np.unique(ids[hit])
        queue[: len(first)] = first
        return ways, length, far, queue

    def _reached(self, found: Ints, depth: Floats, far: Floats, cut: Bools) -> Bools:
        """Return (k,): which vertices ``found (k,)`` are joined to a crossing by others that lie behind something, too.

        depth : (k,). far : (n,) of all vertices, 0 at the crossings. cut : (edges,). Behind an end of a crossing the
        surface goes on in front, and comes to lie behind other parts of the head there.
        """
        behind = np.zeros(self._count, bool)
        behind[found] = depth > 0.0
        a, b = self._keys // self._count, self._beside
        both = behind[a] & behind[b] & ~cut
        label = joined(self._count, a[both].astype(np.int64), b[both].astype(np.int64))
        reached = np.zeros(self._count, bool)
        reached[label[found[(far[found] == 0.0) & (depth > 0.0)]]] = True
        return np.asarray(reached[label[found]])

    def _cut(self, pairs: Ints, cut: Bools) -> Bools:
        """Return (edges,): which of the mesh's edges, both ways, pass through something."""
        ends = self._ids[pairs[:, 0]]
        a, b = ends[cut], np.roll(ends, -1, axis=1)[cut]
        out = np.zeros(len(self._keys), bool)
        for key in (a * self._count + b, b * self._count + a):
            out[np.searchsorted(self._keys, key)] = True
        return out
