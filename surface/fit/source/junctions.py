"""Join the borders of pieces of a mesh that lie on each other but share no edges.

Two pieces that were tessellated separately, as the parts of an exported head are, touch along a line on which each has
vertices of its own (T-junctions). Border vertices within :data:`NEAR_MM` of each other are merged, and edges are split
where a vertex of another border lies on them, so that both sides have the same edges. Borders are joined only where
every blend shape moves both sides alike: lips that touch at rest stay separate.
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

NEAR_MM = 0.15  # on a head of average size: greatest distance at rest, and greatest difference of what shapes move
JOINED_MATERIALS = ("skin", "mouth", "tongue")  # hair, lashes and teeth rest on the skin and are not joined to it
SEARCH_SPACING = 20.0  # of the balls along an edge in which vertices are sought, in units of the tolerance
MAX_BALLS = 128  # along one edge
NEIGHBOURS = 33  # nearest points that each is compared with, itself included: a mesh may have thousands in one place
_EDGES_PER_BATCH = 4096

SplitVertices = dict[tuple[int, int], list[int]]  # directed border edge -> the vertices on it, in order


@dataclass(frozen=True)
class _Border:
    """Border edges of a mesh: start and stop (e,), the face (e,) and the piece (e,) that each belongs to."""

    start: Ints
    stop: Ints
    face: Ints
    piece: Ints

    def vertices(self) -> Ints:
        """All vertices on borders, sorted."""
        return np.unique(np.concatenate([self.start, self.stop]))


def joined_borders(mesh: FitMesh, scale: float = 1.0) -> tuple[FitMesh, list[str]]:
    """Return the mesh with shared edges where borders lie on each other, and lines for the report.

    scale : size of the head relative to an average one, by which tolerances are multiplied. A mesh without such borders
    is returned unchanged.
    """
    mesh, welded = _welded(mesh, NEAR_MM * scale)
    border = _border(mesh)
    inserted = _with_opposite_edges(_vertices_on_edges(mesh, border, NEAR_MM * scale), border)
    if inserted:
        mesh = _split(mesh, inserted)
    count = sum(map(len, inserted.values()))
    if not (welded or count):
        return mesh, []
    return mesh, [f"borders of pieces that touch were joined: {welded} vertices welded, {count} put into edges"]


def _border(mesh: FitMesh) -> _Border:
    """Border edges of the joined materials of a mesh."""
    a, b = directed_edges(mesh.faces)
    face = np.repeat(np.arange(len(mesh.faces)), (mesh.faces >= 0).sum(axis=1))
    n = len(mesh.vertices)
    alone = ~np.isin(a * n + b, b * n + a)
    piece = mesh.piece if len(mesh.piece) else np.zeros(len(mesh.faces), np.int64)
    joined = np.array([material_of(name) in JOINED_MATERIALS for name in mesh.pieces] or [True])
    rows = np.flatnonzero(alone & joined[piece[face]])
    return _Border(a[rows], b[rows], face[rows], piece[face[rows]])


def _welded(mesh: FitMesh, near: float) -> tuple[FitMesh, int]:
    """Merge border vertices that are within ``near`` mm of each other, at rest and in what every shape moves; chains of
    such pairs become one vertex. Returns the mesh and the number of vertices removed."""
    border = _border(mesh)
    ids = border.vertices()
    pairs = ids[_near_pairs(mesh.vertices[ids], near)]
    low, high = _pieces(mesh, border)
    pairs = pairs[_may_join(mesh, border, pairs[:, 0], low[pairs[:, 1]], high[pairs[:, 1]])]
    for moves in mesh.deltas:
        pairs = pairs[np.linalg.norm(moves[pairs[:, 0]] - moves[pairs[:, 1]], axis=1) <= near]
    n = len(mesh.vertices)
    while len(pairs):
        label = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]
        first = np.unique(label, return_index=True)[1]
        faces = np.where(mesh.faces >= 0, first[label][mesh.faces], -1)
        conflicting = np.isin(first[label][pairs[:, 0]], _conflicting(faces, n))
        if not conflicting.any():
            used, faces = renumbered(faces)
            return replace(mesh, vertices=mesh.vertices[used], deltas=mesh.deltas[:, used], faces=faces), n - len(first)
        pairs = pairs[~conflicting]
    return mesh, 0


def _near_pairs(at: Floats, near: float) -> Ints:
    """(k, 2) pairs of points (m, 3) within ``near`` of each other; of many in one place only some of the pairs."""
    distance, other = cKDTree(at).query(
        at, k=np.arange(1, NEIGHBOURS + 1), distance_upper_bound=np.nextafter(near, np.inf)
    )
    one = np.broadcast_to(np.arange(len(at))[:, None], other.shape)
    close = np.isfinite(distance) & (one != other)
    pairs: Ints = np.unique(np.sort(np.column_stack([one[close], other[close]]), axis=1), axis=0)
    return pairs.astype(np.int64)


def _conflicting(faces: Ints, n: int) -> Ints:
    """Vertices of degenerate faces, and of edges that two faces use in the same direction (non-manifold)."""
    a, b = directed_edges(faces)
    key, count = np.unique(a * n + b, return_counts=True)
    again = key[count > 1]
    rows = np.sort(np.where(faces < 0, -1 - np.arange(4), faces), axis=1)
    collapsed = rows[(rows[:, 1:] == rows[:, :-1]).any(axis=1)]
    found = np.concatenate([again // n, again % n, collapsed[collapsed >= 0]])
    return np.unique(found[found >= 0])


def _may_join(mesh: FitMesh, border: _Border, vertex: Ints, min_piece: Ints, max_piece: Ints) -> Bools:
    """(p,) which border vertices (p,) may be joined to a vertex of the pieces ``min_piece`` to ``max_piece`` (p,).

    On a mesh without blend shapes only vertices of different pieces may be joined: touching lips and a border that was
    cut cannot be told apart there.
    """
    if len(mesh.deltas):
        return np.ones(len(vertex), bool)
    low, high = _pieces(mesh, border)
    out: Bools = np.minimum(low[vertex], min_piece) != np.maximum(high[vertex], max_piece)
    return out


def _pieces(mesh: FitMesh, border: _Border) -> tuple[Ints, Ints]:
    """(n,), (n,) lowest and highest index of the pieces whose borders each vertex is on."""
    low = np.full(len(mesh.vertices), np.iinfo(np.int64).max)
    high = np.full(len(mesh.vertices), -1)
    for ends in (border.start, border.stop):
        np.minimum.at(low, ends, border.piece)
        np.maximum.at(high, ends, border.piece)
    return low, high


def _vertices_on_edges(mesh: FitMesh, border: _Border, near: float) -> SplitVertices:
    """For every border edge the vertices of other faces that lie on it, at rest and in what every shape moves."""
    ids, out = border.vertices(), SplitVertices()
    tree = cKDTree(mesh.vertices[ids])
    length = np.linalg.norm(mesh.vertices[border.stop] - mesh.vertices[border.start], axis=1)
    long = np.flatnonzero(length > 2.0 * near)  # every place on a shorter edge is within the tolerance of an end
    for first in range(0, len(long), _EDGES_PER_BATCH):
        edge, row = _candidate_pairs(mesh.vertices, border, long[first : first + _EDGES_PER_BATCH], tree, near)
        _add_vertices_on_edges(out, mesh, border, edge, ids[row], near)
    return out


def _candidate_pairs(at: Floats, border: _Border, rows: Ints, tree: cKDTree, near: float) -> tuple[Ints, Ints]:
    """(k,), (k,) pairs of one of the border edges ``rows`` and a point of the tree: all that are within ``near`` of
    each other, and more. Each edge is covered by overlapping search balls."""
    start, along = at[border.start[rows]], at[border.stop[rows]] - at[border.start[rows]]
    length = np.linalg.norm(along, axis=1)
    count = np.clip(np.ceil(length / max(SEARCH_SPACING * near, 1e-9)), 1, MAX_BALLS).astype(np.int64)
    edge = np.repeat(np.arange(len(rows)), count)
    fraction = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
    found = tree.query_ball_point(start[edge] + fraction[:, None] * along[edge], 0.5 * (length / count)[edge] + near)
    size = [len(f) for f in found]
    point = np.fromiter(chain.from_iterable(found), np.int64, sum(size))
    key = np.unique(np.repeat(edge, size) * tree.n + point)
    return rows[key // max(tree.n, 1)], key % max(tree.n, 1)


def _add_vertices_on_edges(
    out: SplitVertices, mesh: FitMesh, border: _Border, edge: Ints, vertex: Ints, near: float
) -> None:
    """Add to ``out`` those of the candidate pairs ``edge (k,)``, ``vertex (k,)`` whose vertex lies on the edge."""
    on_same_face = (mesh.faces[border.face[edge]] == vertex[:, None]).any(axis=1)
    edge, vertex = edge[~on_same_face], vertex[~on_same_face]
    allowed = _may_join(mesh, border, vertex, border.piece[edge], border.piece[edge])
    edge, vertex = edge[allowed], vertex[allowed]
    along = _edge_parameters(mesh.vertices, border, edge, vertex)
    length = np.linalg.norm(mesh.vertices[border.stop[edge]] - mesh.vertices[border.start[edge]], axis=1)
    inside = (along * length > near) & ((1.0 - along) * length > near)
    for at in (mesh.vertices, *mesh.deltas):
        line = at[border.start[edge]] + along[:, None] * (at[border.stop[edge]] - at[border.start[edge]])
        inside &= np.linalg.norm(at[vertex] - line, axis=1) <= near
    for k in np.lexsort((along, edge)):
        if inside[k]:
            out.setdefault((int(border.start[edge[k]]), int(border.stop[edge[k]])), []).append(int(vertex[k]))


def _edge_parameters(at: Floats, border: _Border, edge: Ints, vertex: Ints) -> Floats:
    """(k,) where on each edge the projection of a vertex lies: 0 at its start, 1 at its end."""
    start = at[border.start[edge]]
    along = at[border.stop[edge]] - start
    out: Floats = ((at[vertex] - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30)
    return out


def _with_opposite_edges(found: SplitVertices, border: _Border) -> SplitVertices:
    """Keep the vertices on each edge that end a part of it which another border has in the opposite direction."""
    ends = zip(border.start.tolist(), border.stop.tolist(), strict=True)
    parts = {part for edge in ends for part in _parts_of_edge(edge, found.get(edge, []))}
    out: SplitVertices = {}
    for edge, inner in found.items():
        line = [edge[0], *inner, edge[1]]
        kept = [w for p, w, q in zip(line, inner, line[2:], strict=False) if {(w, p), (q, w)} & parts]
        if kept:
            out[edge] = kept
    return out


def _parts_of_edge(edge: tuple[int, int], inner: list[int]) -> Iterator[tuple[int, int]]:
    """Directed edges into which the vertices ``inner`` split an edge, in order."""
    line = [edge[0], *inner, edge[1]]
    return pairwise(line)


def _split(mesh: FitMesh, inserted: SplitVertices) -> FitMesh:
    """The mesh with the faces at split edges cut into triangles; texture coordinates are interpolated linearly."""
    a, b = directed_edges(mesh.faces)
    face = np.repeat(np.arange(len(mesh.faces)), (mesh.faces >= 0).sum(axis=1))
    wanted = {(p, q) for p, q in inserted}
    cut = np.unique([f for f, p, q in zip(face.tolist(), a.tolist(), b.tolist(), strict=True) if (p, q) in wanted])
    uv = _Texture(mesh)
    rows, texture, source = [], [], []
    for f in cut.tolist():
        made = list(_cut(mesh, f, inserted, uv))
        rows += [corner for corner, _ in made]
        texture += [place for _, place in made]
        source += [f] * len(made)
    whole = np.setdiff1d(np.arange(len(mesh.faces)), cut)
    keep = np.concatenate([whole, np.array(source, np.int64)])
    return replace(
        mesh, faces=np.vstack([mesh.faces[whole], _padded(rows)]),
        face_uv=np.vstack([mesh.face_uv[whole], _padded(texture)]), uv=uv.all_coordinates(),
        piece=mesh.piece[keep] if len(mesh.piece) else mesh.piece,
    )  # fmt: skip


def _padded(rows: list[tuple[int, int, int]]) -> Ints:
    return np.column_stack([np.array(rows, np.int64).reshape(-1, 3), np.full(len(rows), -1)])


class _Texture:
    """Texture coordinates of a mesh, to which interpolated ones are added."""

    def __init__(self, mesh: FitMesh) -> None:
        self._mesh, self._added = mesh, list[Floats]()

    def interpolate(self, ends: tuple[int, int], rows: tuple[int, int], vertex: int) -> int:
        """Add the coordinates at a vertex on the edge between two vertices ``ends`` with the coordinates ``rows``;
        returns their row, or -1 for a face without texture coordinates."""
        if min(rows) < 0:
            return -1
        start, stop, at = self._mesh.vertices[[*ends, vertex]]
        share = float((at - start) @ (stop - start) / max((stop - start) @ (stop - start), 1e-30))
        one, two = self._mesh.uv[list(rows)]
        self._added.append(one + share * (two - one))
        return len(self._mesh.uv) + len(self._added) - 1

    def all_coordinates(self) -> Floats:
        """(m, 2): the coordinates of the mesh, then the added ones."""
        return np.vstack([self._mesh.uv, *self._added])


Corner = tuple[int, int]  # vertex and row of its texture coordinates


def _cut(
    mesh: FitMesh, face: int, inserted: SplitVertices, uv: _Texture
) -> Iterator[tuple[tuple[int, int, int], tuple[int, int, int]]]:  # fmt: skip
    """Vertices and texture coordinates of the triangles that a face becomes."""
    size = int((mesh.faces[face] >= 0).sum())
    corner = list(zip(mesh.faces[face, :size].tolist(), mesh.face_uv[face, :size].tolist(), strict=True))
    stack = [(corner[0], corner[k], corner[k + 1]) for k in range(1, size - 1)]
    while stack:
        a, b, c = stack.pop()
        for p, q, apex in ((a, b, c), (b, c, a), (c, a, b)):
            if inner := inserted.get((p[0], q[0])):
                line = [p, *((w, uv.interpolate((p[0], q[0]), (p[1], q[1]), w)) for w in inner), q]
                stack += [(one, two, apex) for one, two in pairwise(line)]
                break
        else:
            yield (a[0], b[0], c[0]), (a[1], b[1], c[1])
