"""Kernels that add rows to weight blocks and take them out, when a control point's subdomain changes."""

# mypy: allow-untyped-defs
from __future__ import annotations

from surface.base.jit import kernel


@kernel
def copy_row(value, slope, source, source_room, source_row, target, target_room, target_row, tiles):
    """Copy one row of a block to a row of the same or another block, tile by tile."""
    for t in range(tiles):
        a = source + (t * source_room + source_row) * 8
        b = target + (t * target_room + target_row) * 8
        for j in range(8):
            value[b + j] = value[a + j]
        if slope.shape[0] > 0:
            for j in range(16):
                slope[2 * b + j] = slope[2 * a + j]


@kernel
def relocate(c, rows, room, at, ids_at, ids, value, slope, tiles, new_room, new_at, new_ids_at):
    """Move a cell's block and list to a place with room for more rows."""
    for k in range(rows[c]):
        copy_row(value, slope, at[c], room[c], k, new_at, new_room, k, tiles)
        ids[new_ids_at + k] = ids[ids_at[c] + k]
    at[c], ids_at[c], room[c] = new_at, new_ids_at, new_room


@kernel
def find_entry(i, c, start, count, cell):
    """Where point i's entry for cell c stands, or -1."""
    for e in range(start[i], start[i] + count[i]):
        if cell[e] == c:
            return e
    return -1


@kernel
def drop_row(c, row, rows, room, at, ids_at, ids, value, slope, tiles, start, count, cell, back_row):
    """Take one row out of a cell: the last row takes its place."""
    i, last = ids[ids_at[c] + row], rows[c] - 1
    if row != last:
        moved = ids[ids_at[c] + last]
        copy_row(value, slope, at[c], room[c], last, at[c], room[c], row, tiles)
        ids[ids_at[c] + row] = moved
        back_row[find_entry(moved, c, start, count, cell)] = row
    rows[c] = last
    e, end = find_entry(i, c, start, count, cell), start[i] + count[i] - 1
    cell[e], back_row[e] = cell[end], back_row[end]
    count[i] -= 1


@kernel
def pack(rows, room, at, ids_at, ids, value, slope, tiles, new_value, new_slope, new_ids):
    """Copy all blocks and lists to fresh arrays without gaps."""
    place, listed = 0, 0
    for c in range(rows.shape[0]):
        for k in range(rows[c]):
            new_ids[listed + k] = ids[ids_at[c] + k]
            for t in range(tiles[c]):
                a, b = at[c] + (t * room[c] + k) * 8, place + (t * rows[c] + k) * 8
                new_value[b : b + 8] = value[a : a + 8]
                if slope.shape[0] > 0:
                    new_slope[2 * b : 2 * b + 16] = slope[2 * a : 2 * a + 16]
        at[c], ids_at[c], room[c] = place, listed, rows[c]
        place += rows[c] * tiles[c] * 8
        listed += rows[c]


@kernel
def alone(cells, places, cell_start, rows, room, at, value, out):
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
