"""Compiled kernels that turn weights and control points into vertices and normals, Eq. (1), cell by cell.

A tile is eight vertices. Per tile, ``inv_w`` (8 numbers) holds one over the denominator, ``dw`` (16) the derivatives
of the denominator in u and in v, ``numerators`` (72) the x, y and z numerators of the position, of the derivative in
u and of that in v. Numerators are those of positions relative to the cell's origin, which keeps float32 sums exact
to a small part of the cell's size. Without normals ``dw`` is empty and ``numerators`` has 24 numbers per tile.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, nonallocating
from surface.spline.lanes import (
    add,
    div,
    fma,
    item,
    load,
    most_of,
    mul,
    prefetch,
    reaches,
    root,
    splat,
    store,
    store3,
    store_difference,
    sub,
    zero,
)

from .binding import arrays_of
from .groupsums import HEAD, STEP, factor_counts, join_all, join_values, sum_groups, takes_whole
from .packedsums import sum_all_packed, sum_packed, write_lanes

AHEAD = 1024  # plain weights that are prefetched before they are needed
AHEAD_OUT = 384  # coordinates of vertices that are fetched before they are written: 16 tiles
MAX_SQUARE = np.float32(1e36)  # of a vector's length


@inlined
def gather(points, ids, first, rows, origin, c, local):
    """Copy a cell's control points, relative to its origin, into ``local (> rows, 3)`` float32.

    Four numbers are copied at once; the fourth is overwritten by the next point, or lies in the last row.
    """
    for k in range(rows):
        store_difference(local, 3 * k, points, 3 * item(ids, first + k), origin, 3 * c)


@inlined
def sum_values(value, at, rows, local):
    """Return three sums of one tile; four rows at a time so that additions do not wait for each other."""
    x0, y0, z0 = zero(), zero(), zero()
    x1, y1, z1 = zero(), zero(), zero()
    x2, y2, z2 = zero(), zero(), zero()
    x3, y3, z3 = zero(), zero(), zero()
    k = 0
    while k + 4 <= rows:
        a, b = load(value, at + 8 * k), load(value, at + 8 * k + 8)
        c, d = load(value, at + 8 * k + 16), load(value, at + 8 * k + 24)
        prefetch(value, at + 8 * k + AHEAD)
        prefetch(value, at + 8 * k + 16 + AHEAD)
        x0, y0, z0 = fma(a, local[k, 0], x0), fma(a, local[k, 1], y0), fma(a, local[k, 2], z0)
        x1, y1, z1 = fma(b, local[k + 1, 0], x1), fma(b, local[k + 1, 1], y1), fma(b, local[k + 1, 2], z1)
        x2, y2, z2 = fma(c, local[k + 2, 0], x2), fma(c, local[k + 2, 1], y2), fma(c, local[k + 2, 2], z2)
        x3, y3, z3 = fma(d, local[k + 3, 0], x3), fma(d, local[k + 3, 1], y3), fma(d, local[k + 3, 2], z3)
        k += 4
    while k < rows:
        a = load(value, at + 8 * k)
        x0, y0, z0 = fma(a, local[k, 0], x0), fma(a, local[k, 1], y0), fma(a, local[k, 2], z0)
        k += 1
    return add(add(x0, x1), add(x2, x3)), add(add(y0, y1), add(y2, y3)), add(add(z0, z1), add(z2, z3))


@inlined
def sum_all(value, slope, at, rows, local):
    """Return nine sums of one tile: the numerators of the position and of its derivatives in u and in v."""
    x, y, z = zero(), zero(), zero()
    ax, ay, az, bx, by, bz = zero(), zero(), zero(), zero(), zero(), zero()
    for k in range(rows):
        w = load(value, at + 8 * k)
        u, v = load(slope, 2 * at + 16 * k), load(slope, 2 * at + 16 * k + 8)
        x, y, z = fma(w, local[k, 0], x), fma(w, local[k, 1], y), fma(w, local[k, 2], z)
        ax, ay, az = fma(u, local[k, 0], ax), fma(u, local[k, 1], ay), fma(u, local[k, 2], az)
        bx, by, bz = fma(v, local[k, 0], bx), fma(v, local[k, 1], by), fma(v, local[k, 2], bz)
    return x, y, z, ax, ay, az, bx, by, bz


@inlined
def cross(ax, ay, az, bx, by, bz):
    """Return a x b, and the square of its length."""
    nx, ny = sub(mul(ay, bz), mul(az, by)), sub(mul(az, bx), mul(ax, bz))
    nz = sub(mul(ax, by), mul(ay, bx))
    return nx, ny, nz, add(add(mul(nx, nx), mul(ny, ny)), mul(nz, nz))


@inlined
def unit_cross(ax, ay, az, bx, by, bz, sign):
    """Return unit vectors along a x b, times ``sign``; zero where the product vanishes.

    Where its square is beyond float32, a and b are shortened first.
    """
    nx, ny, nz, square = cross(ax, ay, az, bx, by, bz)
    if reaches(square, MAX_SQUARE):
        a, b = most_of(ax, ay, az), most_of(bx, by, bz)
        nx, ny, nz, square = cross(div(ax, a), div(ay, a), div(az, a), div(bx, b), div(by, b), div(bz, b))
    scale = div(splat(sign), root(add(square, splat(np.float32(1e-30)))))
    return mul(nx, scale), mul(ny, scale), mul(nz, scale)


@inlined
def positions_of(tile, x, y, z, inv_w):
    """Return positions of one tile relative to the cell's origin, from their numerators."""
    w = load(inv_w, 8 * tile)
    return mul(x, w), mul(y, w), mul(z, w)


@inlined
def normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw):
    """Return normals of one tile: the direction of S_u x S_v by the quotient rule, without its common factor."""
    wu, wv = load(dw, 16 * tile), load(dw, 16 * tile + 8)
    ax, ay, az = sub(ax, mul(x, wu)), sub(ay, mul(y, wu)), sub(az, mul(z, wu))
    bx, by, bz = sub(bx, mul(x, wv)), sub(by, mul(y, wv)), sub(bz, mul(z, wv))
    return unit_cross(ax, ay, az, bx, by, bz, sign)


@inlined
def store_numerators(
    first_tile, end_tile, rows, place, step, row, head, slopes, value, slope, factor_u, factor_v, factors, picks,
    pack_at, tile_entry, entry_row, packed, packed_slope, local, starts, scratch, numerators,
):  # fmt: skip
    """Store the numerators of one cell, whose points are in ``local``, for later differences."""
    base, at, groups = first_tile * (72 if slopes else 24), head + HEAD, 0
    wide_u, wide_v = factor_counts(row, head, picks)
    whole = takes_whole(row, head, picks)
    if row >= 0:
        groups = sum_groups(factors, factor_u, factor_v, row, rows, wide_u, whole, slopes, local, starts, scratch)
    for tile in range(first_tile, end_tile):
        entries = pack_at + tile - first_tile
        if slopes:
            if row >= 0:
                x, y, z, ax, ay, az, bx, by, bz = join_all(
                    groups, wide_u, wide_v, whole, at, factors, picks, starts, scratch
                )
            elif pack_at >= 0:
                x, y, z, ax, ay, az, bx, by, bz = sum_all_packed(
                    packed, packed_slope, entry_row, tile_entry[entries], tile_entry[entries + 1], local
                )
            else:
                x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, place, rows, local)
            store(numerators, base + 24, ax)
            store(numerators, base + 32, ay)
            store(numerators, base + 40, az)
            store(numerators, base + 48, bx)
            store(numerators, base + 56, by)
            store(numerators, base + 64, bz)
        elif row >= 0:
            x, y, z = join_values(groups, wide_u, whole, at, factors, picks, starts, scratch)
        elif pack_at >= 0:
            x, y, z = sum_packed(packed, entry_row, tile_entry[entries], tile_entry[entries + 1], local)
        else:
            x, y, z = sum_values(value, place, rows, local)
        store(numerators, base, x)
        store(numerators, base + 8, y)
        store(numerators, base + 16, z)
        base += 72 if slopes else 24
        place += step
        at += STEP


@inlined
def load_tile(tile, size, sign, inv_w, dw, numerators):
    """Return positions relative to the cell's origin, and normals if there are any, of one tile from its numerators."""
    base = tile * size
    x, y, z = load(numerators, base), load(numerators, base + 8), load(numerators, base + 16)
    x, y, z = positions_of(tile, x, y, z, inv_w)
    nx, ny, nz = x, y, z
    if size == 72:
        ax, ay, az = load(numerators, base + 24), load(numerators, base + 32), load(numerators, base + 40)
        bx, by, bz = load(numerators, base + 48), load(numerators, base + 56), load(numerators, base + 64)
        nx, ny, nz = normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw)
    return x, y, z, nx, ny, nz


@inlined
def finish_cell(
    first, last, tile, ox, oy, oz, sign, inv_w, dw, numerators, vertices, normals, order_at, order, every, touched,
    scratch,
):  # fmt: skip
    """Write the vertices and normals of ``every`` tile, or of those ``touched``, of one cell from its numerators."""
    px, py, pz = splat(ox), splat(oy), splat(oz)
    size = 72 if dw.shape[0] > 0 else 24
    for vertex in range(first, last, 8):
        if every or touched[tile] != 0:
            x, y, z, nx, ny, nz = load_tile(tile, size, sign, inv_w, dw, numerators)
            x, y, z = add(x, px), add(y, py), add(z, pz)
            write_lanes(vertices, first, last, vertex, order_at, order, x, y, z, scratch)
            if size == 72:
                write_lanes(normals, first, last, vertex, order_at, order, nx, ny, nz, scratch)
        touched[tile] = 0
        tile += 1


@inlined
def write_plain(first, last, tile, place, step, rows, px, py, pz, value, inv_w, local, order, scratch, vertices):
    """Positions of a cell with plain weights; the loop over whole tiles is without branches."""
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z = sum_values(value, place, rows, local)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        place += step
        tile += 1
    if full < last:
        x, y, z = sum_values(value, place, rows, local)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        write_lanes(vertices, first, last, full, -1, order, add(x, px), add(y, py), add(z, pz), scratch)


@inlined
def write_joined(
    first, last, tile, groups, wide_u, whole, pick_at, px, py, pz, factors, picks, starts, order, scratch, inv_w,
    vertices,
):  # fmt: skip
    """Positions of a cell with factors, whose groups have been summed."""
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        prefetch(vertices, 3 * vertex + AHEAD_OUT)  # a line is read before a part of it is written
        prefetch(vertices, 3 * vertex + AHEAD_OUT + 16)
        prefetch(inv_w, 8 * tile + AHEAD_OUT // 3)
        x, y, z = join_values(groups, wide_u, whole, pick_at, factors, picks, starts, scratch)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        pick_at += STEP
        tile += 1
    if full < last:
        x, y, z = join_values(groups, wide_u, whole, pick_at, factors, picks, starts, scratch)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        write_lanes(vertices, first, last, full, -1, order, add(x, px), add(y, py), add(z, pz), scratch)


@inlined
def write_packed(
    first, last, tile, entries, px, py, pz, packed, entry_row, tile_entry, inv_w, local, order_at, order, scratch,
    vertices,
):  # fmt: skip
    """Positions of a packed cell, whose tiles start at ``entries`` in ``tile_entry``."""
    e = tile_entry[entries]
    for vertex in range(first, last, 8):
        entries += 1
        end = tile_entry[entries]
        x, y, z = sum_packed(packed, entry_row, e, end, local)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        x, y, z = add(x, px), add(y, py), add(z, pz)
        write_lanes(vertices, first, last, vertex, order_at, order, x, y, z, scratch)
        tile += 1
        e = end


@nonallocating
def compute_cells(table, cells, begin, end, sign, local, scratch, starts):
    """Compute ``cells[begin:end]`` from their control points; their numerators are no longer stored.

    ``local``, ``scratch``, ``starts`` : scratch space, of which every thread has its own.
    """
    arrays = arrays_of(table)
    cell_start, tile_start, all_rows, room, at, ids_at, ids, value, slope = arrays[:9]
    points, origin, inv_w, dw, _, differences, vertices, normals = arrays[13:21]
    rows_at, picks_at, factor_u, factor_v, factors, picks = arrays[33:39]
    packed_at, tile_entry, entry_row, packed, packed_slope, _, _, order_at, order = arrays[39:48]
    for q in range(begin, end):
        c = cells[q]
        differences[c] = -1
        rows, first, last, pack_at = all_rows[c], cell_start[c], cell_start[c + 1], packed_at[c]
        gather(points, ids, ids_at[c], rows, origin, c, local)
        px, py, pz = splat(np.float32(origin[c, 0])), splat(np.float32(origin[c, 1])), splat(np.float32(origin[c, 2]))
        place, step, row, pick_at, tile = at[c], room[c] * 8, rows_at[c], picks_at[c] + HEAD, tile_start[c]
        wide_u, wide_v = factor_counts(row, picks_at[c], picks)
        groups, whole = 0, takes_whole(row, picks_at[c], picks)
        if row >= 0:
            groups = sum_groups(
                factors, factor_u, factor_v, row, rows, wide_u, whole, dw.shape[0] > 0, local, starts, scratch
            )
        if dw.shape[0] == 0 and row >= 0:
            write_joined(
                first, last, tile, groups, wide_u, whole, pick_at, px, py, pz, factors, picks, starts, order, scratch,
                inv_w, vertices,
            )  # fmt: skip
        elif dw.shape[0] == 0 and pack_at >= 0:
            write_packed(
                first, last, tile, pack_at, px, py, pz, packed, entry_row, tile_entry, inv_w, local, order_at[c], order,
                scratch, vertices,
            )  # fmt: skip
        elif dw.shape[0] == 0:
            write_plain(
                first, last, tile, place, step, rows, px, py, pz, value, inv_w, local, order, scratch, vertices
            )  # fmt: skip
        else:
            for vertex in range(first, last, 8):
                if row >= 0:
                    x, y, z, ax, ay, az, bx, by, bz = join_all(
                        groups, wide_u, wide_v, whole, pick_at, factors, picks, starts, scratch
                    )
                elif pack_at >= 0:
                    x, y, z, ax, ay, az, bx, by, bz = sum_all_packed(
                        packed, packed_slope, entry_row, tile_entry[pack_at], tile_entry[pack_at + 1], local
                    )
                    pack_at += 1
                else:
                    x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, place, rows, local)
                x, y, z = positions_of(tile, x, y, z, inv_w)
                nx, ny, nz = normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw)
                x, y, z = add(x, px), add(y, py), add(z, pz)
                write_lanes(vertices, first, last, vertex, order_at[c], order, x, y, z, scratch)
                write_lanes(normals, first, last, vertex, order_at[c], order, nx, ny, nz, scratch)
                place += step
                pick_at += STEP
                tile += 1


@nonallocating
def join_ranges(cells, total, cell_start, gap, out):
    """Write the vertex ranges of ascending cells, joined where fewer than ``gap`` vertices lie between; returns their
    number."""
    count = 0
    for q in range(total):
        start, stop = cell_start[cells[q]], cell_start[cells[q] + 1]
        if count > 0 and start - out[count - 1, 1] <= gap:
            out[count - 1, 1] = stop
        else:
            out[count, 0], out[count, 1] = start, stop
            count += 1
    return count
