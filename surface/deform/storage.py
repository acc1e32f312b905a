"""Storage of the weights of each cell: as blocks, see :mod:`.lists`, packed, or as factors.

Each cell uses the kind of storage that needs the fewest operations. Weights and knots change in blocks only, so that
the cells of a change get blocks first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.mesh.mesh import Mesh

from .factors import Factors, expand_factors, factorize
from .lists import LANES, Basis, Lists, grow
from .packing import PLAIN, Packed, order_vertices, pack, unpack_cell


class Storage(NamedTuple):
    """The weights that are not kept as blocks."""

    factors: Factors
    packed: Packed

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.factors.nbytes + self.packed.nbytes

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays of both by name."""
        return vars(self.factors) | vars(self.packed)

    def blocks(self, cells: Ints) -> Bools:
        """Return which of ``cells (k,)`` have blocks, (k,) bool."""
        held: Bools = (self.factors.rows_at[cells] < 0) & (self.packed.packed_at[cells] < 0)
        return held


def compress(basis: Basis, lists: Lists, mesh: Mesh, points: Floats) -> Storage:
    """Choose how each cell's weights are kept; ``lists`` has blocks only of the cells that keep them.

    points : (b n, 3) the control points and their shifted copies.
    """
    order = order_vertices(lists)
    factors = factorize(basis, lists, mesh, order.entries)
    made = Storage(factors, pack(lists, order, factors.rows_at < 0, points))
    _take_out(lists, made.blocks(np.arange(len(lists.rows))))
    return made


def _take_out(lists: Lists, kept: Bools) -> None:
    """Keep blocks only of the cells that are ``kept (c,)``."""
    sizes = lists.rows * np.diff(lists.tile_start) * LANES
    lists.value = lists.value[np.repeat(kept, sizes)]
    if len(lists.slope):
        lists.slope = lists.slope[np.repeat(kept, 2 * sizes)]
    sizes[~kept] = 0
    lists.room[~kept] = 0
    lists.at = np.cumsum(sizes) - sizes
    lists.used = len(lists.value)


def make_restore(lists: Lists, storage: Storage) -> Callable[[], None]:
    """Return a function that undoes the next calls of :func:`expand`, if nothing else was changed meanwhile."""
    value, slope, used = lists.value, lists.slope, lists.used
    places = [lists.at, lists.room, storage.factors.rows_at, storage.packed.packed_at, storage.packed.order_at]
    before = [array.copy() for array in places]

    def restore() -> None:
        lists.value, lists.slope, lists.used = value, slope, used
        for array, old in zip(places, before, strict=True):
            array[:] = old

    return restore


def expand(lists: Lists, storage: Storage, cells: Ints) -> None:
    """Give ``cells (k,)`` blocks, at the end of the arrays of ``lists``, before they are changed."""
    factors, packed = storage
    for c in cells[~storage.blocks(cells)]:
        blocks = expand_factors(factors, lists, c) if factors.rows_at[c] >= 0 else unpack_cell(lists, packed, c)
        end = lists.used + blocks[0].size
        lists.value = grow(lists.value, end)
        lists.value[lists.used : end] = blocks[0].ravel()
        if len(blocks) > 1:
            lists.slope = grow(lists.slope, 2 * end)
            lists.slope[2 * lists.used : 2 * end] = blocks[1].ravel()
        lists.at[c], lists.room[c], lists.used = lists.used, lists.rows[c], end
        factors.rows_at[c] = packed.packed_at[c] = packed.order_at[c] = PLAIN
