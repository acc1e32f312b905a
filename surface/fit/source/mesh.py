"""The mesh a head is fitted to: vertices, faces, texture coordinates and expression shapes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Bools, Floats, Ints
from surface.base.errors import FitError

LARGE, SMALL = 1e7, 1e-7  # in any unit: no vertex of a head lies further out, no head is smaller


@dataclass(frozen=True)
class FitMesh:
    """A mesh in head space.

    Attributes
    ----------
    vertices : (n, 3) float64, millimetres, y up, z forward.
    faces : (f, 4) int64, -1 fills the last place of a triangle.
    uv : (t, 2) float64; face_uv : (f, 4) int64 into ``uv``, -1 as in ``faces``.
    names : k shape names; deltas : (k, n, 3) float64, millimetres.
    piece : (f,) int64 into ``pieces``, names of the objects that faces belong to; empty where there are none.
    """

    vertices: Floats
    faces: Ints
    uv: Floats
    face_uv: Ints
    names: tuple[str, ...]
    deltas: Floats
    piece: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    pieces: tuple[str, ...] = ()

    def piece_of(self, face: int) -> str:
        """Name of the object that a face belongs to."""
        return self.pieces[self.piece[face]] if self.pieces else ""

    def moved(self, warp_vertices: Floats, warp_deltas: Floats) -> FitMesh:
        """The same mesh with other vertices (n, 3) and deltas (k, n, 3)."""
        return replace(self, vertices=warp_vertices, deltas=warp_deltas)

    def with_shapes(self, names: tuple[str, ...], deltas: Floats) -> FitMesh:
        """The same mesh with other shapes, (k, n, 3)."""
        return replace(self, names=names, deltas=deltas)


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
    _check_mapped(where, mesh)
    _check_indices(where, "faces", mesh.faces, n)
    _check_indices(where, "face_uv", mesh.face_uv, len(mesh.uv))
    if ((mesh.faces < 0) != (mesh.face_uv < 0)).any():
        raise FitError(f"{where}: faces and face_uv have other corners", hint="export all arrays from one mesh")
    _check_finite(where, mesh)


def _check_mapped(where: str, mesh: FitMesh) -> None:
    bare = np.flatnonzero((mesh.face_uv[:, :3] < 0).any(axis=1)) if len(mesh.uv) else np.arange(len(mesh.faces))
    if not len(bare):
        return
    part = f" (of {mesh.piece_of(bare[0])!r})" if len(mesh.pieces) > 1 else ""
    what = "the mesh has" if len(bare) == len(mesh.faces) else f"faces[{bare[0]}]{part} has"
    raise FitError(f"{where}: {what} no texture coordinates",
                   hint="unwrap it first: omote fits in (u, v); or leave the object out: --without NAME")  # fmt: skip


def check_manifold(mesh: FitMesh, where: str) -> None:
    """Raise FitError, naming the edge, where more than two faces meet or two neighbours run opposite ways round."""
    used = mesh.faces >= 0
    following = np.roll(mesh.faces, -1, axis=1)
    following[mesh.faces[:, 3] < 0, 2] = mesh.faces[mesh.faces[:, 3] < 0, 0]
    a, b = mesh.faces[used], following[used]
    n = len(mesh.vertices)
    face = np.repeat(np.arange(len(mesh.faces)), used.sum(axis=1))
    edge = np.minimum(a, b) * n + np.maximum(a, b)
    _, first, inverse, count = np.unique(edge, return_index=True, return_inverse=True, return_counts=True)
    if count.max() > 2:
        at = first[np.argmax(count > 2)]
        why = f"belongs to {count[inverse[at]]} faces, a surface has two at most"
        raise _edge_error(mesh, where, a[at], b[at], face[at], why, "delete inner and doubled faces")
    _, first, count = np.unique(a * n + b, return_index=True, return_counts=True)
    if count.max() > 1:
        at = first[np.argmax(count > 1)]
        why = "is run through twice in one direction"
        raise _edge_error(mesh, where, a[at], b[at], face[at], why, "make all faces look outwards")


def _edge_error(mesh: FitMesh, where: str, a: int, b: int, face: int, why: str, hint: str) -> FitError:
    part = f" of {mesh.piece_of(face)!r}" if mesh.pieces else ""
    return FitError(f"{where}: not a manifold: the edge between vertices {a} and {b}{part} {why}", hint=hint)


def _check_indices(where: str, key: str, index: NDArray[np.integer], n: int) -> None:
    bad = np.argwhere((index >= n) | (index < -1) | ((index < 0) & (np.arange(4) < 3)))
    if len(bad):
        raise FitError(f"{where}: {key}[{bad[0, 0]}] points at {index[tuple(bad[0])]}, but there are {n}")


def _check_finite(where: str, mesh: FitMesh) -> None:
    for key, a in (("neutral", mesh.vertices), ("uv", mesh.uv)):
        bad = np.flatnonzero(~_usable(a))
        if len(bad):
            raise FitError(f"{where}: {key}[{bad[0]}] is not a finite number of usable size",
                           hint="repair the mesh and export again")  # fmt: skip
    for name, d in zip(mesh.names, mesh.deltas, strict=True):
        bad = np.flatnonzero(~_usable(d))
        if len(bad):
            raise FitError(f"{where}: shape {name!r}, vertex {bad[0]} is not a finite number of usable size",
                           hint="repair the shape and export again")  # fmt: skip
    if not np.ptp(mesh.vertices, axis=0).max() > SMALL:
        raise FitError(f"{where}: all vertices stand in one place", hint="export the mesh again")


def _usable(rows: Floats) -> Bools:
    """(n,) whether a row's numbers are finite, and not as large as only damage makes them."""
    return np.asarray((np.abs(rows) < LARGE).all(axis=1))


def triangles(faces: Ints) -> Ints:
    """Quads (f, 4) with -1 for triangles, cut into triangles (t, 3)."""
    quads = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]])
