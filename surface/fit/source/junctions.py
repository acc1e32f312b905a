"""Join the borders of pieces of a mesh that lie on each other but share no edges.

Two pieces that were cut into faces each by itself, as the parts of an exported head are, touch along a line on which
each has vertices of its own (T-junctions). Vertices in one place become one, and edges are split where a vertex of
another border lies on them, so that both sides have the same edges. Only what stays together in every shape is joined:
lips that touch at rest stay two. Nothing is moved by more than :data:`NEAR_MM`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.kinds import material_of
from surface.fit.source.mesh import FitMesh, directed_edges, renumbered

NEAR_MM = 0.15  # of a head of usual size: borders so near to each other, at rest and in every shape, are one
SHEETS = ("skin", "mouth", "tongue")  # materials of what is joined: hairs, lashes and teeth only stand on the skin
BALL, MOST_BALLS = 20.0, 128  # width of the balls along an edge in which vertices are sought, in NEAR_MM, and how many
NEIGHBOURS = 33  # a point with the nearest ones that it is compared with: a mesh may have thousands in one place
_EDGES = 4096  # edges that are looked at in one go

Chains = dict[tuple[int, int], list[int]]  # directed border edge -> the vertices on it, in order


@dataclass(frozen=True)
class _Border:
    """Border edges of a mesh: start and stop (e,), the face (e,) and the piece (e,) that each belongs to."""

    start: Ints
    stop: Ints
    face: Ints
    piece: Ints

    def vertices(self) -> Ints:
        """All vertices on borders, rising."""
        return np.unique(np.concatenate([self.start, self.stop]))


def joined_borders(mesh: FitMesh, scale: float = 1.0) -> tuple[FitMesh, list[str]]:
    """The mesh with shared edges where borders lie on each other, and what was done, in words.

    scale : size of the head relative to a usual one. A mesh without such borders comes back as it is.
    """
    mesh, welded = _welded(mesh, NEAR_MM * scale)
    border = _border(mesh)
    chains = _matched(_chains(mesh, border, NEAR_MM * scale), border)
    if chains:
        mesh = _split(mesh, chains)
    count = sum(map(len, chains.values()))
    if not (welded or count):
        return mesh, []
    return mesh, [f"borders of pieces that touch were joined: {welded} vertices welded, {count} put into edges"]


def _border(mesh: FitMesh) -> _Border:
    """Border edges of the sheets of a mesh."""
    a, b = directed_edges(mesh.faces)
    face = np.repeat(np.arange(len(mesh.faces)), (mesh.faces >= 0).sum(axis=1))
    n = len(mesh.vertices)
    alone = ~np.isin(a * n + b, b * n + a)
    piece = mesh.piece if len(mesh.piece) else np.zeros(len(mesh.faces), np.int64)
    sheet = np.array([material_of(name) in SHEETS for name in mesh.pieces] or [True])
    own = np.flatnonzero(alone & sheet[piece[face]])
    return _Border(a[own], b[own], face[own], piece[face[own]])


def _welded(mesh: FitMesh, near: float) -> tuple[FitMesh, int]:
    """The mesh with vertices of borders that stay within ``near`` mm of each other as one, and how many went."""
    border = _border(mesh)
    ids = border.vertices()
    pairs = ids[_near_pairs(mesh.vertices[ids], near)]
    low, high = _pieces(mesh, border)
    pairs = pairs[_may_meet(mesh, border, pairs[:, 0], low[pairs[:, 1]], high[pairs[:, 1]])]
    for moves in mesh.deltas:
        pairs = pairs[np.linalg.norm(moves[pairs[:, 0]] - moves[pairs[:, 1]], axis=1) <= near]
    n = len(mesh.vertices)
    while len(pairs):
        label = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]
        first = np.unique(label, return_index=True)[1]
        faces = np.where(mesh.faces >= 0, first[label][mesh.faces], -1)
        crowded = np.isin(first[label][pairs[:, 0]], _crowded(faces, n))
        if not crowded.any():
            used, faces = renumbered(faces)
            return replace(mesh, vertices=mesh.vertices[used], deltas=mesh.deltas[:, used], faces=faces), n - len(first)
        pairs = pairs[~crowded]
    return mesh, 0


def _near_pairs(at: Floats, near: float) -> Ints:
    """(k, 2) pairs of points (m, 3) within ``near`` of each other; of many in one place only some of the pairs."""
    distance, other = cKDTree(at).query(
        at, k=np.arange(1, NEIGHBOURS + 1), distance_upper_bound=np.nextafter(near, np.inf)
    )
    own = np.broadcast_to(np.arange(len(at))[:, None], other.shape)
    close = np.isfinite(distance) & (own != other)
    pairs: Ints = np.unique(np.sort(np.column_stack([own[close], other[close]]), axis=1), axis=0)
    return pairs.astype(np.int64)


def _crowded(faces: Ints, n: int) -> Ints:
    """Vertices of faces that name one twice, and at edges that two faces run along in one direction."""
    a, b = directed_edges(faces)
    key, count = np.unique(a * n + b, return_counts=True)
    again = key[count > 1]
    rows = np.sort(np.where(faces < 0, -1 - np.arange(4), faces), axis=1)
    collapsed = rows[(rows[:, 1:] == rows[:, :-1]).any(axis=1)]
    found = np.concatenate([again // n, again % n, collapsed[collapsed >= 0]])
    return np.unique(found[found >= 0])


def _may_meet(mesh: FitMesh, border: _Border, vertex: Ints, least: Ints, most: Ints) -> Bools:
    """(p,) which vertices (p,) of borders may be joined to others of the pieces from ``least`` to ``most`` (p,): on a
    mesh without shapes only those of two pieces, for nothing else tells lips that touch from a border that was cut."""
    if len(mesh.deltas):
        return np.ones(len(vertex), bool)
    low, high = _pieces(mesh, border)
    out: Bools = np.minimum(low[vertex], least) != np.maximum(high[vertex], most)
    return out


def _pieces(mesh: FitMesh, border: _Border) -> tuple[Ints, Ints]:
    """(n,), (n,) least and greatest number of the pieces whose borders each vertex is on."""
    low = np.full(len(mesh.vertices), np.iinfo(np.int64).max)
    high = np.full(len(mesh.vertices), -1)
    for ends in (border.start, border.stop):
        np.minimum.at(low, ends, border.piece)
        np.maximum.at(high, ends, border.piece)
    return low, high


def _chains(mesh: FitMesh, border: _Border, near: float) -> Chains:
    """For every border edge the vertices of other borders that lie on it at rest and in every shape."""
    ids, out = border.vertices(), Chains()
    tree = cKDTree(mesh.vertices[ids])
    length = np.linalg.norm(mesh.vertices[border.stop] - mesh.vertices[border.start], axis=1)
    long = np.flatnonzero(length > 2.0 * near)  # others have no place that is not at one of their ends
    for first in range(0, len(long), _EDGES):
        edge, row = _around(mesh.vertices, border, long[first : first + _EDGES], tree, near)
        _add_chains(out, mesh, border, edge, ids[row], near)
    return out


def _around(at: Floats, border: _Border, rows: Ints, tree: cKDTree, near: float) -> tuple[Ints, Ints]:
    """(k,), (k,) pairs of one of the border edges ``rows`` and a point of the tree, of all that are within ``near`` of
    each other and some more: the points in balls strung along the edges."""
    start, along = at[border.start[rows]], at[border.stop[rows]] - at[border.start[rows]]
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.ceil(length / max(BALL * near, 1e-9)), 1, MOST_BALLS).astype(np.int64)
    edge = np.repeat(np.arange(len(rows)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
    found = tree.query_ball_point(start[edge] + share[:, None] * along[edge], 0.5 * (length / count)[edge] + near)
    size = [len(f) for f in found]
    point = np.fromiter(chain.from_iterable(found), np.int64, sum(size))
    key = np.unique(np.repeat(edge, size) * tree.n + point)
    return rows[key // max(tree.n, 1)], key % max(tree.n, 1)


def _add_chains(out: Chains, mesh: FitMesh, border: _Border, edge: Ints, vertex: Ints, near: float) -> None:
    """Add to ``out``, of pairs (k,) of an edge and a vertex, those where the vertex lies on the edge."""
    own = (mesh.faces[border.face[edge]] == vertex[:, None]).any(axis=1)
    edge, vertex = edge[~own], vertex[~own]
    meets = _may_meet(mesh, border, vertex, border.piece[edge], border.piece[edge])
    edge, vertex = edge[meets], vertex[meets]
    share = _share(mesh.vertices, border, edge, vertex)
    length = np.linalg.norm(mesh.vertices[border.stop[edge]] - mesh.vertices[border.start[edge]], axis=1)
    inside = (share * length > near) & ((1.0 - share) * length > near)
    for at in (mesh.vertices, *mesh.deltas):
        line = at[border.start[edge]] + share[:, None] * (at[border.stop[edge]] - at[border.start[edge]])
        inside &= np.linalg.norm(at[vertex] - line, axis=1) <= near
    for k in np.lexsort((share, edge)):
        if inside[k]:
            out.setdefault((int(border.start[edge[k]]), int(border.stop[edge[k]])), []).append(int(vertex[k]))


def _share(at: Floats, border: _Border, edge: Ints, vertex: Ints) -> Floats:
    """(k,) how far along each edge the foot of a vertex lies, 0..1 from its start."""
    start = at[border.start[edge]]
    along = at[border.stop[edge]] - start
    out: Floats = ((at[vertex] - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30)
    return out


def _matched(chains: Chains, border: _Border) -> Chains:
    """Of the vertices on each edge those beside which another border runs along it, the other way round."""
    ends = zip(border.start.tolist(), border.stop.tolist(), strict=True)
    steps = {step for edge in ends for step in _steps(edge, chains.get(edge, []))}
    out: Chains = {}
    for edge, inner in chains.items():
        line = [edge[0], *inner, edge[1]]
        kept = [w for p, w, q in zip(line, inner, line[2:], strict=False) if {(w, p), (q, w)} & steps]
        if kept:
            out[edge] = kept
    return out


def _steps(edge: tuple[int, int], inner: list[int]) -> Iterator[tuple[int, int]]:
    line = [edge[0], *inner, edge[1]]
    return pairwise(line)


def _split(mesh: FitMesh, chains: Chains) -> FitMesh:
    """The mesh with the faces at split edges cut into triangles; their texture coordinates are between the ends'."""
    a, b = directed_edges(mesh.faces)
    face = np.repeat(np.arange(len(mesh.faces)), (mesh.faces >= 0).sum(axis=1))
    wanted = {(p, q) for p, q in chains}
    cut = np.unique([f for f, p, q in zip(face.tolist(), a.tolist(), b.tolist(), strict=True) if (p, q) in wanted])
    uv = _Texture(mesh)
    rows, texture, source = [], [], []
    for f in cut.tolist():
        made = list(_cut(mesh, f, chains, uv))
        rows += [corner for corner, _ in made]
        texture += [place for _, place in made]
        source += [f] * len(made)
    whole = np.setdiff1d(np.arange(len(mesh.faces)), cut)
    keep = np.concatenate([whole, np.array(source, np.int64)])
    return replace(
        mesh, faces=np.vstack([mesh.faces[whole], _padded(rows)]),
        face_uv=np.vstack([mesh.face_uv[whole], _padded(texture)]), uv=uv.every(),
        piece=mesh.piece[keep] if len(mesh.piece) else mesh.piece,
    )  # fmt: skip


def _padded(rows: list[tuple[int, int, int]]) -> Ints:
    return np.column_stack([np.array(rows, np.int64).reshape(-1, 3), np.full(len(rows), -1)])


class _Texture:
    """Texture coordinates of a mesh, and those that are added to them."""

    def __init__(self, mesh: FitMesh) -> None:
        self._mesh, self._added = mesh, list[Floats]()

    def between(self, ends: tuple[int, int], places: tuple[int, int], vertex: int) -> int:
        """The row of a new place at a vertex on an edge between two ``places``; -1 between those of a bare face."""
        if min(places) < 0:
            return -1
        start, stop, at = self._mesh.vertices[[*ends, vertex]]
        share = float((at - start) @ (stop - start) / max((stop - start) @ (stop - start), 1e-30))
        one, two = self._mesh.uv[list(places)]
        self._added.append(one + share * (two - one))
        return len(self._mesh.uv) + len(self._added) - 1

    def every(self) -> Floats:
        """(m, 2) those of the mesh, then those added."""
        return np.vstack([self._mesh.uv, *self._added])


Corner = tuple[int, int]  # vertex and row of its texture coordinates


def _cut(
    mesh: FitMesh, face: int, chains: Chains, uv: _Texture
) -> Iterator[tuple[tuple[int, int, int], tuple[int, int, int]]]:  # fmt: skip
    """Vertices and texture coordinates of the triangles that a face becomes."""
    size = int((mesh.faces[face] >= 0).sum())
    corner = list(zip(mesh.faces[face, :size].tolist(), mesh.face_uv[face, :size].tolist(), strict=True))
    stack = [(corner[0], corner[k], corner[k + 1]) for k in range(1, size - 1)]
    while stack:
        a, b, c = stack.pop()
        for p, q, apex in ((a, b, c), (b, c, a), (c, a, b)):
            if inner := chains.get((p[0], q[0])):
                line = [p, *((w, uv.between((p[0], q[0]), (p[1], q[1]), w)) for w in inner), q]
                stack += [(one, two, apex) for one, two in pairwise(line)]
                break
        else:
            yield (a[0], b[0], c[0]), (a[1], b[1], c[1])
