"""What mesh readers give back, before units and axes are settled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surface.base.errors import FitError

MOST_VERTICES = 400_000
MOST_MOVES = 40_000_000  # vertices times shapes; each takes 24 bytes


@dataclass(frozen=True)
class MeshData:
    """A mesh as its file has it.

    Attributes
    ----------
    vertices : (n, 3) float64, in the file's unit and axes.
    faces : (f, 4) int64, -1 fills the last place of a triangle.
    uv : (t, 2) float64, v up; face_uv : (f, 4) int64 into ``uv``; all -1 where a face has no texture coordinates.
    names : k shape names; deltas : (k, n, 3) float64.
    piece : (f,) int64 into ``pieces``, the names of the objects or materials that faces belong to.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64]
    face_uv: NDArray[np.int64]
    names: tuple[str, ...]
    deltas: NDArray[np.float64]
    piece: NDArray[np.int64]
    pieces: tuple[str, ...]


def check_size(where: str, vertices: int, shapes: int) -> None:
    """Refuse a mesh that would not fit into memory, before anything is made for it.

    Raises
    ------
    FitError : naming the file and what is too much.
    """
    if vertices > MOST_VERTICES:
        raise FitError(f"{where}: {vertices} vertices; {MOST_VERTICES} are the most", hint="decimate the mesh first")
    if vertices * shapes > MOST_MOVES:
        raise FitError(f"{where}: {shapes} shapes of {vertices} vertices are too many",
                       hint="leave out shapes that are not ARKit's, or decimate the mesh")  # fmt: skip
