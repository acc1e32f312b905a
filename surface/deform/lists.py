"""Weights of control points by cell, as dense float32 blocks that every update reads in order.

A cell has ``rows`` control points and ``tiles`` groups of eight vertices (the last one filled up with zeros). Its
block holds, tile after tile and row after row, the eight numbers b w of one point. A second array twice as long
holds, in the same order, the eight b_u w and the eight b_v w.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.progress import Progress, no_progress
from surface.mesh.mesh import Mesh
from surface.spline import weighing
from surface.spline.controlpoints import ControlPoints

LANES = 8
CHUNK_VERTICES = 100_000  # whose weights are computed between two reports of progress


@dataclass
class Lists:
    """The lists and weights of a mesh.

    cell_start : (c + 1,) int64, first vertex of every cell
    tile_start : (c + 1,) int64, first tile of every cell
    rows, room : (c,) int64, control points of every cell, and rows its block has room for
    at : (c,) int64, where every block starts in ``value``; in ``slope`` it is twice that
    ids_at : (c,) int64, where every cell's list starts in ``ids``
    ids : (k,) int32, control points of the cells
    value : (w,) float32; slope : (2 w,) float32, or empty for a mesh without normals
    point_start, point_count : (n,) int64, where every point's entries start in the next two, and how many they are
    point_cell, point_row : (k,) int32, the cells a point reaches and its row in their blocks
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
    point_start: Ints
    point_count: Ints
    point_cell: np.ndarray
    point_row: np.ndarray

    def __post_init__(self) -> None:
        self.used, self.ids_used, self.point_used = len(self.value), len(self.ids), len(self.point_cell)
        self.point_room = self.point_count.copy()

    @property
    def nbytes(self) -> int:
        """Bytes of weights and lists together."""
        return sum(value.nbytes for value in vars(self).values() if isinstance(value, np.ndarray))

    def entries_of(self, i: int) -> tuple[Ints, Ints]:
        """Return the cells that point i reaches and its row in their blocks, (k,) int64 each."""
        entries = slice(self.point_start[i], self.point_start[i] + self.point_count[i])
        return self.point_cell[entries].astype(np.int64), self.point_row[entries].astype(np.int64)


@dataclass
class Basis:
    """The current shifts (b, 2), knots in u and v (b n, w), degrees in u and v (b n,) and weights (b n,) of n points.

    Shifted copies are as in :mod:`surface.spline.closed`; rows of knots repeat their last one.
    """

    n: int
    shifts: Floats
    knots: list[Floats]
    degrees: list[Ints]
    weights: Floats

    @classmethod
    def of(cls, surface: ControlPoints) -> Self:
        """Return a copy of the arrays of ``surface``."""
        ku, kv, pu, pv, _, weights = (array.copy() for array in surface.arrays())
        return cls(surface.n, surface.shifts, [ku, kv], [pu, pv], weights)

    def copies(self, which: Ints) -> Ints:
        """Return points ``which (k,)`` and their shifted copies, (b k,), block after block."""
        return np.concatenate([which + block * self.n for block in range(len(self.shifts))])


def build_lists(surface: ControlPoints, mesh: Mesh, normals: bool, progress: Progress = no_progress) -> Lists:
    """Return weights of ``surface`` for the vertices of its ``mesh``; also derivative weights where ``normals`` are
    wanted."""
    count = np.diff(mesh.cell_start)
    tiles = (count + LANES - 1) // LANES
    most = int((np.diff(mesh.list_start) * tiles).sum()) * LANES
    value = np.zeros(most, dtype=np.float32)
    slope = np.zeros(2 * most if normals else 0, dtype=np.float32)
    ids = np.zeros(len(mesh.list_ids), dtype=np.int32)
    at, ids_at = np.zeros(len(count) + 1, dtype=np.int64), np.zeros(len(count) + 1, dtype=np.int64)
    rows = np.zeros(len(count), dtype=np.int64)
    arrays = surface.arrays()
    steps = np.linspace(0, len(count), max(1, len(mesh.uv) // CHUNK_VERTICES) + 1).astype(np.int64)
    for begin, end in pairwise(steps):
        progress("weights", float(begin) / max(len(count), 1))
        weighing.fill_blocks(
            *arrays[:4], arrays[5], mesh.uv, mesh.side, mesh.cell_start, mesh.list_start, mesh.list_ids, begin, end,
            value, slope, at, rows, ids, ids_at,
        )  # fmt: skip
    progress("weights", 1.0)
    used, ids = int(at[-1]), ids[: int(ids_at[-1])].copy()
    cell_start = mesh.cell_start.copy()  # not the read-only one: kernels are compiled for one kind of array only
    tile_start, by_point = np.concatenate([[0], np.cumsum(tiles)]), cells_by_point(ids, rows, len(arrays[4]))
    blocks = _shorten(value, used), _shorten(slope, 2 * used)
    return Lists(cell_start, tile_start, rows, rows.copy(), at[:-1].copy(), ids_at[:-1].copy(), ids, *blocks, *by_point)


def _shorten(table: np.ndarray, used: int) -> np.ndarray:
    """Return the first ``used`` numbers of a table, whose memory is released if there are more."""
    return table if used >= len(table) else table[:used].copy()


def cells_by_point(ids: np.ndarray, rows: Ints, n: int) -> tuple[Ints, Ints, np.ndarray, np.ndarray]:
    """Return ``point_start``, ``point_count``, ``point_cell`` and ``point_row`` of n points from contiguous lists of
    cells."""
    cell = np.repeat(np.arange(len(rows), dtype=np.int32), rows)
    row = np.arange(len(ids)) - np.repeat(np.cumsum(rows) - rows, rows)
    order = np.argsort(ids, kind="stable")
    count = np.bincount(ids, minlength=n).astype(np.int64)
    return np.cumsum(count) - count, count, cell[order], row[order].astype(np.int32)


def write_rows(basis: Basis, lists: Lists, mesh: Mesh, i: int, cells: Ints, rows: Ints) -> Bools:
    """Compute point i's ``rows (k,)`` in the blocks of ``cells (k,)`` again, and say which are not all zero, (k,) bool.

    Nothing is written where the row is -1.
    """
    nonzero = np.zeros(len(cells), dtype=np.bool_)
    weighing.rewrite_rows(
        *basis.knots, *basis.degrees, basis.weights, mesh.uv, mesh.side, lists.cell_start, i, cells, rows,
        lists.value, lists.slope, lists.at, lists.room, nonzero,
    )  # fmt: skip
    return nonzero


def grow(table: np.ndarray, wanted: int) -> np.ndarray:
    """Return the table with zeros after it, at least ``wanted`` long in all, with some room for more."""
    if wanted <= len(table):
        return table
    return np.concatenate([table, np.zeros(max(wanted, len(table) * 5 // 4) - len(table), dtype=table.dtype)])
