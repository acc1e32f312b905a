"""Repair what is no surface in a mesh: doubled and collapsed faces, edges of more than two faces, faces wound wrongly.

Where more than two faces meet in an edge, the two that continue each other most smoothly stay together, and the others
get vertices of their own: an inner wall, a fin or a second layer becomes a piece beside the surface. Nothing is moved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.mesh import FitMesh, corners, directed_edges, face_areas, renumbered

INSIDE_OUT = -0.2  # mean of the cosine between normals and the directions from the middle: below, a skin is inside out
OTHER_PIECE_PENALTY = (
    3.0  # added between faces of two pieces: more than any cosine, so that they join only where no other face does
)


@dataclass(frozen=True)
class _Sides:
    """Sides of faces, one row a side: the face, its first and second corner as face * 4 + place, and a key of the edge
    that is equal in both directions; ``forward`` is whether it runs from the lower vertex to the higher."""

    face: Ints
    start: Ints
    stop: Ints
    key: Ints
    forward: Bools


def repaired(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    """The mesh as a manifold whose neighbours are wound alike, and what was done, in words.

    A mesh that is one already comes back as it is.
    """
    notes: list[str] = []
    mesh = _without(mesh, ~_collapsed(mesh.faces), "{} collapsed faces dropped", notes)
    mesh = _without(mesh, ~_doubled(mesh.faces), "{} doubled faces dropped", notes)
    sides = _sides(mesh)
    if _is_wrong(sides):
        mesh = _mended(mesh, sides, notes)
    return _outwards(mesh, notes), notes


def _without(mesh: FitMesh, kept: Bools, note: str, notes: list[str]) -> FitMesh:
    """The mesh with some of its faces, and a note with the names of the pieces that lost some."""
    if kept.all():
        return mesh
    notes.append(note.format(int((~kept).sum())) + _places(mesh, np.flatnonzero(~kept)))
    used, faces = renumbered(mesh.faces[kept])
    piece = mesh.piece[kept] if len(mesh.piece) else mesh.piece
    return replace(
        mesh, vertices=mesh.vertices[used], faces=faces, face_uv=mesh.face_uv[kept], deltas=mesh.deltas[:, used],
        piece=piece,
    )  # fmt: skip


def _places(mesh: FitMesh, faces: Iterable[int]) -> str:
    names = list(dict.fromkeys(mesh.piece_of(int(f)) for f in faces)) if mesh.pieces else []
    return f" ({', '.join(names[:3])}{' and others' if len(names) > 3 else ''})" if names else ""


def _collapsed(faces: Ints) -> Bools:
    """(f,) which faces name a vertex twice."""
    rows = np.sort(np.where(faces < 0, -1 - np.arange(4), faces), axis=1)
    out: Bools = (rows[:, 1:] == rows[:, :-1]).any(axis=1)
    return out


def _doubled(faces: Ints) -> Bools:
    """(f,) which faces have the same corners as one before, in any order."""
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    out = np.ones(len(faces), bool)
    out[first] = False
    return out


def _sides(mesh: FitMesh) -> _Sides:
    a, b = directed_edges(mesh.faces)
    count = (mesh.faces >= 0).sum(axis=1)
    face = np.repeat(np.arange(len(mesh.faces)), count)
    place = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    key = np.minimum(a, b) * len(mesh.vertices) + np.maximum(a, b)
    return _Sides(face, face * 4 + place, face * 4 + (place + 1) % count[face], key, a < b)


def _is_wrong(sides: _Sides) -> bool:
    """Whether an edge has more than two faces, or two that run along it in one direction."""
    most = [np.unique(k, return_counts=True)[1].max(initial=0) for k in (sides.key, 2 * sides.key + sides.forward)]
    return bool(most[0] > 2 or most[1] > 1)


def _mended(mesh: FitMesh, sides: _Sides, notes: list[str]) -> FitMesh:
    """The mesh with its faces turned alike, and cut where they cannot stay together."""
    pairs, crowded = _pairs(mesh, sides)
    if len(crowded):
        notes.append(f"{len(crowded)} edges of more than two faces cut{_places(mesh, sides.face[crowded[:, 0]])}")
    turned, cut = _winding(mesh, sides, pairs)
    if turned.any():
        notes.append(f"{int(turned.sum())} faces turned round{_places(mesh, np.flatnonzero(turned))}")
    return _turned(_split(mesh, sides, pairs[~cut], _affected(mesh, sides)), turned)


def _pairs(mesh: FitMesh, sides: _Sides) -> tuple[Ints, Ints]:
    """(p, 2) sides that continue each other, and the first two sides (e, 2) of every edge with more than two."""
    order = np.argsort(sides.key, kind="stable")
    _, start, count = np.unique(sides.key[order], return_index=True, return_counts=True)
    plain = start[count == 2]
    found = [np.stack([order[plain], order[plain + 1]], axis=1)]
    reach = _reach(mesh, sides)
    crowded = []
    for s, c in zip(start[count > 2], count[count > 2], strict=True):
        own = order[s : s + c]
        crowded.append(own[:2])
        found.append(_smoothest(mesh, own, sides.face[own], reach[own]))
    return np.concatenate(found), np.array(crowded, np.int64).reshape(-1, 2)


def _reach(mesh: FitMesh, sides: _Sides) -> Floats:
    """(s, 3) from each side into its face, at a right angle to it, of length 1."""
    vertex = mesh.faces.ravel()
    a, b = mesh.vertices[vertex[sides.start]], mesh.vertices[vertex[sides.stop]]
    middle = np.stack([mesh.vertices[i] for i in corners(mesh.faces)]).mean(axis=0)[sides.face]
    along = (b - a) / np.maximum(np.linalg.norm(b - a, axis=1, keepdims=True), 1e-30)
    into = middle - a
    into -= (into * along).sum(axis=1, keepdims=True) * along
    out: Floats = into / np.maximum(np.linalg.norm(into, axis=1, keepdims=True), 1e-30)
    return out


def _smoothest(mesh: FitMesh, own: Ints, face: Ints, reach: Floats) -> Ints:
    """(p, 2) pairs of the sides of one edge, the two that lie most nearly in one plane first; one side may be left."""
    cost = reach @ reach.T
    if len(mesh.piece):
        cost = cost + OTHER_PIECE_PENALTY * (mesh.piece[face][:, None] != mesh.piece[face])
    cost[np.tril_indices(len(own))] = np.inf
    pairs = []
    while np.isfinite(cost).any():
        i, j = np.unravel_index(int(np.argmin(cost)), cost.shape)
        pairs.append((own[i], own[j]))
        cost[[i, j]] = cost[:, [i, j]] = np.inf
    return np.array(pairs, np.int64).reshape(-1, 2)


def _winding(mesh: FitMesh, sides: _Sides, pairs: Ints) -> tuple[Bools, Bools]:
    """(f,) faces to turn round, fewer than half the area of each patch; (p,) pairs where that cannot be done."""
    a, b = sides.face[pairs[:, 0]], sides.face[pairs[:, 1]]
    against = sides.forward[pairs[:, 0]] == sides.forward[pairs[:, 1]]
    count = len(mesh.faces)
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count)).tocsr()
    patch = connected_components(graph, directed=False)[1]
    turned = np.zeros(count, bool)
    wrong = np.unique(patch[a[against]])
    both = np.concatenate([np.stack([a, b, against], axis=1), np.stack([b, a, against], axis=1)]).astype(np.int64)
    link = {(int(i), int(j)): bool(k) for i, j, k in both[np.isin(patch[both[:, 0]], wrong)]}
    for own in wrong:
        first = int(np.flatnonzero(patch == own)[0])
        order, before = breadth_first_order(graph, first, directed=False)
        for face in order[1:]:
            turned[face] = turned[before[face]] != link[int(before[face]), int(face)]
    areas = face_areas(mesh.vertices, mesh.faces)
    share = np.bincount(patch, areas * turned) / np.maximum(np.bincount(patch, areas), 1e-30)
    turned ^= (share > 0.5)[patch]
    cut: Bools = against != (turned[a] != turned[b])
    return turned, cut


def _affected(mesh: FitMesh, sides: _Sides) -> Bools:
    """(f,) faces of patches with an edge of more than two faces, or with neighbours wound differently."""
    count = len(mesh.faces)
    _, at, every = np.unique(sides.key, return_inverse=True, return_counts=True)
    _, way, same = np.unique(2 * sides.key + sides.forward, return_inverse=True, return_counts=True)
    wrong = (every[at.ravel()] > 2) | (same[way.ravel()] > 1)
    ties = coo_matrix((np.ones(len(at)), (sides.face, count + at.ravel())), shape=(count + len(every),) * 2)
    patch = connected_components(ties, directed=False)[1][:count]
    out: Bools = np.isin(patch, patch[sides.face[wrong]])
    return out


def _split(mesh: FitMesh, sides: _Sides, pairs: Ints, affected: Bools) -> FitMesh:
    """The mesh with one vertex for corners that hang together by pairs of sides; whole patches keep their vertices."""
    n = 4 * len(mesh.faces)
    p, q = pairs.T
    alike = sides.forward[p] == sides.forward[q]
    to_start, to_stop = (
        np.where(alike, x, y) for x, y in ((sides.start[q], sides.stop[q]), (sides.stop[q], sides.start[q]))
    )
    used = np.flatnonzero(mesh.faces.ravel() >= 0)
    unaffected = used[~affected[used // 4]]
    a = np.concatenate([sides.start[p], sides.stop[p], unaffected])
    b = np.concatenate([to_start, to_stop, n + mesh.faces.ravel()[unaffected]])
    size = n + len(mesh.vertices)
    label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(size, size)), directed=False)[1][used]
    # numbered by the vertices that they were, so that a mesh keeps its order
    vertex = mesh.faces.ravel()[used]
    known, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(vertex[first], kind="stable")
    rank = np.empty(len(known), np.int64)
    rank[order] = np.arange(len(known))
    faces = np.full(n, -1, np.int64)
    faces[used] = rank[inverse.ravel()]
    old = vertex[first][order]
    return replace(mesh, vertices=mesh.vertices[old], deltas=mesh.deltas[:, old], faces=faces.reshape(-1, 4))


def _turned(mesh: FitMesh, turned: Bools) -> FitMesh:
    """The mesh with some faces (f,) run through the other way round."""
    faces, face_uv = mesh.faces.copy(), mesh.face_uv.copy()
    for rows in (faces, face_uv):
        own = rows[turned]
        quad = own[:, 3] >= 0
        rows[turned] = np.where(quad[:, None], own[:, ::-1], own[:, [2, 1, 0, 3]])
    return replace(mesh, faces=faces, face_uv=face_uv)


def _outwards(mesh: FitMesh, notes: list[str]) -> FitMesh:
    """The mesh with every closed patch, and the largest of all, turned so that it looks outwards."""
    sides = _sides(mesh)
    _, at, every = np.unique(sides.key, return_inverse=True, return_counts=True)
    count = len(mesh.faces)
    ties = coo_matrix((np.ones(len(at)), (sides.face, count + at.ravel())), shape=(count + len(every),) * 2)
    patch = np.unique(connected_components(ties, directed=False)[1][:count], return_inverse=True)[1].ravel()
    most = int(patch.max(initial=0)) + 1
    a, b, c, d = (mesh.vertices[i] for i in corners(mesh.faces))
    normal, middle = 0.5 * np.cross(c - a, d - b), 0.25 * (a + b + c + d)
    area = np.linalg.norm(normal, axis=1)
    total = np.maximum(np.bincount(patch, area, most), 1e-30)
    centre = np.stack([np.bincount(patch, area * middle[:, k], most) / total for k in range(3)], axis=1)
    arm = middle - centre[patch]
    flux = np.bincount(patch, (normal * arm).sum(axis=1), most)
    size = np.bincount(patch, area * np.linalg.norm(arm, axis=1), most)
    closed = np.bincount(patch[sides.face[every[at.ravel()] == 1]], minlength=most) == 0
    largest = np.arange(most) == np.argmax(total)
    wrong = (closed | largest) & (flux < INSIDE_OUT * np.maximum(size, 1e-30))
    if not wrong.any():
        return mesh
    turned = wrong[patch]
    notes.append(
        f"{int(turned.sum())} faces looked inwards and were turned round{_places(mesh, np.flatnonzero(turned))}"
    )
    return _turned(mesh, turned)
