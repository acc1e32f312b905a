"""Kernels that bring the cells of moved control points up to date, Eq. (2).

Names are those of :mod:`surface.deform.apply`.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel
from surface.spline.lanes import fma, load, store

from .apply import KEEP, apply_cells, finish_cell, gather, keep_sums, ranges


@inlined
def nudge(state, place, weights, number):
    """``state[place : place + 8] += weights * number``."""
    store(state, place, fma(weights, number, load(state, place)))


@inlined
def add_row(tiles, first_tile, place, step, dx, dy, dz, value, slope, state):
    """Eq. (2): add b w dP of one control point to the numerators of one cell's tiles."""
    size = 72 if slope.shape[0] > 0 else 24
    base = first_tile * size
    for _ in range(tiles):
        a = load(value, place)
        nudge(state, base, a, dx)
        nudge(state, base + 8, a, dy)
        nudge(state, base + 16, a, dz)
        if slope.shape[0] > 0:
            u, v = load(slope, 2 * place), load(slope, 2 * place + 8)
            nudge(state, base + 24, u, dx)
            nudge(state, base + 32, u, dy)
            nudge(state, base + 40, u, dz)
            nudge(state, base + 48, v, dx)
            nudge(state, base + 56, v, dy)
            nudge(state, base + 64, v, dz)
        place += step
        base += size


@kernel
def mark(ids, count, back_start, back_count, back_cell, hits, touched):
    """Cells reached by the first ``count`` of ``ids``: returns their number, fills ``touched``, counts ``hits``."""
    total = 0
    for q in range(count):
        i = ids[q]
        for e in range(back_start[i], back_start[i] + back_count[i]):
            c = back_cell[e]
            if hits[c] == 0:
                touched[total] = c
                total += 1
            hits[c] += 1
    touched[:total].sort()
    return total


@kernel
def choose(total, touched, hits, kept, rows, limit, bias, anew):
    """Per touched cell, take differences (``kept`` >= 0 counts them) or compute it anew (into ``anew``)."""
    count = 0
    for q in range(total):
        c = touched[q]
        few = bias * hits[c] < rows[c]
        if kept[c] >= 0 and kept[c] + hits[c] <= limit and few:
            kept[c] += hits[c]
        elif few:
            kept[c] = KEEP  # few points, perhaps again next time: compute anew and keep the numerators
        else:
            kept[c] = -1
            anew[count] = c
            count += 1
        hits[c] = 0
    return count


@kernel
def update(
    ids, count, delta, hits, touched, anew, limit, bias, back_start, back_count, back_cell, back_row, points, origin,
    cell_start, tile_start, rows, room, at, ids_at, ids_of, value, slope, below, bend, state, kept, sign, vertices,
    normals, local, spare,
):  # fmt: skip
    """Bring all cells that the moved points reach up to date; returns how many there are.

    Per cell the cheaper way is taken: differences cost one row each, computing anew costs all rows. A cell is
    also computed anew when it has not kept its numerators, or has taken more than ``limit`` differences.
    """
    total = mark(ids, count, back_start, back_count, back_cell, hits, touched)
    fresh = choose(total, touched, hits, kept, rows, limit, bias, anew)
    for q in range(count):
        i = ids[q]
        dx, dy, dz = np.float32(delta[q, 0]), np.float32(delta[q, 1]), np.float32(delta[q, 2])
        for e in range(back_start[i], back_start[i] + back_count[i]):
            c = back_cell[e]
            if kept[c] >= 0:
                tiles, place = tile_start[c + 1] - tile_start[c], at[c] + 8 * back_row[e]
                add_row(tiles, tile_start[c], place, room[c] * 8, dx, dy, dz, value, slope, state)
    for q in range(total):
        c = touched[q]
        if kept[c] == -1:
            continue
        if kept[c] == KEEP:
            gather(points, ids_of, ids_at[c], rows[c], origin, c, local)
            tiles = tile_start[c + 1] - tile_start[c]
            keep_sums(tiles, tile_start[c], rows[c], room[c], at[c], value, slope, local, state)
            kept[c] = 0
        ox, oy, oz = np.float32(origin[c, 0]), np.float32(origin[c, 1]), np.float32(origin[c, 2])
        first, last = cell_start[c], cell_start[c + 1]
        finish_cell(first, last, tile_start[c], ox, oy, oz, sign, below, bend, state, vertices, normals, spare)
    apply_cells(
        anew, np.int64(0), fresh, points, origin, cell_start, tile_start, rows, room, at, ids_at, ids_of, value, slope,
        below, bend, state, kept, sign, vertices, normals, local, spare,
    )  # fmt: skip
    return total


@kernel
def reject(ids, rows, n):
    """The first row with an id out of range (as ``-1 - row``) or a number that is not finite (``row``); else 2**62."""
    for q in range(ids.shape[0]):
        if ids[q] < 0 or ids[q] >= n:
            return -1 - q
    for q in range(ids.shape[0]):
        if not np.isfinite(rows[q, 0] + rows[q, 1] + rows[q, 2]):
            return q
    return 1 << 62


@kernel
def difference(ids, rows, relative, points, changed, delta):
    """Store new positions; ``changed`` and ``delta`` get the points that really moved; returns their number."""
    count = 0
    for q in range(ids.shape[0]):
        i = ids[q]
        dx, dy, dz = rows[q, 0], rows[q, 1], rows[q, 2]
        if not relative:
            dx, dy, dz = dx - points[i, 0], dy - points[i, 1], dz - points[i, 2]
        if dx == 0.0 and dy == 0.0 and dz == 0.0:
            continue
        changed[count] = i
        delta[count, 0], delta[count, 1], delta[count, 2] = dx, dy, dz
        if relative:
            points[i, 0] += dx
            points[i, 1] += dy
            points[i, 2] += dz
        else:
            points[i, 0], points[i, 1], points[i, 2] = rows[q, 0], rows[q, 1], rows[q, 2]
        count += 1
    return count


@kernel
def place(
    ids, rows, relative, changed, delta, hits, touched, anew, found, most, limit, bias, gap, back_start, back_count,
    back_cell, back_row, points, origin, cell_start, tile_start, in_cell, room, at, ids_at, ids_of, value, slope,
    below, bend, state, kept, sign, vertices, normals, local, spare,
):  # fmt: skip
    """Move points and bring the mesh up to date: the whole of an update in one call.

    ``rows (k, 3)`` are new positions, or moves if ``relative``. Returns the number of vertex ranges in ``found``; -1
    if more than ``most`` points moved and everything is to be computed anew; or what :func:`reject` found, less
    2**61, and then nothing has been changed.
    """
    bad = reject(ids, rows, points.shape[0])
    if bad != 1 << 62:
        return bad - (1 << 61)
    count = difference(ids, rows, relative, points, changed, delta)
    if count > most:
        return -1
    total = update(
        changed, count, delta, hits, touched, anew, limit, bias, back_start, back_count, back_cell, back_row,
        points, origin, cell_start, tile_start, in_cell, room, at, ids_at, ids_of, value, slope, below, bend,
        state, kept, sign, vertices, normals, local, spare,
    )  # fmt: skip
    return ranges(touched, total, cell_start, gap, found)
