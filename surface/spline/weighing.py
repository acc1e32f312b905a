"""Compiled kernels that compute the weights b w of control points at vertices, cell by cell.

Their layout is in :mod:`surface.deform.lists`.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.jit import kernel

from .kernels import blend_along, distinct

INSIDE = 1e-9  # of a subdomain's width: a function of degree 9 is greater than 1e-90 there


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
    """Write b w and its derivatives of one point at a cell's vertices into ``out (3, count)``; return whether any is
    nonzero."""
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
        cell_uv, sides = uv[first : first + size], side[first : first + size]
        many_u, many_v = distinct(cell_uv, sides, 0, values_u, at_u), distinct(cell_uv, sides, 1, values_v, at_v)
        count, tiles = 0, (size + 7) // 8
        for q in range(list_start[c], list_start[c + 1]):
            i = list_ids[q]
            if not blend_along(knots_u, i, pu[i], values_u, many_u, True, work, along_u):
                continue
            if not blend_along(knots_v, i, pv[i], values_v, many_v, True, work, along_v):
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
def _is_well_inside(knots, i, x):
    """Whether ``x`` lies so far inside the knots of point i that its blending function cannot vanish there, not even
    by rounding."""
    low, high = knots[i, 0], knots[i, knots.shape[1] - 1]
    margin = INSIDE * (high - low)
    return x > low + margin and x < high - margin


@kernel
def _surely_reaches(knots_u, knots_v, i, uv):
    """Whether one of the places ``uv (m, 2)`` lies well inside the subdomain of point i."""
    j = 0
    while j < uv.shape[0] and not (_is_well_inside(knots_u, i, uv[j, 0]) and _is_well_inside(knots_v, i, uv[j, 1])):
        j += 1
    return j < uv.shape[0]


@kernel
def mark_reaching(knots_u, knots_v, pu, pv, uv, side, cell_start, list_start, list_ids, reach):
    """Say in ``reach (k,)`` which listed points have a weight, or a derivative of one, at a vertex of their cell.

    Blending functions are computed only for points whose subdomain has no vertex well inside.
    """
    work, widest = np.zeros(12), 1
    for c in range(cell_start.shape[0] - 1):
        widest = max(widest, cell_start[c + 1] - cell_start[c])
    at_u, at_v = np.zeros(widest, dtype=np.int64), np.zeros(widest, dtype=np.int64)
    values_u, values_v = np.zeros((widest, 2)), np.zeros((widest, 2))
    along_u, along_v, numbers = np.zeros((widest, 2)), np.zeros((widest, 2)), np.zeros((3, widest))
    for c in range(cell_start.shape[0] - 1):
        first, size = cell_start[c], cell_start[c + 1] - cell_start[c]
        cell_uv, sides = uv[first : first + size], side[first : first + size]
        many_u, many_v = 0, 0
        for q in range(list_start[c], list_start[c + 1]):
            i = list_ids[q]
            reach[q] = _surely_reaches(knots_u, knots_v, i, cell_uv)
            if reach[q]:
                continue
            if many_u == 0:
                many_u = distinct(cell_uv, sides, 0, values_u, at_u)
                many_v = distinct(cell_uv, sides, 1, values_v, at_v)
            found = blend_along(knots_u, i, pu[i], values_u, many_u, True, work, along_u)
            found = found and blend_along(knots_v, i, pv[i], values_v, many_v, True, work, along_v)
            reach[q] = found and _combine(along_u, along_v, at_u, at_v, size, 1.0, numbers)


@kernel
def rewrite_rows(
    knots_u, knots_v, pu, pv, weights, uv, side, cell_start, i, cells, places, value, slope, at, rows, nonzero
):
    """Compute the rows ``places`` of point i in ``cells`` again; ``nonzero`` says which rows are not all zero."""
    work = np.zeros(12)
    for q in range(cells.shape[0]):
        c = cells[q]
        first, size = cell_start[c], cell_start[c + 1] - cell_start[c]
        tiles = (size + 7) // 8
        at_u, at_v = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
        along_u, along_v, values = np.zeros((size, 2)), np.zeros((size, 2)), np.zeros((size, 2))
        numbers, cell_uv, sides = np.zeros((3, tiles * 8)), uv[first : first + size], side[first : first + size]
        many = distinct(cell_uv, sides, 0, values, at_u)
        found = blend_along(knots_u, i, pu[i], values, many, True, work, along_u)
        many = distinct(cell_uv, sides, 1, values, at_v)
        found = blend_along(knots_v, i, pv[i], values, many, True, work, along_v) and found
        nonzero[q] = found and _combine(along_u, along_v, at_u, at_v, size, weights[i], numbers)
        if places[q] >= 0:
            _put_row(value, slope, at[c], rows[c], places[q], tiles, numbers)
