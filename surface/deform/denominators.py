"""Compiled sums of the weights at every vertex, whichever way these are kept."""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.base.jit import inlined, kernel

from .binding import arrays_of
from .fixed import take
from .groupsums import HEAD, STEP, factor_counts

MIN_SUM = 1e-36  # of the weights at a vertex; smaller float32 numbers have fewer digits
MAX_SUM = 3e37  # of weights times distances: ten times that is still a float32, see :func:`farthest`


@inlined
def _sum_entries(value, slope, first, end, slopes, j):
    """Return sums of b w, b_u w and b_v w in lane j of the rows of eight from ``first`` to ``end``; the greatest of
    these sums without signs."""
    w, wu, wv, au, av = 0.0, 0.0, 0.0, 0.0, 0.0
    for e in range(first, end):
        w += value[8 * e + j]
        if slopes:
            u, v = slope[16 * e + j], slope[16 * e + 8 + j]
            wu, wv, au, av = wu + u, wv + v, au + abs(u), av + abs(v)
    return w, wu, wv, max(w, au, av)


@inlined
def _sum_packed(packed, slope, first, end, slopes, j):
    """Return the same sums of packed entries, as kernels read them."""
    w, wu, wv, au, av = 0.0, 0.0, 0.0, 0.0, 0.0
    for e in range(first, end):
        w += take(packed, e, j)
        if slopes:
            u, v = slope[16 * e + j], slope[16 * e + 8 + j]
            wu, wv, au, av = wu + u, wv + v, au + abs(u), av + abs(v)
    return w, wu, wv, max(w, au, av)


@inlined
def _sum_factors(rows, row, tile, wide_u, wide_v, factor_u, factor_v, factors, picks, slopes, j):
    """Return the same sums of a cell with factors, whose tile has its picks at ``tile``."""
    w, wu, wv, au, av = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(row, row + rows):
        at_u = factor_u[k] + picks[tile + 16] + picks[tile + j]
        at_v = factor_v[k] + picks[tile + 17] + picks[tile + 8 + j]
        w += factors[at_u] * factors[at_v]
        if slopes:
            u, v = factors[at_u + wide_u] * factors[at_v], factors[at_u] * factors[at_v + wide_v]
            wu, wv, au, av = wu + u, wv + v, au + abs(u), av + abs(v)
    return w, wu, wv, max(w, au, av)


@inlined
def _heaviest_group(rows, row, wide_u, factor_u, factor_v, factors, slopes):
    """Return the greatest sum of factors in u, without signs, of a group of points with the same factors in v."""
    most = 0.0
    for column in range(2 * wide_u if slopes else wide_u):
        total = 0.0
        for k in range(row, row + rows):
            if k == row or factor_v[k] != factor_v[k - 1]:
                total = 0.0
            total += abs(factors[factor_u[k] + column])
            most = max(most, total)
    return most


@kernel
def denominators(table, cells):
    """Sum the weights of the given cells; ``heavy`` gets the greatest sum of weights, or of their derivatives without
    signs, that is multiplied by places in each cell."""
    arrays = arrays_of(table)
    cell_start, tile_start, rows, room, at, _, _, value, slope = arrays[:9]
    inv_w, dw = arrays[15:17]
    rows_at, picks_at, factor_u, factor_v, factors, picks = arrays[33:39]
    packed_at, tile_entry, _, packed, packed_slope = arrays[39:44]
    heavy, power = arrays[49], arrays[51]
    slopes = dw.shape[0] > 0
    for q in range(cells.shape[0]):
        c = cells[q]
        wide_u, wide_v = factor_counts(rows_at[c], picks_at[c], picks)
        heavy[c] = 0.0
        if rows_at[c] >= 0:
            heavy[c] = _heaviest_group(rows[c], rows_at[c], wide_u, factor_u, factor_v, factors, slopes)
        for lane in range(8 * tile_start[c], 8 * tile_start[c + 1]):
            t, j, least = lane // 8 - tile_start[c], lane % 8, MIN_SUM
            if rows_at[c] >= 0:
                pick_at = picks_at[c] + HEAD + STEP * t
                w, wu, wv, most = _sum_factors(
                    rows[c], rows_at[c], pick_at, wide_u, wide_v, factor_u, factor_v, factors, picks, slopes, j
                )
            elif packed_at[c] >= 0:
                first, end = tile_entry[packed_at[c] + t], tile_entry[packed_at[c] + t + 1]
                w, wu, wv, most = _sum_packed(packed, packed_slope, first, end, slopes, j)
                least = MIN_SUM * 2.0 ** -np.int64(power[8 * (packed_at[c] + t) + j])
            else:
                first = at[c] // 8 + t * room[c]
                w, wu, wv, most = _sum_entries(value, slope, first, first + rows[c], slopes, j)
            if cell_start[c] + lane - 8 * tile_start[c] >= cell_start[c + 1]:
                w = 1.0  # lanes that fill up the last tile
            heavy[c] = max(heavy[c], most)
            inv_w[lane] = 1.0 / w if w >= least else np.inf
            if slopes:
                dw[16 * (lane // 8) + j], dw[16 * (lane // 8) + 8 + j] = wu, wv


@kernel
def first_unusable(cells, cell_start, tile_start, inv_w, dw, order_at, order):
    """Return the first vertex of ``cells`` whose weights add up to less than ``MIN_SUM`` or to so much that one over
    it is 0 in float32, or whose derivative weights do; -1 if there is none."""
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
                at = order_at[c] + vertex - cell_start[c]
                return vertex if order_at[c] < 0 else cell_start[c] + np.int64(order[at])
    return -1


def farthest(heavy: Floats) -> float:
    """Return the greatest coordinate with which no sum of weights times places leaves the range of float32.

    ``heavy (c,)`` are the greatest sums of weights. Places are relative to origins that lie at most five times as far
    away (see :mod:`.updates`), and for normals one such sum is subtracted from another.
    """
    return MAX_SUM / max(1.0, float(heavy.max(initial=0.0)))
