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
from surface.spline.lanes import add, div, fma, load, mul, prefetch, root, splat, store, store3, sub, zero

LEAST_SUM = 1e-36  # of the weights at a vertex: float32 has fewer digits for smaller numbers
AHEAD = 1024  # weights that are prefetched before they are needed


NAMES = (
    "cell_start", "tile_start", "rows", "room", "at", "ids_at", "ids", "value", "slope",
    "point_start", "point_count", "point_cell", "point_row",
    "points", "origin", "inv_w", "dw", "numerators", "differences", "vertices", "normals",
    "ranges", "hits", "affected", "recomputed", "moved_ids", "delta", "local", "scratch",
    "pull", "span", "drift", "extent",
)  # fmt: skip
"""The arrays of an update in the order of the tuple ``arrays``: of :class:`.lists.Lists`, then of :mod:`.deformation`.

Kernels unpack that tuple once: each access of an element costs a reference count.
"""


@inlined
def gather(points, ids, first, rows, origin, c, local):
    """Copy a cell's control points, relative to its origin, into ``local (>= rows, 3)`` float32."""
    for k in range(rows):
        i = ids[first + k]
        local[k, 0] = points[i, 0] - origin[c, 0]
        local[k, 1] = points[i, 1] - origin[c, 1]
        local[k, 2] = points[i, 2] - origin[c, 2]


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
def compute_positions(rows, at, tile, value, inv_w, local):
    """Positions of one tile relative to the cell's origin, from the cell's control points."""
    x, y, z = sum_values(value, at, rows, local)
    return positions_of(tile, x, y, z, inv_w)


@inlined
def compute_normals(rows, at, tile, sign, value, slope, inv_w, dw, local):
    """Positions relative to the cell's origin and normals of one tile, from the cell's control points."""
    x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, at, rows, local)
    x, y, z = positions_of(tile, x, y, z, inv_w)
    nx, ny, nz = normals_of(tile, x, y, z, ax, ay, az, bx, by, bz, sign, dw)
    return x, y, z, nx, ny, nz


@inlined
def store_numerators(first_tile, end_tile, rows, room, at, value, slope, local, numerators):
    """Store the numerators of one cell, whose points are in ``local``, for later differences."""
    size = 72 if slope.shape[0] > 0 else 24
    for tile in range(first_tile, end_tile):
        base = tile * size
        if size == 24:
            x, y, z = sum_values(value, at, rows, local)
        else:
            x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, at, rows, local)
            store(numerators, base + 24, ax)
            store(numerators, base + 32, ay)
            store(numerators, base + 40, az)
            store(numerators, base + 48, bx)
            store(numerators, base + 56, by)
            store(numerators, base + 64, bz)
        store(numerators, base, x)
        store(numerators, base + 8, y)
        store(numerators, base + 16, z)
        at += room * 8


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


@kernel
def compute_cells(arrays, cells, begin, end, sign, local, scratch):
    """Compute ``cells[begin:end]`` from their control points; their numerators are no longer stored."""
    cell_start, tile_start, all_rows, room, at, ids_at, ids, value, slope = arrays[:9]
    points, origin, inv_w, dw, _, differences, vertices, normals = arrays[13:21]
    for q in range(begin, end):
        c = cells[q]
        differences[c] = -1
        rows, place, step, tile = all_rows[c], at[c], room[c] * 8, tile_start[c]
        gather(points, ids, ids_at[c], rows, origin, c, local)
        px, py, pz = splat(np.float32(origin[c, 0])), splat(np.float32(origin[c, 1])), splat(np.float32(origin[c, 2]))
        first, last = cell_start[c], cell_start[c + 1]
        full = last - (last - first) % 8
        if slope.shape[0] == 0:
            for vertex in range(first, full, 8):
                x, y, z = compute_positions(rows, place, tile, value, inv_w, local)
                store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
                place += step
                tile += 1
            if full < last:
                x, y, z = compute_positions(rows, place, tile, value, inv_w, local)
                write_last(vertices, full, last, add(x, px), add(y, py), add(z, pz), scratch)
            continue
        for vertex in range(first, full, 8):
            x, y, z, nx, ny, nz = compute_normals(rows, place, tile, sign, value, slope, inv_w, dw, local)
            store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
            store3(normals, 3 * vertex, nx, ny, nz)
            place += step
            tile += 1
        if full < last:
            x, y, z, nx, ny, nz = compute_normals(rows, place, tile, sign, value, slope, inv_w, dw, local)
            write_last(vertices, full, last, add(x, px), add(y, py), add(z, pz), scratch)
            write_last(normals, full, last, nx, ny, nz, scratch)


@kernel
def denominators(cells, cell_start, tile_start, rows, room, at, value, slope, inv_w, dw):
    """Sum the weights of the given cells."""
    for q in range(cells.shape[0]):
        c = cells[q]
        for tile in range(tile_start[c], tile_start[c + 1]):
            t = tile - tile_start[c]
            for j in range(8):
                w, wu, wv = 0.0, 0.0, 0.0
                for k in range(rows[c]):
                    place = at[c] + (t * room[c] + k) * 8
                    w += value[place + j]
                    if slope.shape[0] > 0:
                        wu += slope[2 * place + j]
                        wv += slope[2 * place + 8 + j]
                if cell_start[c] + 8 * t + j >= cell_start[c + 1]:
                    w = 1.0  # lanes that fill up the last tile
                inv_w[8 * tile + j] = 1.0 / w if w >= LEAST_SUM else np.inf
                if slope.shape[0] > 0:
                    dw[16 * tile + j], dw[16 * tile + 8 + j] = wu, wv


@kernel
def unusable(cells, cell_start, tile_start, rows, room, at, value, slope, inv_w):
    """The first vertex of ``cells`` whose weights add up to less than ``LEAST_SUM``, or one of whose weights or
    derivative weights is not finite; -1 if there is none."""
    for q in range(cells.shape[0]):
        c = cells[q]
        for vertex in range(cell_start[c], cell_start[c + 1]):
            t, j = (vertex - cell_start[c]) // 8, (vertex - cell_start[c]) % 8
            total = np.float64(inv_w[8 * (tile_start[c] + t) + j])
            for k in range(rows[c]):
                place = at[c] + (t * room[c] + k) * 8
                total += abs(value[place + j])
                if slope.shape[0] > 0:
                    total += abs(slope[2 * place + j]) + abs(slope[2 * place + 8 + j])
            if not total < np.inf:
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
