"""Rows of weight blocks, from the knots and the weight of one control point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.mesh.mesh import Mesh
from surface.spline import weighing
from surface.spline.controlpoints import ControlPoints

from .lists import Lists


@dataclass
class Basis:
    """What weights are computed from: a table of control points without their positions, to be changed.

    Attributes
    ----------
    n : how many points; all arrays hold their shifted copies after them, b blocks in all
    shifts : (b, 2) float64, (0, 0) first
    knots : in u and v, (b n, w) float64 each, rows repeat their last knot
    degrees : in u and v, (b n,) int64 each
    weights : (b n,) float64
    """

    n: int
    shifts: Floats
    knots: list[Floats]
    degrees: list[Ints]
    weights: Floats

    @classmethod
    def of(cls, surface: ControlPoints) -> Self:
        """A copy of what ``surface`` has."""
        ku, kv, pu, pv, _, weights = (array.copy() for array in surface.arrays())
        return cls(surface.n, surface.shifts, [ku, kv], [pu, pv], weights)

    def copies(self, which: Ints) -> Ints:
        """Points ``which (k,)`` and their shifted copies, (b k,), block after block."""
        return np.concatenate([which + block * self.n for block in range(len(self.shifts))])


def entries_of(lists: Lists, i: int) -> tuple[Ints, Ints]:
    """The cells that point i reaches and its row in their blocks, (k,) int64 each."""
    own = slice(lists.back_start[i], lists.back_start[i] + lists.back_count[i])
    return lists.back_cell[own].astype(np.int64), lists.back_row[own].astype(np.int64)


def write_rows(basis: Basis, lists: Lists, mesh: Mesh, i: int, cells: Ints, rows: Ints) -> Bools:
    """Compute point i's ``rows (k,)`` in the blocks of ``cells (k,)`` anew, none where the row is -1.

    Returns
    -------
    (k,) bool : is any number of the row not zero?
    """
    nonzero = np.zeros(len(cells), dtype=np.bool_)
    weighing.rewrite_rows(
        *basis.knots, *basis.degrees, basis.weights, mesh.uv, mesh.side, lists.cell_start, i, cells, rows,
        lists.value, lists.slope, lists.at, lists.room, nonzero,
    )  # fmt: skip
    return nonzero
