"""Changes of weights and of knots in the lists of a mesh: only the cells that a change reaches are computed again."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.mesh.mesh import Mesh
from surface.spline.basis import blending
from surface.spline.kernels import points_in

from .lists import LANES, Basis, Lists, cells_by_point, write_rows


def change_weights(basis: Basis, lists: Lists, mesh: Mesh, which: Ints, weights: Floats) -> Ints:
    """Give points ``which (k,)`` other ``weights (k,)``; returns the rising cells that changed."""
    which, cells = basis.copies(which), [np.zeros(0, dtype=np.int64)]
    basis.weights[which] = np.tile(weights, len(basis.shifts))
    for i in which:
        reached, rows = lists.entries_of(int(i))
        write_rows(basis, lists, mesh, int(i), reached, rows)
        cells.append(reached)
    return np.unique(np.concatenate(cells))


def change_knots(basis: Basis, lists: Lists, mesh: Mesh, i: int, knots: list[Floats], degrees: list[int]) -> Ints:
    """Give point i other knots; returns the rising cells that changed.

    Raises
    ------
    ValueError
        Where a vertex would be covered by no point; nothing is changed then.
    """
    copies = [(b * basis.n + i, [knots[k] + shift[k] for k in range(2)]) for b, shift in enumerate(basis.shifts)]
    for copy, shifted in copies:
        vertex = _first_uncovered(lists, mesh, copy, shifted)
        if vertex >= 0:
            raise ValueError(f"knots_u, knots_v: point {i} would leave vertex {vertex} of the mesh uncovered")
    return np.unique(np.concatenate([_replace_knots(basis, lists, mesh, *copy, degrees) for copy in copies]))


def _first_uncovered(lists: Lists, mesh: Mesh, i: int, knots: list[Floats]) -> int:
    """The first vertex that only point i covers and that the new knots do not reach, or -1."""
    alone = np.zeros(len(mesh.uv), dtype=np.int64)
    count = _only_covering(*lists.entries_of(i), lists.cell_start, lists.rows, lists.room, lists.at, lists.value, alone)
    for vertex in alone[:count]:
        value = 1.0
        for k in range(2):
            side = "left" if int(mesh.side[vertex]) >> k & 1 else "right"
            value *= float(blending(knots[k], mesh.uv[vertex, k], side=side)[0])
        if value <= 0.0:
            return int(vertex)
    return -1


def _replace_knots(basis: Basis, lists: Lists, mesh: Mesh, i: int, knots: list[Floats], degrees: list[int]) -> Ints:
    """Write point i's knots and update its rows and lists; returns the cells that changed."""
    for k in range(2):
        basis.knots[k] = _with_row(basis.knots[k], i, knots[k])
        basis.degrees[k][i] = degrees[k]
    old, old_rows = lists.entries_of(i)
    cells = np.union1d(old, _cells_in(mesh, knots))
    rows = np.full(len(cells), -1, dtype=np.int64)
    rows[np.searchsorted(cells, old)] = old_rows
    nonzero, held = write_rows(basis, lists, mesh, i, cells, rows), rows >= 0
    for c, row in zip(cells[held & ~nonzero], rows[held & ~nonzero], strict=True):
        _drop_row(
            c, row, lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope,
            _tiles(lists, c), lists.point_start, lists.point_count, lists.point_cell, lists.point_row,
        )  # fmt: skip
    new = cells[nonzero & ~held]
    write_rows(basis, lists, mesh, i, new, np.array([_append_row(lists, i, int(c)) for c in new], dtype=np.int64))
    _compact(lists)
    return cells[held | nonzero]


def _with_row(table: Floats, i: int, row: Floats) -> Floats:
    """Knots with row i replaced; wider where the row needs it."""
    if len(row) > table.shape[1]:
        table = np.hstack([table, np.repeat(table[:, -1:], len(row) - table.shape[1], axis=1)])
    table[i] = row[-1]
    table[i, : len(row)] = row
    return np.ascontiguousarray(table)


def _cells_in(mesh: Mesh, knots: list[Floats]) -> Ints:
    """Cells whose vertices lie within the rectangle of the knots."""
    boxes, bins = mesh.cell_boxes
    box = np.array([knots[0][0], knots[0][-1], knots[1][0], knots[1][-1]])
    out, along = np.zeros(len(boxes), dtype=np.int32), [np.ascontiguousarray(boxes[:, k : k + 2]) for k in (0, 2)]
    found = points_in(box, *along, bins.grid, bins.shape, bins.start, bins.ids, out)
    return np.sort(out[:found]).astype(np.int64)


def _tiles(lists: Lists, c: int) -> int:
    return int(lists.tile_start[c + 1] - lists.tile_start[c])


def _append_row(lists: Lists, i: int, c: int) -> int:
    """Add a row for point i to cell c, whose weights are still to be written; returns its number."""
    row = int(lists.rows[c])
    if row == lists.room[c]:
        _enlarge(lists, c, row * 5 // 4 + 4)
    lists.ids[lists.ids_at[c] + row] = i
    lists.rows[c] += 1
    start, count = int(lists.point_start[i]), int(lists.point_count[i])
    if count == lists.point_room[i]:  # its list of cells is full: it moves to the end of the arrays
        room = count * 5 // 4 + 4
        lists.point_cell = _grow(lists.point_cell, lists.point_used + room)
        lists.point_row = _grow(lists.point_row, lists.point_used + room)
        for table in (lists.point_cell, lists.point_row):
            table[lists.point_used : lists.point_used + count] = table[start : start + count]
        start = lists.point_start[i] = lists.point_used
        lists.point_room[i] = room
        lists.point_used += room
    lists.point_cell[start + count], lists.point_row[start + count] = c, row
    lists.point_count[i] += 1
    return row


def _enlarge(lists: Lists, c: int, room: int) -> None:
    """Give a cell a block with more room, at the end of the arrays."""
    tiles, place, listed = _tiles(lists, c), lists.used, lists.ids_used
    lists.used, lists.ids_used = place + tiles * room * LANES, listed + room
    lists.value = _grow(lists.value, lists.used)
    if len(lists.slope):
        lists.slope = _grow(lists.slope, 2 * lists.used)
    lists.ids = _grow(lists.ids, lists.ids_used)
    _copy_block(
        c, lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope, tiles, room, place,
        listed, lists.ids, lists.value, lists.slope,
    )  # fmt: skip


def _grow(table: np.ndarray, wanted: int) -> np.ndarray:
    if wanted <= len(table):
        return table
    return np.concatenate([table, np.zeros(max(wanted, len(table) * 5 // 4) - len(table), dtype=table.dtype)])


def _compact(lists: Lists) -> None:
    """Once half of the arrays is no longer used, copy what is used to new ones."""
    tiles = np.diff(lists.tile_start)
    live = int((lists.rows * tiles).sum()) * LANES
    if lists.used <= 2 * live and lists.point_used <= 2 * int(lists.point_count.sum()) + 1024:
        return
    value = np.zeros(live, dtype=np.float32)
    slope = np.zeros(2 * live if len(lists.slope) else 0, dtype=np.float32)
    ids = np.zeros(int(lists.rows.sum()), dtype=np.int32)
    _pack(lists.rows, lists.room, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope, tiles, ids, value, slope)
    lists.value, lists.slope, lists.ids = value, slope, ids
    by_point = cells_by_point(ids, lists.rows, len(lists.point_start))
    lists.point_start, lists.point_count, lists.point_cell, lists.point_row = by_point
    lists.__post_init__()


@kernel
def _copy_row(
    value, slope, source, source_room, source_row, to_value, to_slope, target, target_room, target_row, tiles
):
    """Copy one row of a block to a row of the same or another block, tile by tile."""
    for t in range(tiles):
        a = source + (t * source_room + source_row) * 8
        b = target + (t * target_room + target_row) * 8
        for j in range(8):
            to_value[b + j] = value[a + j]
        if slope.shape[0] > 0:
            for j in range(16):
                to_slope[2 * b + j] = slope[2 * a + j]


@kernel
def _copy_block(
    c, rows, room, at, ids_at, ids, value, slope, tiles, new_room, new_at, new_ids_at, to_ids, to_value, to_slope
):
    """Move a cell's block and list to another place, in the same arrays or others, with room for ``new_room`` rows."""
    for k in range(rows[c]):
        _copy_row(value, slope, at[c], room[c], k, to_value, to_slope, new_at, new_room, k, tiles)
        to_ids[new_ids_at + k] = ids[ids_at[c] + k]
    at[c], ids_at[c], room[c] = new_at, new_ids_at, new_room


@kernel
def _pack(rows, room, at, ids_at, ids, value, slope, tiles, to_ids, to_value, to_slope):
    """Copy all blocks and lists to other arrays without gaps."""
    place, listed = 0, 0
    for c in range(rows.shape[0]):
        _copy_block(
            c, rows, room, at, ids_at, ids, value, slope, tiles[c], rows[c], place, listed, to_ids, to_value, to_slope
        )
        place += rows[c] * tiles[c] * 8
        listed += rows[c]


@kernel
def _find_entry(i, c, start, count, cell):
    """Where point i's entry for cell c is, or -1."""
    for e in range(start[i], start[i] + count[i]):
        if cell[e] == c:
            return e
    return -1


@kernel
def _drop_row(c, row, rows, room, at, ids_at, ids, value, slope, tiles, start, count, cell, entry_row):
    """Take one row out of a cell: the last row takes its place."""
    i, last = ids[ids_at[c] + row], rows[c] - 1
    if row != last:
        moved = ids[ids_at[c] + last]
        _copy_row(value, slope, at[c], room[c], last, value, slope, at[c], room[c], row, tiles)
        ids[ids_at[c] + row] = moved
        entry_row[_find_entry(moved, c, start, count, cell)] = row
    rows[c] = last
    e, end = _find_entry(i, c, start, count, cell), start[i] + count[i] - 1
    cell[e], entry_row[e] = cell[end], entry_row[end]
    count[i] -= 1


@kernel
def _only_covering(cells, places, cell_start, rows, room, at, value, out):
    """Vertices at which a point with rows ``places`` in ``cells`` is the only one; returns their number."""
    count = 0
    for q in range(cells.shape[0]):
        c = cells[q]
        for vertex in range(cell_start[c], cell_start[c + 1]):
            tile, lane = (vertex - cell_start[c]) // 8, (vertex - cell_start[c]) % 8
            first = at[c] + tile * room[c] * 8 + lane
            others = False
            for k in range(rows[c]):
                others = others or (k != places[q] and value[first + 8 * k] > 0.0)
            if not others and value[first + 8 * places[q]] > 0.0:
                out[count] = vertex
                count += 1
    return count
