"""Triangle meshes of DCP surfaces, with the list of control points that reach each cell (paper, 2.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Ints
from surface.spline.bins import Bins, build_bins


@dataclass(frozen=True)
class Mesh:
    """A tessellated surface; all arrays are read-only.

    vertices, normals : (m, 3) float64, normals of unit length along S_u x S_v (opposite if ``flip``)
    triangles : (t, 3) int32, counter-clockwise seen from where the normals point
    uv : (m, 2) float64
    side : (m,) int64, from which side a vertex on a slit evaluates the surface: bit 1 from the left in u, bit 2 in v
    cell : (m,) int32, ascending: the vertices of a cell are consecutive
    cell_start : (c + 1,) int64, first vertex of every cell
    list_start : (c + 1,) int64, where every cell's list starts in ``list_ids``
    list_ids : (k,) int32 control points that reach a vertex of the cell
    leaves : how many leaf cells the quad tree had
    flip : whether normals and triangles are reversed against S_u x S_v
    structure : :attr:`surface.spline.controlpoints.ControlPoints.structure` of the surface it was made from; empty
        where that is not known
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
    structure: bytes = b""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def points_of(self, cell: int) -> np.ndarray:
        """Return (k,) int32: control points that reach a cell."""
        return self.list_ids[self.list_start[cell] : self.list_start[cell + 1]]

    @cached_property
    def cell_boxes(self) -> tuple[Floats, Bins]:
        """(c, 4) u0, u1, v0, v1 around the vertices of every cell, and the cells by region of (u, v)."""
        low, high = (
            np.minimum.reduceat(self.uv, self.cell_start[:-1]),
            np.maximum.reduceat(self.uv, self.cell_start[:-1]),
        )
        along = [np.stack([low[:, k], high[:, k]], axis=1) for k in range(2)]
        return np.hstack(along), build_bins(*along)


def border_edges(triangles: NDArray[np.int32]) -> Ints:
    """Return (k, 2): edges that only one triangle has, in the direction of that triangle."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    key, back = edges[:, 0] << 32 | edges[:, 1], edges[:, 1] << 32 | edges[:, 0]
    ordered = np.sort(key)  # np.isin takes three times as long
    at = np.searchsorted(ordered, back)
    alone: Ints = edges[ordered[np.minimum(at, len(ordered) - 1)] != back]
    return alone
