"""Split a mesh into islands in (u, v), and find the loops around them.

An island is a set of faces joined through corners that share both vertex and texture coordinate. Every island is a
separate chart: control points of one never reach another.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.mesh import FitMesh, components, corners, directed_edges, renumbered, triangles

FaceNumbers = dict[tuple[int, ...], int]  # index of each face of a mesh, by its sorted corners
WELD = 1e5  # texture coordinates that agree to this many parts of the unit square are one


@dataclass(frozen=True)
class Island:
    """One connected piece of the mesh in (u, v).

    vertex : (m,) int64, the mesh vertex of each corner point (a vertex on a cut appears twice).
    uv : (m, 2) float64.
    faces : (f, 4) int64 into the rows above, -1 as in the mesh.
    """

    vertex: Ints
    uv: Floats
    faces: Ints

    def subset(self, chosen: Bools) -> Island:
        """Some faces (f,) of the island as one of their own."""
        used, faces = renumbered(self.faces[chosen])
        return Island(self.vertex[used], self.uv[used], faces)


def find_islands(mesh: FitMesh, faces: Ints | None = None) -> list[Island]:
    """All islands of the mesh, or of the chosen face indices, largest first."""
    whole = _weld(mesh, np.arange(len(mesh.faces)) if faces is None else faces)
    label = components(*directed_edges(whole.faces), len(whole.vertex))[whole.faces[:, 0]]
    order = np.argsort(-np.bincount(label), kind="stable")
    return [whole.subset(label == i) for i in order if (label == i).any()]


def _weld(mesh: FitMesh, chosen: Ints) -> Island:
    """Chosen faces, with one point for corners that share vertex and (rounded) texture coordinate."""
    f, fu = mesh.faces[chosen], mesh.face_uv[chosen]
    used = f >= 0
    key = np.column_stack([f[used], np.round(mesh.uv[fu[used]] * WELD).astype(np.int64)])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    corner = np.full(f.shape, -1, np.int64)
    corner[used] = inverse.ravel()
    return Island(f[used][first], mesh.uv[fu[used][first]], corner)


def face_numbers(mesh: FitMesh) -> FaceNumbers:
    """The index of each face of a mesh by its corners, for :func:`faces_of`."""
    return {tuple(sorted(face)): k for k, face in enumerate(mesh.faces.tolist())}


def faces_of(island: Island, face_of: FaceNumbers) -> Ints:
    """(f,) the mesh's face of each face of an island, -1 where it has none."""
    own = np.where(island.faces >= 0, island.vertex[island.faces], -1)
    return np.array([face_of.get(tuple(sorted(face)), -1) for face in own.tolist()], np.int64)


def texture_corners(mesh: FitMesh, island: Island, faces: Ints) -> Ints:
    """(t, 3) rows of ``mesh.uv`` at the corners of an island's triangles, whose own (u, v) may be others."""
    own = np.where(island.faces >= 0, island.vertex[island.faces], -1)
    out = np.full(island.faces.shape, -1, np.int64)
    for k in range(4):
        same = mesh.faces[faces] == own[:, k, None]
        out[:, k] = np.where(own[:, k] >= 0, mesh.face_uv[faces, same.argmax(axis=1)], -1)
    return triangles(out, own)


def signed_areas(island: Island) -> Floats:
    """(f,) areas in (u, v), negative where a face runs clockwise."""
    a, b, c, d = (island.uv[i] for i in corners(island.faces))
    p, q = c - a, d - b
    return 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


def boundary_loops(island: Island) -> list[Ints]:
    """Closed loops of the island's border, as rows of ``island.uv``, longest in (u, v) first.

    The first is the outline, the others are holes. Where a border touches itself in one point the loops are
    separated at that point.
    """
    a, b = directed_edges(island.faces)
    n = len(island.uv)
    open_edge = _uncancelled(a * n + b, b * n + a)
    following: dict[int, list[int]] = {}
    for i, j in zip(a[open_edge].tolist(), b[open_edge].tolist(), strict=True):
        following.setdefault(i, []).append(j)
    loops = []
    while following:
        loops.append(np.array(_walk(following), np.int64))
    return sorted(loops, key=lambda loop: -_length(island.uv[loop]))


def _uncancelled(edges: Ints, reverse: Ints) -> Bools:
    """(m,) which edges are left where each that runs the other way cancels one.

    As many then lead to a point as from it, also where more than two faces meet at an edge. ``reverse`` has the key of
    each edge run the other way.
    """
    order = np.argsort(edges, kind="stable")
    ranked = edges[order]
    rank = np.arange(len(ranked)) - np.searchsorted(ranked, ranked)
    backward = np.sort(reverse)
    against = np.searchsorted(backward, ranked, "right") - np.searchsorted(backward, ranked)
    count = np.searchsorted(ranked, ranked, "right") - np.searchsorted(ranked, ranked)
    left = np.empty(len(edges), bool)
    left[order] = rank < count - against
    return left


def _walk(following: dict[int, list[int]]) -> list[int]:
    """Take one loop out of ``following``, which lists where edges from a point lead."""
    start = next(iter(following))
    path, place = [start], {start: 0}
    while True:
        ends = following[path[-1]]
        nxt = ends.pop()
        if not ends:
            del following[path[-1]]
        if nxt in place:
            for i, j in pairwise(path[: place[nxt] + 1]):  # put back what was walked before the loop
                following.setdefault(i, []).append(j)
            return path[place[nxt] :]
        place[nxt] = len(path)
        path.append(nxt)


def _length(polyline: Floats) -> float:
    return float(np.linalg.norm(polyline - np.roll(polyline, -1, axis=0), axis=1).sum())
