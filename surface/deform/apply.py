"""Compiled kernels that turn weights and control points into vertices and normals, Eq. (1), cell by cell.

A tile is eight vertices. Per tile, ``inv_w`` (8 numbers) holds one over the denominator, ``dw`` (16) the derivatives
of the denominator in u and in v, ``numerators`` (72) the x, y and z numerators of the position, of the derivative in
u and of that in v. Numerators are those of positions relative to the cell's origin, which keeps float32 sums exact
to a small part of the cell's size. Without normals ``dw`` is empty and ``numerators`` has 24 numbers per tile.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel
from surface.spline.lanes import add, div, fma, load, mul, prefetch, root, splat, store, store3, store_offset, sub, zero

from .groupsums import HEAD, STEP, join_all, join_values, sum_groups, wide

LEAST_SUM = 1e-36  # of the weights at a vertex: float32 has fewer digits for smaller numbers
AHEAD = 1024  # weights that are prefetched before they are needed


NAMES = (
    "cell_start", "tile_start", "rows", "room", "at", "ids_at", "ids", "value", "slope",
    "point_start", "point_count", "point_cell", "point_row",
    "points", "origin", "inv_w", "dw", "numerators", "differences", "vertices", "normals",
    "ranges", "hits", "affected", "recomputed", "moved_ids", "delta", "local", "scratch",
    "pull", "span", "drift", "extent",
    "rows_at", "picks_at", "factor_u", "factor_v", "factors", "picks",
)  # fmt: skip
"""The arrays of an update in the order of the tuple ``arrays``: of :class:`.lists.Lists`, then of :mod:`.deformation`,
then of :class:`.factors.Factors`.

Kernels unpack that tuple once: each access of an element costs a reference count.
"""


@inlined
def gather(points, ids, first, rows, origin, c, local):
    """Copy a cell's control points, relative to its origin, into ``local (>= rows, 4)`` float32, whose last column gets
    what lies behind them: ``points`` and ``origin`` are followed by one number more."""
    for k in range(rows):
        store_offset(points, 3 * ids[first + k], origin, 3 * c, local, 4 * k)


@inlined
def sum_values(value, at, rows, local):
    """Three sums of one tile; four rows at a time so that additions do not wait for each other."""
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
    """Nine sums of one tile: the numerators of the position and of its derivatives in u and in v."""
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
def unit_cross(ax, ay, az, bx, by, bz, sign):
    """Unit vectors along a x b, times ``sign``; zero where the product vanishes."""
    nx, ny = sub(mul(ay, bz), mul(az, by)), sub(mul(az, bx), mul(ax, bz))
    nz = sub(mul(ax, by), mul(ay, bx))
    square = add(add(mul(nx, nx), mul(ny, ny)), mul(nz, nz))
    scale = div(splat(sign), root(add(square, splat(np.float32(1e-30)))))
    return mul(nx, scale), mul(ny, scale), mul(nz, scale)


@inlined
def write_last(out, vertex, last, x, y, z, scratch):
    """Write the last vectors of a cell, fewer than a tile has, to ``out (m * 3,)``."""
    store3(scratch, 0, x, y, z)
    for j in range(3 * (last - vertex)):
        out[3 * vertex + j] = scratch[j]


@inlined
def positions_of(tile, x, y, z, inv_w):
    """Positions of one tile relative to the cell's origin, from their numerators."""
    w = load(inv_w, 8 * tile)
    return mul(x, w), mul(y, w), mul(z, w)


@inlined
def normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw):
    """Normals of one tile: the direction of S_u x S_v by the quotient rule, without its common factor."""
    wu, wv = load(dw, 16 * tile), load(dw, 16 * tile + 8)
    ax, ay, az = sub(ax, mul(x, wu)), sub(ay, mul(y, wu)), sub(az, mul(z, wu))
    bx, by, bz = sub(bx, mul(x, wv)), sub(by, mul(y, wv)), sub(bz, mul(z, wv))
    return unit_cross(ax, ay, az, bx, by, bz, sign)


@inlined
def store_numerators(
    first_tile, end_tile, rows, place, step, row, head, slopes, value, slope, factor_u, factor_v, factors, picks, local,
    starts, scratch, numerators,
):  # fmt: skip
    """Store the numerators of one cell, whose points are in ``local``, for later differences."""
    base, at, groups = first_tile * (72 if slopes else 24), head + HEAD, 0
    wide_u, wide_v = wide(row, head, picks)
    if row >= 0:
        groups = sum_groups(factors, factor_u, factor_v, row, rows, wide_u, slopes, local, starts, scratch)
    for _ in range(first_tile, end_tile):
        if slopes:
            if row >= 0:
                x, y, z, ax, ay, az, bx, by, bz = join_all(groups, wide_u, wide_v, at, factors, picks, starts, scratch)
            else:
                x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, place, rows, local)
            store(numerators, base + 24, ax)
            store(numerators, base + 32, ay)
            store(numerators, base + 40, az)
            store(numerators, base + 48, bx)
            store(numerators, base + 56, by)
            store(numerators, base + 64, bz)
        elif row >= 0:
            x, y, z = join_values(groups, wide_u, at, factors, picks, starts, scratch)
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
    """Positions relative to the cell's origin, and normals if there are any, of one tile from its numerators."""
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
def finish_cell(first, last, tile, ox, oy, oz, sign, inv_w, dw, numerators, vertices, normals, scratch):
    """Write the vertices and normals of one cell from its stored numerators."""
    px, py, pz = splat(ox), splat(oy), splat(oz)
    size, full = 72 if dw.shape[0] > 0 else 24, last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z, nx, ny, nz = load_tile(tile, size, sign, inv_w, dw, numerators)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        if size == 72:
            store3(normals, 3 * vertex, nx, ny, nz)
        tile += 1
    if full < last:
        x, y, z, nx, ny, nz = load_tile(tile, size, sign, inv_w, dw, numerators)
        write_last(vertices, full, last, add(x, px), add(y, py), add(z, pz), scratch)
        if size == 72:
            write_last(normals, full, last, nx, ny, nz, scratch)


@inlined
def write_tile(out, vertex, last, x, y, z, scratch):
    """Write the vectors of a tile that begins at ``vertex`` of a cell that ends before ``last``."""
    if vertex + 8 <= last:
        store3(out, 3 * vertex, x, y, z)
    else:
        write_last(out, vertex, last, x, y, z, scratch)


@inlined
def write_plain(first, last, tile, place, step, rows, px, py, pz, value, inv_w, local, scratch, vertices):
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
        write_last(vertices, full, last, add(x, px), add(y, py), add(z, pz), scratch)


@inlined
def write_joined(
    first, last, tile, groups, wide_u, pick_at, px, py, pz, factors, picks, starts, scratch, inv_w, vertices
):  # fmt: skip
    """Positions of a cell with factors, whose groups have been summed."""
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z = join_values(groups, wide_u, pick_at, factors, picks, starts, scratch)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        pick_at += STEP
        tile += 1
    if full < last:
        x, y, z = join_values(groups, wide_u, pick_at, factors, picks, starts, scratch)
        x, y, z = positions_of(tile, x, y, z, inv_w)
        write_last(vertices, full, last, add(x, px), add(y, py), add(z, pz), scratch)


@kernel
def compute_cells(arrays, cells, begin, end, sign, local, scratch):
    """Compute ``cells[begin:end]`` from their control points; their numerators are no longer stored."""
    cell_start, tile_start, all_rows, room, at, ids_at, ids, value, slope = arrays[:9]
    points, origin, inv_w, dw, _, differences, vertices, normals = arrays[13:21]
    rows_at, picks_at, factor_u, factor_v, factors, picks = arrays[33:]
    starts = np.empty(local.shape[0], np.int32)
    for q in range(begin, end):
        c = cells[q]
        differences[c] = -1
        rows, first, last = all_rows[c], cell_start[c], cell_start[c + 1]
        gather(points, ids, ids_at[c], rows, origin, c, local)
        px, py, pz = splat(np.float32(origin[c, 0])), splat(np.float32(origin[c, 1])), splat(np.float32(origin[c, 2]))
        place, step, row, pick_at, tile = at[c], room[c] * 8, rows_at[c], picks_at[c] + HEAD, tile_start[c]
        wide_u, wide_v = wide(row, picks_at[c], picks)
        if dw.shape[0] == 0 and row < 0:
            write_plain(
                first, last, tile, place, step, rows, px, py, pz, value, inv_w, local, scratch, vertices
            )  # fmt: skip
        elif dw.shape[0] == 0:
            groups = sum_groups(factors, factor_u, factor_v, row, rows, wide_u, False, local, starts, scratch)
            write_joined(
                first, last, tile, groups, wide_u, pick_at, px, py, pz, factors, picks, starts, scratch, inv_w, vertices
            )  # fmt: skip
        elif row < 0:
            for vertex in range(first, last, 8):
                x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, place, rows, local)
                x, y, z = positions_of(tile, x, y, z, inv_w)
                nx, ny, nz = normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw)
                write_tile(vertices, vertex, last, add(x, px), add(y, py), add(z, pz), scratch)
                write_tile(normals, vertex, last, nx, ny, nz, scratch)
                place += step
                tile += 1
        else:
            groups = sum_groups(factors, factor_u, factor_v, row, rows, wide_u, True, local, starts, scratch)
            for vertex in range(first, last, 8):
                x, y, z, ax, ay, az, bx, by, bz = join_all(
                    groups, wide_u, wide_v, pick_at, factors, picks, starts, scratch
                )
                x, y, z = positions_of(tile, x, y, z, inv_w)
                nx, ny, nz = normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw)
                write_tile(vertices, vertex, last, add(x, px), add(y, py), add(z, pz), scratch)
                write_tile(normals, vertex, last, nx, ny, nz, scratch)
                pick_at += STEP
                tile += 1


@kernel
def denominators(arrays, cells):
    """Sum the weights of the given cells."""
    cell_start, tile_start, rows, room, at, _, _, value, slope = arrays[:9]
    inv_w, dw = arrays[15:17]
    rows_at, picks_at, factor_u, factor_v, factors, picks = arrays[33:]
    slopes = dw.shape[0] > 0
    for q in range(cells.shape[0]):
        c = cells[q]
        wide_u, wide_v = wide(rows_at[c], picks_at[c], picks)
        for tile in range(tile_start[c], tile_start[c + 1]):
            t = tile - tile_start[c]
            pick_at = picks_at[c] + HEAD + STEP * t
            for j in range(8):
                w, wu, wv = 0.0, 0.0, 0.0
                for k in range(rows[c]):
                    if rows_at[c] >= 0:
                        at_u = factor_u[rows_at[c] + k] + picks[pick_at + 16] + picks[pick_at + j]
                        at_v = factor_v[rows_at[c] + k] + picks[pick_at + 17] + picks[pick_at + 8 + j]
                        w += factors[at_u] * factors[at_v]
                        if slopes:
                            wu += factors[at_u + wide_u] * factors[at_v]
                            wv += factors[at_u] * factors[at_v + wide_v]
                    else:
                        place = at[c] + (t * room[c] + k) * 8
                        w += value[place + j]
                        if slopes:
                            wu += slope[2 * place + j]
                            wv += slope[2 * place + 8 + j]
                if cell_start[c] + 8 * t + j >= cell_start[c + 1]:
                    w = 1.0  # lanes that fill up the last tile
                inv_w[8 * tile + j] = 1.0 / w if w >= LEAST_SUM else np.inf
                if slopes:
                    dw[16 * tile + j], dw[16 * tile + 8 + j] = wu, wv


@kernel
def unusable(cells, cell_start, tile_start, inv_w, dw):
    """The first vertex of ``cells`` whose weights add up to less than ``LEAST_SUM`` or to more than float32 has, or
    whose derivative weights do; -1 if there is none."""
    for q in range(cells.shape[0]):
        c = cells[q]
        for vertex in range(cell_start[c], cell_start[c + 1]):
            t, j = (vertex - cell_start[c]) // 8, (vertex - cell_start[c]) % 8
            tile = tile_start[c] + t
            total = np.float64(inv_w[8 * tile + j])
            usable = total > 0.0
            if dw.shape[0] > 0:
                total += abs(dw[16 * tile + j]) + abs(dw[16 * tile + 8 + j])
            if not (usable and total < np.inf):
                return vertex
    return -1


@kernel
def join_ranges(cells, total, cell_start, gap, out):
    """Vertex ranges of rising cells, joined where fewer than ``gap`` vertices lie between; returns their number."""
    count = 0
    for q in range(total):
        start, stop = cell_start[cells[q]], cell_start[cells[q] + 1]
        if count > 0 and start - out[count - 1, 1] <= gap:
            out[count - 1, 1] = stop
        else:
            out[count, 0], out[count, 1] = start, stop
            count += 1
    return count
