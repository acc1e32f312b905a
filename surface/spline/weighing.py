"""Compiled kernels that compute the weights of control points by cell.

Their layout is in :mod:`surface.deform.lists`.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.jit import kernel

from .blends import blend1
from .kernels import along, distinct


@kernel
def _weigh(knots_u, knots_v, pu, pv, weights, i, uv, side, first, last, work, out):
    """b w and its derivatives of point i at vertices first..last into ``out (3, >= last - first)``; any nonzero?"""
    found = False
    for s in range(first, last):
        j = s - first
        out[0, j], out[1, j], out[2, j] = 0.0, 0.0, 0.0
        a0, a1 = blend1(knots_u, i, pu[i], uv[s, 0], side[s] & 1, work)
        if a0 == 0.0 and a1 == 0.0:
            continue
        b0, b1 = blend1(knots_v, i, pv[i], uv[s, 1], side[s] & 2, work)
        if b0 == 0.0 and b1 == 0.0:
            continue
        out[0, j], out[1, j], out[2, j] = a0 * b0 * weights[i], a1 * b0 * weights[i], a0 * b1 * weights[i]
        found = True
    return found


@kernel
def _put_row(value, slope, at, rows, row, tiles, numbers):
    """Write one point's numbers ``(3, m)`` into a block of ``tiles`` tiles of ``rows`` rows of 8 lanes."""
    for t in range(tiles):
        for j in range(8):
            place = (t * rows + row) * 8
            value[at + place + j] = numbers[0, 8 * t + j]
            if slope.shape[0] > 0:
                slope[2 * (at + place) + j] = numbers[1, 8 * t + j]
                slope[2 * (at + place) + 8 + j] = numbers[2, 8 * t + j]


@kernel
def _combine(along_u, along_v, at_u, at_v, count, weight, out):
    """b w and its derivatives of one point at a cell's vertices into ``out (3, count)``; any nonzero?"""
    found = False
    for j in range(count):
        a0, a1 = along_u[at_u[j], 0] * weight, along_u[at_u[j], 1] * weight
        b0, b1 = along_v[at_v[j], 0], along_v[at_v[j], 1]
        out[0, j], out[1, j], out[2, j] = a0 * b0, a1 * b0, a0 * b1
        found |= (a0 != 0.0 or a1 != 0.0) and (b0 != 0.0 or b1 != 0.0)
    return found


@kernel
def fill_blocks(
    knots_u, knots_v, pu, pv, weights, uv, side, cell_start, list_start, list_ids, begin, end, value, slope, at, rows,
    ids, ids_at,
):  # fmt: skip
    """Weights of cells ``begin`` to ``end``, block after block, without rows that are all zero.

    The vertices of a cell share most of their coordinates, so blending functions are computed once for each.
    """
    work, most, widest = np.zeros(12), 0, 0
    for c in range(begin, end):
        most = max(most, list_start[c + 1] - list_start[c])
        widest = max(widest, (cell_start[c + 1] - cell_start[c] + 7) // 8 * 8)
    numbers = np.zeros((most, 3, widest))
    at_u, at_v = np.zeros(widest, dtype=np.int64), np.zeros(widest, dtype=np.int64)
    values_u, values_v = np.zeros((widest, 2)), np.zeros((widest, 2))
    along_u, along_v = np.zeros((widest, 2)), np.zeros((widest, 2))
    for c in range(begin, end):
        first, size = cell_start[c], cell_start[c + 1] - cell_start[c]
        own, sides = uv[first : first + size], side[first : first + size]
        many_u, many_v = distinct(own, sides, 0, values_u, at_u), distinct(own, sides, 1, values_v, at_v)
        count, tiles = 0, (size + 7) // 8
        for q in range(list_start[c], list_start[c + 1]):
            i = list_ids[q]
            if not along(knots_u, i, pu[i], values_u, many_u, True, work, along_u):
                continue
            if not along(knots_v, i, pv[i], values_v, many_v, True, work, along_v):
                continue
            if _combine(along_u, along_v, at_u, at_v, size, weights[i], numbers[count]):
                ids[ids_at[c] + count] = i
                count += 1
        for row in range(count):
            numbers[row, :, size:] = 0.0
            _put_row(value, slope, at[c], count, row, tiles, numbers[row])
        rows[c] = count
        at[c + 1] = at[c] + count * tiles * 8
        ids_at[c + 1] = ids_at[c] + count


@kernel
def rewrite_rows(
    knots_u, knots_v, pu, pv, weights, uv, side, cell_start, i, cells, places, value, slope, at, rows, nonzero
):
    """Compute the rows ``places`` of point i in ``cells`` anew; ``nonzero`` says which rows are not all zero."""
    work = np.zeros(12)
    for q in range(cells.shape[0]):
        c = cells[q]
        first, last = cell_start[c], cell_start[c + 1]
        tiles = (last - first + 7) // 8
        numbers = np.zeros((3, tiles * 8))
        nonzero[q] = _weigh(knots_u, knots_v, pu, pv, weights, i, uv, side, first, last, work, numbers)
        if places[q] >= 0:
            _put_row(value, slope, at[c], rows[c], places[q], tiles, numbers)
