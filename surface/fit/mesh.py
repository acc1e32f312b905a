"""The mesh a head is fitted to: vertices, faces, texture coordinates and expression shapes.

The NPZ layout read here is the one of ICT-FaceKit (Light)::

    neutral (n, 3)   deltas (k, n, 3)   names (k,)   faces (f, 4), the last index of a triangle is -1
    uv (t, 2)        face_uv (f, 4), texture coordinates per face corner
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from surface.errors import FitError

KEYS = ("neutral", "deltas", "names", "faces", "uv", "face_uv")
HEAD_HEIGHT_MM = 250.0  # a head with neck; only tells metres, centimetres and millimetres apart


@dataclass(frozen=True)
class FitMesh:
    """A mesh in head space.

    Attributes
    ----------
    vertices : (n, 3) float64, millimetres, y up, z forward.
    faces : (f, 4) int64, -1 fills the last place of a triangle.
    uv : (t, 2) float64; face_uv : (f, 4) int64 into ``uv``, -1 as in ``faces``.
    names : k shape names; deltas : (k, n, 3) float64, millimetres.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64]
    face_uv: NDArray[np.int64]
    names: tuple[str, ...]
    deltas: NDArray[np.float64]

    def moved(self, warp_vertices: NDArray[np.float64], warp_deltas: NDArray[np.float64]) -> FitMesh:
        """The same mesh with other vertices (n, 3) and deltas (k, n, 3)."""
        return FitMesh(warp_vertices, self.faces, self.uv, self.face_uv, self.names, warp_deltas)


def load_mesh(path: str | Path) -> FitMesh:
    """Read and check a mesh in the NPZ layout.

    Raises
    ------
    FitError : the file is missing or damaged, lacks a key, holds NaN, or its arrays do not fit together.
    """
    path = Path(path)
    raw = _read(path)
    mesh = FitMesh(
        np.asarray(raw["neutral"], float), np.asarray(raw["faces"], np.int64),
        np.asarray(raw["uv"], float), np.asarray(raw["face_uv"], np.int64),
        tuple(str(n) for n in raw["names"]), np.asarray(raw["deltas"], float),
    )  # fmt: skip
    check_mesh(mesh, str(path))
    scale = unit_scale(mesh.vertices)
    return mesh.moved(mesh.vertices * scale, mesh.deltas * scale)


def _read(path: Path) -> dict[str, NDArray]:
    if not path.is_file():
        raise FitError(f"{path}: no such mesh file", hint="give the path of an .npz mesh with UVs and shapes")
    try:
        with path.open("rb") as f, np.load(f, allow_pickle=False) as z:
            missing = [k for k in KEYS if k not in z.files]
            if missing:
                raise FitError(
                    f"{path}: key {missing[0]!r} is missing (found: {', '.join(z.files)})",
                    hint=f"the layout needs {', '.join(KEYS)}",
                )
            return {k: z[k] for k in KEYS}
    except (OSError, ValueError, EOFError, BadZipFile) as e:
        raise FitError(f"{path}: cannot be read as .npz ({e})", hint="save the mesh again") from e


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
    if len(mesh.uv) == 0 or (mesh.face_uv[:, :3] < 0).any():
        raise FitError(f"{where}: the mesh has no texture coordinates", hint="unwrap it first: omote fits in (u, v)")
    _check_indices(where, "faces", mesh.faces, n)
    _check_indices(where, "face_uv", mesh.face_uv, len(mesh.uv))
    _check_finite(where, mesh)


def _check_indices(where: str, key: str, index: NDArray, n: int) -> None:
    bad = np.argwhere((index >= n) | (index < -1) | ((index < 0) & (np.arange(4) < 3)))
    if len(bad):
        raise FitError(f"{where}: {key}[{bad[0, 0]}] points at {index[tuple(bad[0])]}, but there are {n}")


def _check_finite(where: str, mesh: FitMesh) -> None:
    for key, a in (("neutral", mesh.vertices), ("uv", mesh.uv)):
        bad = np.flatnonzero(~np.isfinite(a).all(axis=1))
        if len(bad):
            raise FitError(f"{where}: {key}[{bad[0]}] is not a finite number", hint="repair the mesh and export again")
    for name, d in zip(mesh.names, mesh.deltas, strict=True):
        bad = np.flatnonzero(~np.isfinite(d).all(axis=1))
        if len(bad):
            raise FitError(f"{where}: shape {name!r}, vertex {bad[0]} is not a finite number",
                           hint="repair the shape and export again")  # fmt: skip


def unit_scale(vertices: NDArray[np.float64]) -> float:
    """Factor that makes millimetres of metres, centimetres or millimetres, by the height of the mesh."""
    height = float(np.ptp(vertices[:, 1]))
    candidates = np.array([1.0, 10.0, 1000.0])
    return float(candidates[np.argmin(np.abs(np.log(np.maximum(height * candidates, 1e-12) / HEAD_HEIGHT_MM)))])


def triangles(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Quads (f, 4) with -1 for triangles, cut into triangles (t, 3)."""
    quads = faces[faces[:, 3] >= 0]
    return np.concatenate([faces[:, :3], quads[:, [0, 2, 3]]])
