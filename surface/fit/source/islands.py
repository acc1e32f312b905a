"""Islands of a mesh in (u, v), and the loops around them.

An island is a set of faces joined through corners that share both vertex and texture coordinate. Every
island is a chart of its own: control points of one never reach another.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import FitMesh

WELD = 1e5  # texture coordinates that agree to this many parts of the unit square are one


@dataclass(frozen=True)
class Island:
    """One connected piece of the mesh in (u, v).

    Attributes
    ----------
    vertex : (m,) int64, the mesh vertex of each corner point (a vertex on a cut appears twice).
    uv : (m, 2) float64.
    faces : (f, 4) int64 into the rows above, -1 as in the mesh.
    """

    vertex: Ints
    uv: Floats
    faces: Ints


def find_islands(mesh: FitMesh, faces: Ints | None = None) -> list[Island]:
    """All islands of the mesh, or of the chosen face indices, largest first."""
    from scipy.sparse import coo_matrix  # takes a moment to import
    from scipy.sparse.csgraph import connected_components

    chosen = np.arange(len(mesh.faces)) if faces is None else faces
    corner, vertex, uv = _weld(mesh, chosen)
    a, b = directed_edges(corner)
    n = len(vertex)
    _, label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)
    of_face = label[corner[:, 0]]
    order = np.argsort(-np.bincount(of_face), kind="stable")
    return [_island(corner[of_face == i], vertex, uv) for i in order if (of_face == i).any()]


def _weld(mesh: FitMesh, chosen: Ints) -> tuple[Ints, Ints, Floats]:
    """Corner points that share vertex and (rounded) texture coordinate become one."""
    f, fu = mesh.faces[chosen], mesh.face_uv[chosen]
    used = f >= 0
    key = np.column_stack([f[used], np.round(mesh.uv[fu[used]] * WELD).astype(np.int64)])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    corner = np.full(f.shape, -1, np.int64)
    corner[used] = inverse.ravel()
    return corner, f[used][first], mesh.uv[fu[used][first]]


def directed_edges(faces: Ints) -> tuple[Ints, Ints]:
    """Directed edges of quads and triangles."""
    nxt = np.roll(faces, -1, axis=1)
    nxt[faces[:, 3] < 0, 2] = faces[faces[:, 3] < 0, 0]
    used = faces >= 0
    return faces[used], nxt[used]


def _island(faces: Ints, vertex: Ints, uv: Floats) -> Island:
    used, inverse = np.unique(faces, return_inverse=True)
    local = inverse.reshape(faces.shape) - (used[0] < 0)
    used = used[used >= 0]
    return Island(vertex[used], uv[used], local)


def boundary_loops(island: Island) -> list[Ints]:
    """Closed loops of the island's border, as rows of ``island.uv``, longest in (u, v) first.

    The first is the outline, the others are holes. Where a border touches itself in one point the loops are
    separated at that point.
    """
    a, b = directed_edges(island.faces)
    n = len(island.uv)
    open_edge = ~np.isin(a * n + b, b * n + a)
    following: dict[int, list[int]] = {}
    for i, j in zip(a[open_edge].tolist(), b[open_edge].tolist(), strict=True):
        following.setdefault(i, []).append(j)
    loops = []
    while following:
        loops.append(np.array(_walk(following), np.int64))
    return sorted(loops, key=lambda loop: -_length(island.uv[loop]))


def _walk(following: dict[int, list[int]]) -> list[int]:
    start = next(iter(following))
    path, place = [start], {start: 0}
    while True:
        ends = following[path[-1]]
        nxt = ends.pop()
        if not ends:
            del following[path[-1]]
        if nxt in place:
            return _close(path, place[nxt], following)
        place[nxt] = len(path)
        path.append(nxt)


def _close(path: list[int], begin: int, following: dict[int, list[int]]) -> list[int]:
    """Put back what was walked before the loop closed on itself."""
    for i, j in pairwise(path[: begin + 1]):
        following.setdefault(i, []).append(j)
    return path[begin:]


def _length(polyline: Floats) -> float:
    return float(np.linalg.norm(polyline - np.roll(polyline, -1, axis=0), axis=1).sum())
