"""Kernels that turn weights and control points into vertices and normals: Eq. (1) and Eq. (2) by cell.

Per tile of eight vertices, ``below`` (8 numbers) holds one over the denominator, ``bend`` (16) the derivatives of
the denominator in u and in v, ``state`` (72) the x, y and z numerators of the position, of the derivative in u
and of that in v. Numerators are those of positions relative to the cell's origin, which keeps float32 sums exact
to a small part of the cell's size. Without normals ``bend`` is empty and ``state`` has 24 numbers per tile.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel
from surface.spline.lanes import add, div, fma, load, mul, prefetch, root, splat, store, store3, sub, zero

AHEAD = 1024  # weights that are asked for before they are needed
KEEP = -2  # in ``kept``: compute this cell anew and keep its numerators


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
def put(out, vertex, left, x, y, z, spare):
    """Write the ``left`` last vertices of a cell, fewer than a tile has, to ``out (m * 3,)``."""
    store3(spare, 0, x, y, z)
    for j in range(3 * left):
        out[3 * vertex + j] = spare[j]


@inlined
def cross(ax, ay, az, bx, by, bz, sign):
    """Unit vectors along a x b, times ``sign``; zero where the product vanishes."""
    nx, ny = sub(mul(ay, bz), mul(az, by)), sub(mul(az, bx), mul(ax, bz))
    nz = sub(mul(ax, by), mul(ay, bx))
    square = add(add(mul(nx, nx), mul(ny, ny)), mul(nz, nz))
    scale = div(splat(sign), root(add(square, splat(np.float32(1e-30)))))
    return mul(nx, scale), mul(ny, scale), mul(nz, scale)


@inlined
def scaled(tile, x, y, z, below):
    """Positions of one tile relative to the cell's origin, from their numerators."""
    w = load(below, 8 * tile)
    return mul(x, w), mul(y, w), mul(z, w)


@inlined
def directions(tile, x, y, z, ax, ay, az, bx, by, bz, sign, bend):
    """Normals of one tile: the direction of S_u x S_v by the quotient rule, without its common factor."""
    wu, wv = load(bend, 16 * tile), load(bend, 16 * tile + 8)
    ax, ay, az = sub(ax, mul(x, wu)), sub(ay, mul(y, wu)), sub(az, mul(z, wu))
    bx, by, bz = sub(bx, mul(x, wv)), sub(by, mul(y, wv)), sub(bz, mul(z, wv))
    return cross(ax, ay, az, bx, by, bz, sign)


@inlined
def positions(first, last, rows, room, at, tile, value, below, local, ox, oy, oz, vertices, spare):
    """Compute one cell's positions from its gathered points."""
    px, py, pz = splat(ox), splat(oy), splat(oz)
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z = sum_values(value, at, rows, local)
        x, y, z = scaled(tile, x, y, z, below)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        at += room * 8
        tile += 1
    if full < last:
        x, y, z = sum_values(value, at, rows, local)
        x, y, z = scaled(tile, x, y, z, below)
        put(vertices, full, last - full, add(x, px), add(y, py), add(z, pz), spare)


@inlined
def both(rows, at, tile, sign, value, slope, below, bend, local):
    """Positions relative to the origin and normals of one tile."""
    x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, at, rows, local)
    x, y, z = scaled(tile, x, y, z, below)
    nx, ny, nz = directions(tile, x, y, z, ax, ay, az, bx, by, bz, sign, bend)
    return x, y, z, nx, ny, nz


@inlined
def shaded(
    first, last, rows, room, at, tile, sign, value, slope, below, bend, local, ox, oy, oz, vertices, normals, spare
):
    """Compute one cell's positions and normals from its gathered points."""
    px, py, pz = splat(ox), splat(oy), splat(oz)
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z, nx, ny, nz = both(rows, at, tile, sign, value, slope, below, bend, local)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        store3(normals, 3 * vertex, nx, ny, nz)
        at += room * 8
        tile += 1
    if full < last:
        x, y, z, nx, ny, nz = both(rows, at, tile, sign, value, slope, below, bend, local)
        put(vertices, full, last - full, add(x, px), add(y, py), add(z, pz), spare)
        put(normals, full, last - full, nx, ny, nz, spare)


@inlined
def keep_sums(tiles, tile, rows, room, at, value, slope, local, state):
    """Store the numerators of one cell for later differences."""
    size = 72 if slope.shape[0] > 0 else 24
    for t in range(tile, tile + tiles):
        if slope.shape[0] == 0:
            x, y, z = sum_values(value, at, rows, local)
        else:
            x, y, z, ax, ay, az, bx, by, bz = sum_all(value, slope, at, rows, local)
            store(state, t * size + 24, ax)
            store(state, t * size + 32, ay)
            store(state, t * size + 40, az)
            store(state, t * size + 48, bx)
            store(state, t * size + 56, by)
            store(state, t * size + 64, bz)
        store(state, t * size, x)
        store(state, t * size + 8, y)
        store(state, t * size + 16, z)
        at += room * 8


@inlined
def kept_tile(tile, size, sign, below, bend, state):
    """Positions relative to the origin, and normals where they are kept, of one tile from its numerators."""
    base = tile * size
    x, y, z = scaled(tile, load(state, base), load(state, base + 8), load(state, base + 16), below)
    nx, ny, nz = x, y, z
    if size == 72:
        ax, ay, az = load(state, base + 24), load(state, base + 32), load(state, base + 40)
        bx, by, bz = load(state, base + 48), load(state, base + 56), load(state, base + 64)
        nx, ny, nz = directions(tile, x, y, z, ax, ay, az, bx, by, bz, sign, bend)
    return x, y, z, nx, ny, nz


@inlined
def finish_cell(first, last, tile, ox, oy, oz, sign, below, bend, state, vertices, normals, spare):
    """Vertices and normals of one cell from its kept numerators."""
    px, py, pz = splat(ox), splat(oy), splat(oz)
    size = 72 if normals.shape[0] > 0 else 24
    full = last - (last - first) % 8
    for vertex in range(first, full, 8):
        x, y, z, nx, ny, nz = kept_tile(tile, size, sign, below, bend, state)
        store3(vertices, 3 * vertex, add(x, px), add(y, py), add(z, pz))
        if size == 72:
            store3(normals, 3 * vertex, nx, ny, nz)
        tile += 1
    if full < last:
        x, y, z, nx, ny, nz = kept_tile(tile, size, sign, below, bend, state)
        put(vertices, full, last - full, add(x, px), add(y, py), add(z, pz), spare)
        if size == 72:
            put(normals, full, last - full, nx, ny, nz, spare)


@kernel
def apply_cells(
    cells, begin, end, points, origin, cell_start, tile_start, rows, room, at, ids_at, ids, value, slope, below,
    bend, state, kept, sign, vertices, normals, local, spare,
):  # fmt: skip
    """Compute ``cells[begin:end]`` from their control points; their numerators are no longer kept."""
    for q in range(begin, end):
        c = cells[q]
        kept[c] = -1
        gather(points, ids, ids_at[c], rows[c], origin, c, local)
        ox, oy, oz = np.float32(origin[c, 0]), np.float32(origin[c, 1]), np.float32(origin[c, 2])
        first, last = cell_start[c], cell_start[c + 1]
        if slope.shape[0] == 0:
            positions(
                first, last, rows[c], room[c], at[c], tile_start[c], value, below, local, ox, oy, oz, vertices,
                spare,
            )  # fmt: skip
        else:
            shaded(
                first, last, rows[c], room[c], at[c], tile_start[c], sign, value, slope, below, bend, local,
                ox, oy, oz, vertices, normals, spare,
            )  # fmt: skip


@kernel
def denominators(cells, cell_start, tile_start, rows, room, at, value, slope, below, bend):
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
                below[8 * tile + j] = 1.0 / w
                if slope.shape[0] > 0:
                    bend[16 * tile + j], bend[16 * tile + 8 + j] = wu, wv


@kernel
def ranges(touched, total, cell_start, gap, out):
    """Vertex ranges of rising cells, joined where fewer than ``gap`` vertices lie between; returns their number."""
    count = 0
    for q in range(total):
        start, stop = cell_start[touched[q]], cell_start[touched[q] + 1]
        if count > 0 and start - out[count - 1, 1] <= gap:
            out[count - 1, 1] = stop
        else:
            out[count, 0], out[count, 1] = start, stop
            count += 1
    return count
