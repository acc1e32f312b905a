"""Other weights and other knots: only what a change reaches is computed, so it costs that and not the whole mesh.

Weights are written into the arrays of a table. Knots can need longer lists: of one table another is made, which takes
over the arrays of the first; that one is not to be used any more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.mesh import blocks
from surface.mesh.mesh import Mesh
from surface.spline.basis import blending

from . import blockedit
from .lists import LANES, Lists, back_lists
from .rows import entries_of, write_rows
from .table import StencilTable, sum_weights


def change_weights(table: StencilTable, which: Ints, weights: Floats) -> Ints:
    """Give points ``which (k,)`` other ``weights (k,)``; returns the rising cells to compute anew."""
    basis, lists, cells = table.basis, table.lists, [np.zeros(0, dtype=np.int64)]
    which = basis.copies(which)
    basis.weights[which] = np.tile(weights, len(basis.shifts))
    for i in which:
        reached, rows = entries_of(lists, int(i))
        write_rows(basis, lists, table.mesh, int(i), reached, rows)
        cells.append(reached)
    changed = np.unique(np.concatenate(cells))
    sum_weights(table, changed)
    return changed


def change_knots(
    table: StencilTable, i: int, knots: list[Floats], degrees: list[int]
) -> tuple[StencilTable, Ints]:  # fmt: skip
    """The table with other knots for point i, and the rising cells to compute anew.

    Raises
    ------
    ValueError
        Where a vertex would be covered by no point; the table is as before then.
    """
    basis = table.basis
    copies = [(b * basis.n + i, [knots[k] + shift[k] for k in range(2)]) for b, shift in enumerate(basis.shifts)]
    for copy, moved in copies:
        bare = _bare(table.lists, table.mesh, copy, moved)
        if bare >= 0:
            raise ValueError(f"knots_u, knots_v: point {i} would leave vertex {bare} of the mesh uncovered")
    cells = [_exchange(table, copy, moved, degrees) for copy, moved in copies]
    return replace(table), np.unique(np.concatenate(cells))


def _bare(lists: Lists, mesh: Mesh, i: int, knots: list[Floats]) -> int:
    """The first vertex that only point i covers and that the new knots do not reach, or -1."""
    own = slice(lists.back_start[i], lists.back_start[i] + lists.back_count[i])
    alone = np.zeros(len(mesh.uv), dtype=np.int64)
    count = blockedit.alone(
        lists.back_cell[own], lists.back_row[own], lists.cell_start, lists.rows, lists.room, lists.at,
        lists.value, alone,
    )  # fmt: skip
    for vertex in alone[:count]:
        value = 1.0
        for k in range(2):
            side = "left" if int(mesh.side[vertex]) >> k & 1 else "right"
            value *= float(blending(knots[k], mesh.uv[vertex, k], side=side)[0])
        if value <= 0.0:
            return int(vertex)
    return -1


def _exchange(table: StencilTable, i: int, knots: list[Floats], degrees: list[int]) -> Ints:
    """Write the knots and make lists and weights agree with them."""
    basis, lists, mesh = table.basis, table.lists, table.mesh
    old = entries_of(lists, i)[0]
    for k in range(2):
        basis.knots[k] = _write(basis.knots[k], i, knots[k])
        basis.degrees[k][i] = degrees[k]
    cells = np.union1d(old, _reached(mesh, knots))
    nonzero = write_rows(basis, lists, mesh, i, cells, np.full(len(cells), -1, dtype=np.int64))
    held = np.isin(cells, old)
    for c in cells[held & ~nonzero]:
        _drop(lists, i, int(c))
    for c in cells[nonzero & ~held]:
        _append(lists, i, int(c))
    _tidy(lists)
    now = cells[nonzero]
    write_rows(basis, lists, mesh, i, now, _places(lists, i, now))
    changed = cells[held | nonzero]
    sum_weights(table, changed)
    return changed


def _write(table: Floats, i: int, row: Floats) -> Floats:
    """Knots with row i replaced; wider where the row needs it."""
    if len(row) > table.shape[1]:
        table = np.hstack([table, np.repeat(table[:, -1:], len(row) - table.shape[1], axis=1)])
    table[i] = row[-1]
    table[i, : len(row)] = row
    return np.ascontiguousarray(table)


def _reached(mesh: Mesh, knots: list[Floats]) -> Ints:
    """Cells whose vertices lie within the rectangle of the new knots."""
    boxes, bins = mesh.cell_boxes
    box = np.array([knots[0][0], knots[0][-1], knots[1][0], knots[1][-1]])
    out = np.zeros(len(boxes), dtype=np.int32)
    found = blocks.reach(box, boxes, bins.grid, bins.shape, bins.start, bins.ids, out)
    return np.sort(out[:found]).astype(np.int64)


def _places(lists: Lists, i: int, cells: Ints) -> Ints:
    entries = [blockedit.find_entry(i, c, lists.back_start, lists.back_count, lists.back_cell) for c in cells]
    return lists.back_row[entries].astype(np.int64) if entries else np.zeros(0, dtype=np.int64)


def _tiles(lists: Lists, c: int) -> int:
    return int(lists.tile_start[c + 1] - lists.tile_start[c])


def _drop(lists: Lists, i: int, c: int) -> None:
    row = lists.back_row[blockedit.find_entry(i, c, lists.back_start, lists.back_count, lists.back_cell)]
    blockedit.drop_row(
        c, row, lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope,
        _tiles(lists, c), lists.back_start, lists.back_count, lists.back_cell, lists.back_row,
    )  # fmt: skip


def _append(lists: Lists, i: int, c: int) -> None:
    """Add a row for point i to cell c; its weights are written later."""
    if lists.rows[c] == lists.room[c]:
        _enlarge(lists, c, int(lists.rows[c]) * 5 // 4 + 4)
    row = int(lists.rows[c])
    lists.ids[lists.ids_at[c] + row] = i
    lists.rows[c] += 1
    _append_back(lists, i, c, row)


def _enlarge(lists: Lists, c: int, room: int) -> None:
    """Give a cell a block with more room, at the end of the arrays."""
    tiles = _tiles(lists, c)
    place, listed = lists.used, lists.ids_used
    lists.used, lists.ids_used = place + tiles * room * LANES, listed + room
    lists.value = _grow(lists.value, lists.used)
    if len(lists.slope):
        lists.slope = _grow(lists.slope, 2 * lists.used)
    lists.ids = _grow(lists.ids, lists.ids_used)
    blockedit.relocate(
        c, lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope, tiles, room,
        place, listed,
    )  # fmt: skip


def _append_back(lists: Lists, i: int, c: int, row: int) -> None:
    """Add an entry to point i's list of cells, which moves to the end of the arrays when it is full."""
    start, count = int(lists.back_start[i]), int(lists.back_count[i])
    if count == lists.back_room[i]:
        room = count * 5 // 4 + 4
        lists.back_cell = _grow(lists.back_cell, lists.back_used + room)
        lists.back_row = _grow(lists.back_row, lists.back_used + room)
        for table in (lists.back_cell, lists.back_row):
            table[lists.back_used : lists.back_used + count] = table[start : start + count]
        start = lists.back_start[i] = lists.back_used
        lists.back_room[i] = room
        lists.back_used += room
    lists.back_cell[start + count], lists.back_row[start + count] = c, row
    lists.back_count[i] += 1


def _grow(table: np.ndarray, wanted: int) -> np.ndarray:
    if wanted <= len(table):
        return table
    return np.concatenate([table, np.zeros(max(wanted, len(table) * 5 // 4) - len(table), dtype=table.dtype)])


def _tidy(lists: Lists) -> None:
    """Once half of the arrays is abandoned, copy what is in use to fresh ones."""
    tiles = np.diff(lists.tile_start)
    live = int((lists.rows * tiles).sum()) * LANES
    if lists.used <= 2 * live and lists.back_used <= 2 * int(lists.back_count.sum()) + 1024:
        return
    value = np.zeros(live, dtype=np.float32)
    slope = np.zeros(2 * live if len(lists.slope) else 0, dtype=np.float32)
    ids = np.zeros(int(lists.rows.sum()), dtype=np.int32)
    blockedit.pack(
        lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope, tiles, value,
        slope, ids,
    )  # fmt: skip
    lists.value, lists.slope, lists.ids = value, slope, ids
    lists.used, lists.ids_used = live, len(ids)
    back = back_lists(ids, lists.rows, len(lists.back_start))
    lists.back_start, lists.back_count, lists.back_cell, lists.back_row = back
    lists.back_room, lists.back_used = lists.back_count.copy(), len(lists.back_cell)
