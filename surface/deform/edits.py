"""Changes of weights and of knots in the lists of a mesh: only the cells that a change reaches are computed again."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.mesh.mesh import Mesh
from surface.spline.basis import blending
from surface.spline.kernels import points_in

from .lists import LANES, Basis, Lists, cells_by_point, grow, write_rows
from .storage import Storage, expand, make_restore


def change_weights(
    basis: Basis, lists: Lists, storage: Storage, mesh: Mesh, which: Ints, weights: Floats
) -> Ints:  # fmt: skip
    """Give points ``which (k,)`` other ``weights (k,)``; returns the ascending cells that changed, which get plain
    weights."""
    which, cells = basis.copies(which), [np.zeros(0, dtype=np.int64)]
    basis.weights[which] = np.tile(weights, len(basis.shifts))
    for i in which:
        reached, rows = lists.entries_of(int(i))
        expand(lists, storage, reached)
        write_rows(basis, lists, mesh, int(i), reached, rows)
        cells.append(reached)
    return np.unique(np.concatenate(cells))


def change_knots(
    basis: Basis, lists: Lists, storage: Storage, mesh: Mesh, i: int, knots: list[Floats], degrees: list[int]
) -> Ints:  # fmt: skip
    """Give point i other knots; returns the ascending cells that changed, which get plain weights.

    ``ValueError`` where a vertex would be covered by no point; nothing is changed then.
    """
    copies = [(b * basis.n + i, [knots[k] + shift[k] for k in range(2)]) for b, shift in enumerate(basis.shifts)]
    restore = make_restore(lists, storage)
    for copy, shifted in copies:
        expand(lists, storage, np.union1d(lists.entries_of(copy)[0], _cells_in(mesh, shifted)))
        vertex = _first_uncovered(lists, mesh, copy, shifted)
        if vertex >= 0:
            restore()
            raise ValueError(f"knots_u, knots_v: point {i} would leave vertex {vertex} of the mesh uncovered")
    return np.unique(np.concatenate([_replace_knots(basis, lists, mesh, *copy, degrees) for copy in copies]))


def _first_uncovered(lists: Lists, mesh: Mesh, i: int, knots: list[Floats]) -> int:
    """Return the first vertex that only point i covers and that the new knots do not reach, or -1."""
    found = np.zeros(len(mesh.uv), dtype=np.int64)
    count = _list_only_covered(
        *lists.entries_of(i), lists.cell_start, lists.rows, lists.room, lists.at, lists.value, found
    )
    for vertex in found[:count]:
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
        basis.knots[k] = _replace_row(basis.knots[k], i, knots[k])
        basis.degrees[k][i] = degrees[k]
    old, old_rows = lists.entries_of(i)
    cells = np.union1d(old, _cells_in(mesh, knots))
    rows = np.full(len(cells), -1, dtype=np.int64)
    rows[np.searchsorted(cells, old)] = old_rows
    nonzero, held = write_rows(basis, lists, mesh, i, cells, rows), rows >= 0
    for c in cells[held & ~nonzero]:
        _drop_row(lists, i, c)
    new = cells[nonzero & ~held]
    write_rows(basis, lists, mesh, i, new, np.array([_append_row(lists, i, int(c)) for c in new], dtype=np.int64))
    _compact(lists)
    return cells[held | nonzero]


def _replace_row(table: Floats, i: int, row: Floats) -> Floats:
    """Return knots with row i replaced; wider where the row needs it."""
    if len(row) > table.shape[1]:
        table = np.hstack([table, np.repeat(table[:, -1:], len(row) - table.shape[1], axis=1)])
    table[i] = row[-1]
    table[i, : len(row)] = row
    return np.ascontiguousarray(table)


def _cells_in(mesh: Mesh, knots: list[Floats]) -> Ints:
    """Return cells whose vertices lie within the rectangle of the knots."""
    boxes, bins = mesh.cell_boxes
    box = np.array([knots[0][0], knots[0][-1], knots[1][0], knots[1][-1]])
    out, along = np.zeros(len(boxes), dtype=np.int32), [np.ascontiguousarray(boxes[:, k : k + 2]) for k in (0, 2)]
    found = points_in(box, *along, bins.grid, bins.shape, bins.start, bins.ids, out)
    return np.sort(out[:found]).astype(np.int64)


def _blocks(lists: Lists, c: int) -> list[np.ndarray]:
    """Return views of a cell's weights (tiles, room, 8) and derivative weights (tiles, room, 16), if there are any."""
    room, at = lists.room[c], lists.at[c]
    tiles = lists.tile_start[c + 1] - lists.tile_start[c]
    end = at + tiles * room * LANES
    slope_tiles = tiles if len(lists.slope) else 0
    return [lists.value[at:end].reshape(tiles, room, 8), lists.slope[2 * at : 2 * end].reshape(slope_tiles, room, 16)]


def _entry(lists: Lists, i: int, c: int) -> int:
    """Return the index of point i's entry for cell c."""
    start = lists.point_start[i]
    return int(start + np.argmax(lists.point_cell[start : start + lists.point_count[i]] == c))


def _drop_row(lists: Lists, i: int, c: int) -> None:
    """Remove point i's row from cell c: the last row takes its place."""
    entry, last, first = _entry(lists, i, c), lists.rows[c] - 1, lists.ids_at[c]
    row, moved = lists.point_row[entry], lists.ids[first + last]
    for block in _blocks(lists, c):
        block[:, row] = block[:, last]
    lists.ids[first + row] = moved
    lists.point_row[_entry(lists, moved, c)] = row
    lists.rows[c] = last
    end = lists.point_start[i] + lists.point_count[i] - 1
    lists.point_cell[entry], lists.point_row[entry] = lists.point_cell[end], lists.point_row[end]
    lists.point_count[i] -= 1


def _append_row(lists: Lists, i: int, c: int) -> int:
    """Add a row for point i to cell c, whose weights are still to be written; returns its number."""
    row = int(lists.rows[c])
    if row == lists.room[c]:
        _enlarge(lists, c, row * 5 // 4 + 4)
    lists.ids[lists.ids_at[c] + row] = i
    lists.rows[c] += 1
    start, count = int(lists.point_start[i]), int(lists.point_count[i])
    if count == lists.point_room[i]:  # its list of cells is full: it moves to the end of the arrays
        room, end = count * 5 // 4 + 4, lists.point_used
        for name in ("point_cell", "point_row"):
            table = grow(getattr(lists, name), end + room)
            table[end : end + count] = table[start : start + count]
            setattr(lists, name, table)
        start = lists.point_start[i] = end
        lists.point_room[i], lists.point_used = room, end + room
    lists.point_cell[start + count], lists.point_row[start + count] = c, row
    lists.point_count[i] += 1
    return row


def _enlarge(lists: Lists, c: int, room: int) -> None:
    """Give a cell a block with more room, at the end of the arrays."""
    rows, first, old = lists.rows[c], lists.ids_at[c], _blocks(lists, c)
    ids = lists.ids[first : first + rows].copy()
    lists.at[c], lists.ids_at[c], lists.room[c] = lists.used, lists.ids_used, room
    lists.used += int(lists.tile_start[c + 1] - lists.tile_start[c]) * room * LANES
    lists.ids_used += room
    lists.value, lists.ids = grow(lists.value, lists.used), grow(lists.ids, lists.ids_used)
    if len(lists.slope):
        lists.slope = grow(lists.slope, 2 * lists.used)
    for new, block in zip(_blocks(lists, c), old, strict=True):
        new[:, :rows] = block[:, :rows]
    lists.ids[lists.ids_at[c] : lists.ids_at[c] + rows] = ids


def _compact(lists: Lists) -> None:
    """Once half of the arrays is no longer used, copy what is used to new ones without gaps."""
    held = np.where(lists.room > 0, lists.rows, 0)  # none where a cell has no block
    sizes = held * np.diff(lists.tile_start) * LANES
    if lists.used <= 2 * sizes.sum() and lists.point_used <= 2 * int(lists.point_count.sum()) + 1024:
        return
    cells = [(_blocks(lists, c), lists.ids_at[c], rows) for c, rows in enumerate(lists.rows)]
    lists.value, lists.slope = (
        np.concatenate([blocks[k][:, :rows].ravel() for blocks, _, rows in cells]) for k in range(2)
    )
    lists.ids = np.concatenate([lists.ids[first : first + rows] for _, first, rows in cells])
    lists.at, lists.ids_at, lists.room = np.cumsum(sizes) - sizes, np.cumsum(lists.rows) - lists.rows, held
    by_point = cells_by_point(lists.ids, lists.rows, len(lists.point_start))
    lists.point_start, lists.point_count, lists.point_cell, lists.point_row = by_point
    lists.__post_init__()


@kernel
def _list_only_covered(cells, places, cell_start, rows, room, at, value, out):
    """List the vertices at which a point with rows ``places`` in ``cells`` is the only one; return their number."""
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
