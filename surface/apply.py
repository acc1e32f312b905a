"""Kernels that turn weights and control points into vertices and normals: Eq. (1) and Eq. (2) by cell.

``state`` is (tiles * 12 * 8,) float32. Per tile of eight vertices: the denominator and its derivatives in u and v,
then the x, y and z numerators of the position, of the derivative in u and of that in v. Numerators are those of
positions relative to the cell's origin, which keeps float32 sums exact to a small part of the cell's size.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from .jit import kernel
from .lanes import add, div, fma, load, mul, root, splat, store, store3, sub, zero

STATE = 96  # numbers per tile in ``state``


@kernel
def gather(points, ids, first, rows, origin, c, local):
    """Copy a cell's control points, relative to its origin, into ``local (>= rows, 3)`` float32."""
    for k in range(rows):
        i = ids[first + k]
        local[k, 0] = points[i, 0] - origin[c, 0]
        local[k, 1] = points[i, 1] - origin[c, 1]
        local[k, 2] = points[i, 2] - origin[c, 2]


@kernel
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


@kernel
def sum_slopes(slope, at, rows, local):
    """Six sums of one tile: numerators of the derivatives in u and in v."""
    ax, ay, az, bx, by, bz = zero(), zero(), zero(), zero(), zero(), zero()
    for k in range(rows):
        u, v = load(slope, at + 16 * k), load(slope, at + 16 * k + 8)
        ax, ay, az = fma(u, local[k, 0], ax), fma(u, local[k, 1], ay), fma(u, local[k, 2], az)
        bx, by, bz = fma(v, local[k, 0], bx), fma(v, local[k, 1], by), fma(v, local[k, 2], bz)
    return ax, ay, az, bx, by, bz


@kernel
def put(out, vertex, left, x, y, z, spare):
    """Write eight vertices of ``out (m * 3,)``, or only ``left`` where the cell ends before."""
    if left >= 8:
        store3(out, 3 * vertex, x, y, z)
        return
    store3(spare, 0, x, y, z)
    for j in range(3 * left):
        out[3 * vertex + j] = spare[j]


@kernel
def cross(ax, ay, az, bx, by, bz, sign):
    """Unit vectors along a x b, times ``sign``; zero where the product vanishes."""
    nx, ny = sub(mul(ay, bz), mul(az, by)), sub(mul(az, bx), mul(ax, bz))
    nz = sub(mul(ax, by), mul(ay, bx))
    square = add(add(mul(nx, nx), mul(ny, ny)), mul(nz, nz))
    scale = div(splat(sign), root(add(square, splat(np.float32(1e-30)))))
    return mul(nx, scale), mul(ny, scale), mul(nz, scale)


@kernel
def finish(state, tile, vertex, left, origin, c, sums, sign, vertices, normals, spare):
    """Vertices and normals of one tile from its sums; a normal is the direction of S_u x S_v (quotient rule)."""
    base = tile * STATE
    w = load(state, base)
    x, y, z = div(sums[0], w), div(sums[1], w), div(sums[2], w)
    ox, oy, oz = np.float32(origin[c, 0]), np.float32(origin[c, 1]), np.float32(origin[c, 2])
    put(vertices, vertex, left, add(x, splat(ox)), add(y, splat(oy)), add(z, splat(oz)), spare)
    if normals.shape[0] == 0:
        return
    wu, wv = load(state, base + 8), load(state, base + 16)
    ax, ay, az = sub(sums[3], mul(x, wu)), sub(sums[4], mul(y, wu)), sub(sums[5], mul(z, wu))
    bx, by, bz = sub(sums[6], mul(x, wv)), sub(sums[7], mul(y, wv)), sub(sums[8], mul(z, wv))
    nx, ny, nz = cross(ax, ay, az, bx, by, bz, sign)
    put(normals, vertex, left, nx, ny, nz, spare)


@kernel
def apply_cell(c, points, origin, lists, state, keep, sign, vertices, normals, local, spare):
    """Compute one cell from its control points; ``keep`` also stores the numerators for later differences."""
    cell_start, tile_start, rows, room, at, ids_at, ids, value, slope = lists
    k = rows[c]
    gather(points, ids, ids_at[c], k, origin, c, local)
    vertex, end = cell_start[c], cell_start[c + 1]
    place = at[c]
    for tile in range(tile_start[c], tile_start[c + 1]):
        x, y, z = sum_values(value, place, k, local)
        sums = (x, y, z, x, y, z, x, y, z)
        if slope.shape[0] > 0:
            sums = (x, y, z) + sum_slopes(slope, 2 * place, k, local)  # noqa: RUF005 - numba
        if keep:
            for j in range(9):
                store(state, tile * STATE + 24 + 8 * j, sums[j])
        finish(state, tile, vertex, end - vertex, origin, c, sums, sign, vertices, normals, spare)
        place += room[c] * 8
        vertex += 8


@kernel
def apply_cells(first, last, points, origin, lists, state, kept, sign, vertices, normals, local, spare):
    """Compute cells first..last from their control points; their numerators are no longer kept."""
    for c in range(first, last):
        kept[c] = -1
        apply_cell(c, points, origin, lists, state, False, sign, vertices, normals, local, spare)


@kernel
def finish_cell(c, origin, lists, state, sign, vertices, normals, spare):
    """Vertices and normals of one cell from its kept numerators."""
    cell_start, tile_start = lists[0], lists[1]
    vertex, end = cell_start[c], cell_start[c + 1]
    for tile in range(tile_start[c], tile_start[c + 1]):
        base = tile * STATE + 24
        sums = (
            load(state, base),
            load(state, base + 8),
            load(state, base + 16),
            load(state, base + 24),
            load(state, base + 32),
            load(state, base + 40),
            load(state, base + 48),
            load(state, base + 56),
            load(state, base + 64),
        )
        finish(state, tile, vertex, end - vertex, origin, c, sums, sign, vertices, normals, spare)
        vertex += 8


@kernel
def add_row(c, row, dx, dy, dz, lists, state):
    """Eq. (2): add b w dP of one control point to the numerators of one cell."""
    tile_start, room, at, value, slope = lists[1], lists[3], lists[4], lists[7], lists[8]
    place = at[c] + 8 * row
    for tile in range(tile_start[c], tile_start[c + 1]):
        base = tile * STATE + 24
        a = load(value, place)
        store(state, base, fma(a, dx, load(state, base)))
        store(state, base + 8, fma(a, dy, load(state, base + 8)))
        store(state, base + 16, fma(a, dz, load(state, base + 16)))
        if slope.shape[0] > 0:
            u, v = load(slope, 2 * place), load(slope, 2 * place + 8)
            store(state, base + 24, fma(u, dx, load(state, base + 24)))
            store(state, base + 32, fma(u, dy, load(state, base + 32)))
            store(state, base + 40, fma(u, dz, load(state, base + 40)))
            store(state, base + 48, fma(v, dx, load(state, base + 48)))
            store(state, base + 56, fma(v, dy, load(state, base + 56)))
            store(state, base + 64, fma(v, dz, load(state, base + 64)))
        place += room[c] * 8


@kernel
def mark(ids, count, back, hits, touched):
    """Cells reached by the first ``count`` of ``ids``: returns their number, fills ``touched``, counts ``hits``."""
    start, number, cell, _ = back
    total = 0
    for q in range(count):
        i = ids[q]
        for e in range(start[i], start[i] + number[i]):
            c = cell[e]
            if hits[c] == 0:
                touched[total] = c
                total += 1
            hits[c] += 1
    touched[:total].sort()
    return total


@kernel
def update(
    ids, count, delta, points, origin, lists, back, state, kept, sign, vertices, normals, local, spare, hits,
    touched, limit, bias,
):  # fmt: skip
    """Bring all cells that the moved points reach up to date; returns how many there are.

    Per cell the cheaper way is taken: differences cost one row each, computing anew costs all rows. A cell is
    also computed anew when it has not kept its numerators, or has taken more than ``limit`` differences.
    """
    total = mark(ids, count, back, hits, touched)
    for q in range(total):
        c = touched[q]
        fits = kept[c] >= 0 and kept[c] + hits[c] <= limit and bias * hits[c] < lists[2][c]
        if fits:
            kept[c] += hits[c]
        else:
            kept[c] = -1
    for q in range(count):
        i = ids[q]
        dx, dy, dz = np.float32(delta[q, 0]), np.float32(delta[q, 1]), np.float32(delta[q, 2])
        for e in range(back[0][i], back[0][i] + back[1][i]):
            if kept[back[2][e]] >= 0:
                add_row(back[2][e], back[3][e], dx, dy, dz, lists, state)
    for q in range(total):
        c = touched[q]
        if kept[c] >= 0:
            finish_cell(c, origin, lists, state, sign, vertices, normals, spare)
        else:
            few = bias * hits[c] < lists[2][c]  # a few points again next time: keep numerators for it
            kept[c] = 0 if few else -1
            apply_cell(c, points, origin, lists, state, few, sign, vertices, normals, local, spare)
        hits[c] = 0
    return total


@kernel
def difference(ids, xyz, points, changed, delta):
    """Store new positions; ``changed`` and ``delta`` get the points that really moved; returns their number."""
    count = 0
    for q in range(ids.shape[0]):
        i = ids[q]
        dx, dy, dz = xyz[q, 0] - points[i, 0], xyz[q, 1] - points[i, 1], xyz[q, 2] - points[i, 2]
        if dx == 0.0 and dy == 0.0 and dz == 0.0:
            continue
        changed[count] = i
        delta[count, 0], delta[count, 1], delta[count, 2] = dx, dy, dz
        points[i, 0], points[i, 1], points[i, 2] = xyz[q, 0], xyz[q, 1], xyz[q, 2]
        count += 1
    return count


@kernel
def denominators(cells, lists, state):
    """Sum the weights of the given cells; returns the first vertex that nothing covers, or -1."""
    cell_start, tile_start, rows, room, at, _, _, value, slope = lists
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
                vertex = cell_start[c] + 8 * t + j
                if vertex >= cell_start[c + 1]:
                    w = 1.0
                if w <= 0.0:
                    return vertex
                base = tile * STATE + j
                state[base], state[base + 8], state[base + 16] = w, wu, wv
    return -1


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
