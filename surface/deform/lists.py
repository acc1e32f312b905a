"""Weights by cell: dense float32 blocks that every update reads in order.

A cell has ``rows`` control points and ``tiles`` groups of eight vertices (the last one filled up with zeros). Its
block holds, tile after tile and row after row, the eight numbers b w of one point. A second array twice as long
holds, in the same order, the eight b_u w and the eight b_v w. So applying a cell reads memory front to back.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from surface.base.arrays import Ints
from surface.base.progress import Progress, silent
from surface.mesh.mesh import Mesh
from surface.spline import weighing
from surface.spline.controlpoints import ControlPoints

LANES = 8
STEP = 100_000  # vertices whose weights are computed between two reports of progress


@dataclass
class Lists:
    """The lists and weights of a mesh.

    Attributes
    ----------
    cell_start : (c + 1,) int64, first vertex of every cell
    tile_start : (c + 1,) int64, first tile of every cell
    rows, room : (c,) int64, control points of every cell, and rows its block has room for
    at : (c,) int64, where every block starts in ``value``; in ``slope`` it is twice that
    ids_at : (c,) int64, where every cell's list starts in ``ids``
    ids : (k,) int32, control points of the cells
    value : (w,) float32; slope : (2 w,) float32, or empty for a mesh without normals
    back_start, back_count : (n,) int64, where every point's entries start in the next two, and how many they are
    back_cell, back_row : (k,) int32, the cells a point reaches and its row in their blocks
    """

    cell_start: Ints
    tile_start: Ints
    rows: Ints
    room: Ints
    at: Ints
    ids_at: Ints
    ids: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    back_start: Ints
    back_count: Ints
    back_cell: np.ndarray
    back_row: np.ndarray

    def __post_init__(self) -> None:
        self.used, self.ids_used, self.back_used = len(self.value), len(self.ids), len(self.back_cell)
        self.back_room = self.back_count.copy()

    @property
    def nbytes(self) -> int:
        """Bytes of weights and lists together."""
        return sum(value.nbytes for value in vars(self).values() if isinstance(value, np.ndarray))


def build_lists(surface: ControlPoints, mesh: Mesh, normals: bool, progress: Progress = silent) -> Lists:
    """Weights of ``surface`` for the vertices of ``mesh``, from float64 blending functions.

    Parameters
    ----------
    surface : the surface the mesh was made from
    mesh : its cells and candidate lists
    normals : also derivative weights
    progress : is called with a stage and the part that is done
    """
    count = np.diff(mesh.cell_start)
    tiles = (count + LANES - 1) // LANES
    candidates = np.diff(mesh.list_start)
    most = int((candidates * tiles).sum()) * LANES
    value = np.zeros(most, dtype=np.float32)
    slope = np.zeros(2 * most if normals else 0, dtype=np.float32)
    ids = np.zeros(len(mesh.list_ids), dtype=np.int32)
    at, ids_at = np.zeros(len(count) + 1, dtype=np.int64), np.zeros(len(count) + 1, dtype=np.int64)
    rows = np.zeros(len(count), dtype=np.int64)
    arrays = surface.arrays()
    steps = np.linspace(0, len(count), max(1, len(mesh.uv) // STEP) + 1).astype(np.int64)
    for begin, end in pairwise(steps):
        progress("weights", float(begin) / max(len(count), 1))
        weighing.fill_blocks(
            *arrays[:4], arrays[5], mesh.uv, mesh.side, mesh.cell_start, mesh.list_start, mesh.list_ids, begin, end,
            value, slope, at, rows, ids, ids_at,
        )  # fmt: skip
    progress("weights", 1.0)
    used, entries = int(at[-1]), int(ids_at[-1])
    ids = ids[:entries].copy()
    back = back_lists(ids, rows, len(arrays[4]))
    return Lists(
        mesh.cell_start.copy(),  # not the read-only one: kernels are compiled for one kind of array only
        np.concatenate([[0], np.cumsum(tiles)]),
        rows,
        rows.copy(),
        at[:-1].copy(),
        ids_at[:-1].copy(),
        ids,
        value[:used].copy(),
        slope[: 2 * used].copy(),
        *back,
    )


def back_lists(ids: np.ndarray, rows: Ints, n: int) -> tuple[Ints, Ints, np.ndarray, np.ndarray]:
    """For every point, the cells it reaches and its row there, from the lists of cells that stand one by one.

    Returns
    -------
    start, count : (n,) int64
    cell, row : (k,) int32
    """
    cell = np.repeat(np.arange(len(rows), dtype=np.int32), rows)
    row = np.arange(len(ids)) - np.repeat(np.cumsum(rows) - rows, rows)
    order = np.argsort(ids, kind="stable")
    count = np.bincount(ids, minlength=n).astype(np.int64)
    return np.cumsum(count) - count, count, cell[order], row[order].astype(np.int32)
