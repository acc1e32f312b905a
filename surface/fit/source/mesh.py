"""The mesh a head is fitted to: its arrays, checks of them, and operations on its faces."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError
from surface.readers.meshdata import Material

LARGE, SMALL = 1e7, 1e-7  # in any unit: no vertex of a head lies further out, no head is smaller


@dataclass(frozen=True)
class FitMesh:
    """A mesh in head space.

    vertices : (n, 3) float64, millimetres, y up, z forward.
    faces : (f, 4) int64, -1 fills the last place of a triangle.
    uv : (t, 2) float64; face_uv : (f, 4) int64 into ``uv``, -1 as in ``faces``; all -1 in a face without any.
    names : k shape names; deltas : (k, n, 3) float64, millimetres.
    piece : (f,) int64 into ``pieces``, names of the objects that faces belong to; empty where there are none.
    materials : what the file says of the colours of each of ``pieces``; empty where it says nothing of any.
    """

    vertices: Floats
    faces: Ints
    uv: Floats
    face_uv: Ints
    names: tuple[str, ...]
    deltas: Floats
    piece: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    pieces: tuple[str, ...] = ()
    materials: tuple[Material | None, ...] = ()

    def piece_of(self, face: int) -> str:
        """Name of the object that a face belongs to."""
        return self.pieces[self.piece[face]] if self.pieces else ""

    def material_of(self, face: int) -> Material | None:
        """What the file says of the colour of a face; None where it says nothing."""
        return self.materials[self.piece[face]] if self.materials else None


def check_mesh(mesh: FitMesh, where: str) -> None:
    """Raise FitError, naming file, array and element, for anything that cannot be fitted."""
    n, f = len(mesh.vertices), len(mesh.faces)
    shapes = {
        "neutral": (mesh.vertices.shape, (n, 3)), "faces": (mesh.faces.shape, (f, 4)),
        "uv": (mesh.uv.shape, (len(mesh.uv), 2)), "face_uv": (mesh.face_uv.shape, (f, 4)),
        "deltas": (mesh.deltas.shape, (len(mesh.names), n, 3)),
    }  # fmt: skip
    for key, (got, want) in shapes.items():
        if got != want:
            raise FitError(f"{where}: {key} has shape {got}, expected {want}", hint="export all arrays from one mesh")
    if f == 0:
        raise FitError(f"{where}: faces is empty", hint="export the mesh with its polygons")
    bare = (mesh.face_uv == -1).all(axis=1)[:, None]
    for key, index, count, free in (("faces", mesh.faces, n, False), ("face_uv", mesh.face_uv, len(mesh.uv), bare)):
        bad = np.argwhere(~free & ((index >= count) | (index < -1) | ((index < 0) & (np.arange(4) < 3))))
        if len(bad):
            raise FitError(f"{where}: {key}[{bad[0, 0]}] points at {index[tuple(bad[0])]}, but there are {count}")
    if (((mesh.faces < 0) != (mesh.face_uv < 0)) & ~bare).any():
        raise FitError(f"{where}: faces and face_uv have other corners", hint="export all arrays from one mesh")
    _check_finite(where, mesh)


def is_mapped(mesh: FitMesh) -> bool:
    """Do all faces have texture coordinates?"""
    return bool((mesh.face_uv[:, :3] >= 0).all())


def bare_where_damaged(mesh: FitMesh) -> FitMesh:
    """The mesh without the texture coordinates of faces that have some for a part of their corners only, or have
    numbers among them that only damage makes."""
    uv = np.vstack([mesh.uv, np.zeros((1, 2))])  # the last row stands for none
    fine: Bools = np.all(np.abs(uv) < LARGE, axis=1)
    known = (mesh.face_uv >= -1) & (mesh.face_uv < len(mesh.uv))  # an index that points nowhere is named later
    row_good = (fine[np.where(known, mesh.face_uv, -1)] & ((mesh.face_uv >= 0) == (mesh.faces >= 0))).all(axis=1)
    keep = row_good | ~known.all(axis=1)
    return replace(mesh, uv=np.where(fine[:-1, None], mesh.uv, 0.0), face_uv=np.where(keep[:, None], mesh.face_uv, -1))


def _check_finite(where: str, mesh: FitMesh) -> None:
    """No number may be as large as only damage makes it."""
    rows = [("neutral[{}]", mesh.vertices, "mesh"), ("uv[{}]", mesh.uv, "mesh")]
    rows += [(f"shape {name!r}, vertex {{}}", d, "shape") for name, d in zip(mesh.names, mesh.deltas, strict=True)]
    for element, array, what in rows:
        bad = np.flatnonzero(~(np.abs(array) < LARGE).all(axis=1))
        if len(bad):
            raise FitError(f"{where}: {element.format(bad[0])} is not a finite number of usable size",
                           hint=f"repair the {what} and export again")  # fmt: skip
    if not np.ptp(mesh.vertices, axis=0).max() > SMALL:
        raise FitError(f"{where}: all vertices are in one place", hint="export the mesh again")


def check_manifold(mesh: FitMesh, where: str) -> None:
    """Raise FitError, naming the edge, where more than two faces meet or two neighbours run opposite ways round."""
    if not len(mesh.faces):
        raise FitError(f"{where}: all faces are without area", hint="export the mesh again")
    a, b = directed_edges(mesh.faces)
    n = len(mesh.vertices)
    edge = np.minimum(a, b) * n + np.maximum(a, b)
    for keys, most, why, hint in (
        (edge, 2, "belongs to {} faces, a surface has two at most", "delete inner and doubled faces"),
        (a * n + b, 1, "is run through twice in one direction", "make all faces look outwards"),
    ):
        _, first, count = np.unique(keys, return_index=True, return_counts=True)
        if count.max() > most:
            bad = np.argmax(count > most)
            at = first[bad]
            face = np.repeat(np.arange(len(mesh.faces)), (mesh.faces >= 0).sum(axis=1))[at]
            part = f" of {mesh.piece_of(face)!r}" if mesh.pieces else ""
            edge_name = f"the edge between vertices {a[at]} and {b[at]}{part}"
            raise FitError(f"{where}: not a manifold: {edge_name} {why.format(count[bad])}", hint=hint)


def triangles(faces: Ints, like: Ints | None = None) -> Ints:
    """Quads (f, 4) with -1 for triangles, cut into triangles (t, 3).

    like : (f, 4) faces that say which are quads, where ``faces`` are texture coordinates, all -1 in a face without any.
    """
    quads = faces[(faces if like is None else like)[:, 3] >= 0]
    return np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]])


def face_of_triangles(faces: Ints) -> Ints:
    """(t,) the row in ``faces`` (f, 4) of each of their :func:`triangles`."""
    rows = np.arange(len(faces))
    return np.concatenate([rows, rows[faces[:, 3] >= 0]])


def corners(faces: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """The four corners (f,) of all faces; a triangle's last is its third."""
    last = np.where(faces[:, 3] < 0, faces[:, 2], faces[:, 3])
    return faces[:, 0], faces[:, 1], faces[:, 2], last


def face_areas(points: Floats, faces: Ints) -> Floats:
    """(f,) areas of faces over points (n, 3), by their diagonals."""
    a, b, c, d = (points[i] for i in corners(faces))
    areas: Floats = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    return areas


def directed_edges(faces: Ints) -> tuple[Ints, Ints]:
    """Directed edges of quads and triangles, face by face."""
    following = np.roll(faces, -1, axis=1)
    following[faces[:, 3] < 0, 2] = faces[faces[:, 3] < 0, 0]
    used = faces >= 0
    return faces[used], following[used]


def renumbered(faces: Ints) -> tuple[Ints, Ints]:
    """The vertices that faces use, rising, and the faces as indices into these; -1 stays."""
    used, inverse = np.unique(faces, return_inverse=True)
    return used[used >= 0], inverse.reshape(faces.shape) - int((used < 0).any())


def components(a: NDArray[np.integer], b: NDArray[np.integer], n: int) -> Ints:
    """(n,) the number of the connected component of each of n nodes with edges from ``a (e,)`` to ``b (e,)``."""
    label: Ints = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)[1]
    return label


def intersect(tri: Floats, origins: Floats, rays: Floats) -> tuple[Floats, Floats, Floats]:
    """Distance (r, t) along each ray to each triangle, NaN where it misses, and the shares (r, t) of the triangle's
    second and third corner there (Moeller and Trumbore, 1997).

    tri : (t, 3, 3); origins : (r, 3), or (3,) of all rays; rays : (r, 3) directions.
    """
    e1, e2, s = tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0], origins[..., None, :] - tri[:, 0]
    p, q = np.cross(rays[:, None], e2), np.cross(s, e1)
    det = (p * e1).sum(axis=-1)
    inverse = 1.0 / np.where(np.abs(det) < 1e-12, np.inf, det)
    a = (p * s).sum(axis=-1) * inverse
    b = (q @ rays[:, :, None])[..., 0] * inverse
    t = (q * e2).sum(axis=-1) * inverse
    hit = (a > -1e-6) & (b > -1e-6) & (a + b < 1 + 1e-6) & (t > 1e-6)
    return np.where(hit, t, np.nan), a, b
