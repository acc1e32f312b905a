"""Triangle meshes of DCP surfaces, with the lists of control points by cell (paper, 2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.spline.bins import Bins


@dataclass(frozen=True)
class Mesh:
    """A tessellated surface; all arrays are read-only.

    Attributes
    ----------
    vertices, normals : (m, 3) float64, normals of unit length along S_u x S_v (opposite if ``flip``)
    triangles : (t, 3) int32, counter-clockwise seen from where the normals point
    uv : (m, 2) float64
    side : (m,) int64, which limit a vertex takes: 1 from the left in u, 2 in v (vertices on slits)
    cell : (m,) int32, rising: all vertices of a cell stand together
    cell_start : (c + 1,) int64, first vertex of every cell
    list_start : (c + 1,) int64, where every cell's list starts in ``list_ids``
    list_ids : (k,) int32 control points that may reach the cell's vertices
    leaves : how many leaf cells the quad tree had
    flip : are normals and triangles turned against S_u x S_v?
    """

    vertices: Floats
    normals: Floats
    triangles: np.ndarray
    uv: Floats
    side: Ints
    cell: np.ndarray
    cell_start: Ints
    list_start: Ints
    list_ids: np.ndarray
    leaves: int
    flip: bool

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def points_of(self, cell: int) -> np.ndarray:
        """(k,) int32: control points that may reach a cell."""
        return self.list_ids[self.list_start[cell] : self.list_start[cell + 1]]

    @cached_property
    def cell_boxes(self) -> tuple[Floats, Bins]:
        """(c, 4) u0, u1, v0, v1 around the vertices of every cell, and the cells by region of (u, v)."""
        from . import blocks  # compiled: loaded when first used

        return blocks.cell_boxes(self.cell_start, self.uv)
