"""Compiled kernels that evaluate blending functions: single values, samples of a surface, weights by cell.

Every kernel that calls :func:`blend` lives in this file; see :mod:`surface.jit`.

Layout: ``knots`` is ``(n, w)`` float64, row i holds the ``degree[i] + 2`` knots of point i and repeats the
last one up to the width ``w``. ``side`` is a bit mask per sample: 1 takes the limit from the left in u, 2 in
v. Bins (``bin_start``, ``bin_ids``) list, per cell of a regular grid over (u, v), the points that reach it.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from .jit import inlined, kernel

TINY = 1e-290  # denominators below this count as "nothing covers"


@inlined
def span(knots, i, p, x, left):
    """Index j of the knot interval that holds x, [t_j, t_j+1), or (t_j, t_j+1] from the left; -1 if none."""
    if left:
        if not (knots[i, 0] < x <= knots[i, p + 1]):
            return -1
        j = 0
        while knots[i, j + 1] < x:
            j += 1
        return j
    if not (knots[i, 0] <= x < knots[i, p + 1]):
        return -1
    j = p
    while knots[i, j] > x:
        j -= 1
    return j


@inlined
def ratio(a, b):
    """a / b with 0 for b = 0, the convention for repeated knots (Piegl and Tiller, The NURBS Book, 2.2)."""
    return a / b if b > 0.0 else 0.0


@kernel
def climb(knots, i, p, x, j, top, work):
    """Fill ``work[0 .. p - top]`` with point i's blending functions of degree ``top`` (Cox-de Boor)."""
    for k in range(p + 2):
        work[k] = 0.0
    work[j] = 1.0
    for k in range(1, top + 1):
        for a in range(max(0, j - k), min(p - k, j) + 1):
            value = 0.0
            if work[a] != 0.0:
                value = ratio(x - knots[i, a], knots[i, a + k] - knots[i, a]) * work[a]
            if work[a + 1] != 0.0:
                value += ratio(knots[i, a + k + 1] - x, knots[i, a + k + 1] - knots[i, a + 1]) * work[a + 1]
            work[a] = value


@inlined
def cubic(knots, i, x, j):
    """Value and first derivative for degree 3 in knot interval j, written out: most surfaces are cubic."""
    t0, t1, t2, t3, t4 = knots[i, 0], knots[i, 1], knots[i, 2], knots[i, 3], knots[i, 4]
    low, high = 0.0, 0.0  # the two functions of degree 2
    if j == 0:
        low = (x - t0) * (x - t0) / ((t2 - t0) * (t1 - t0))
    elif j == 1:
        low = ((x - t0) * (t2 - x) / (t2 - t0) + (t3 - x) * (x - t1) / (t3 - t1)) / (t2 - t1)
        high = (x - t1) * (x - t1) / ((t3 - t1) * (t2 - t1))
    elif j == 2:
        low = (t3 - x) * (t3 - x) / ((t3 - t1) * (t3 - t2))
        high = ((x - t1) * (t3 - x) / (t3 - t1) + (t4 - x) * (x - t2) / (t4 - t2)) / (t3 - t2)
    else:
        high = (t4 - x) * (t4 - x) / ((t4 - t2) * (t4 - t3))
    low, high = ratio(low, t3 - t0), ratio(high, t4 - t1)
    return (x - t0) * low + (t4 - x) * high, 3.0 * (low - high)


@kernel
def blend(knots, i, p, x, left, work):
    """Value of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0
    if p == 3:
        return cubic(knots, i, x, j)[0]
    climb(knots, i, p, x, j, p, work)
    return work[0]


@kernel
def blend1(knots, i, p, x, left, work):
    """Value and first derivative of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0, 0.0
    if p == 3:
        return cubic(knots, i, x, j)
    if p == 0:
        return 1.0, 0.0
    climb(knots, i, p, x, j, p - 1, work)
    low = ratio(work[0], knots[i, p] - knots[i, 0])
    high = ratio(work[1], knots[i, p + 1] - knots[i, 1])
    return (x - knots[i, 0]) * low + (knots[i, p + 1] - x) * high, p * (low - high)


@kernel
def blend2(knots, i, p, x, left, work):
    """Value, first and second derivative of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0, 0.0, 0.0
    if p < 2:
        value, slope = blend1(knots, i, p, x, left, work)
        return value, slope, 0.0
    climb(knots, i, p, x, j, p - 2, work)
    t0, t1, t2 = knots[i, 0], knots[i, 1], knots[i, 2]
    s0, s1, s2 = knots[i, p - 1], knots[i, p], knots[i, p + 1]
    a, b, c = ratio(work[0], s0 - t0), ratio(work[1], s1 - t1), ratio(work[2], s2 - t2)
    low = ratio((x - t0) * a + (s1 - x) * b, s1 - t0)
    high = ratio((x - t1) * b + (s2 - x) * c, s2 - t1)
    bend = ratio((p - 1) * (a - b), s1 - t0) - ratio((p - 1) * (b - c), s2 - t1)
    return (x - t0) * low + (s2 - x) * high, p * (low - high), p * bend


@kernel
def blend_samples(knots, p, x, left, out):
    """``out[s] = (value, first, second derivative)`` of one blending function at ``x[s]``."""
    work = np.zeros(12)
    for s in range(x.shape[0]):
        out[s, 0], out[s, 1], out[s, 2] = blend2(knots, 0, p, x[s], left, work)


@inlined
def bin_of(u, v, grid, shape):
    """Bin of (u, v), or -1 outside the grid; ``grid`` = (u0, v0, bins per u, bins per v, u1, v1)."""
    if not (grid[0] <= u <= grid[4] and grid[1] <= v <= grid[5]):
        return -1
    a = min(int((u - grid[0]) * grid[2]), shape[0] - 1)
    b = min(int((v - grid[1]) * grid[3]), shape[1] - 1)
    return a * shape[1] + b


@kernel
def fill_bins(knots_u, knots_v, grid, shape, start, ids, count_only):
    """Count, or write, the points whose closed support reaches each bin."""
    last_u, last_v = knots_u.shape[1] - 1, knots_v.shape[1] - 1
    for i in range(knots_u.shape[0]):
        a0 = min(int((knots_u[i, 0] - grid[0]) * grid[2]), shape[0] - 1)
        a1 = min(int((knots_u[i, last_u] - grid[0]) * grid[2]), shape[0] - 1)
        b0 = min(int((knots_v[i, 0] - grid[1]) * grid[3]), shape[1] - 1)
        b1 = min(int((knots_v[i, last_v] - grid[1]) * grid[3]), shape[1] - 1)
        for a in range(a0, a1 + 1):
            for b in range(b0, b1 + 1):
                cell = a * shape[1] + b
                if not count_only:
                    ids[start[cell]] = i
                start[cell] += 1


@kernel
def sum_numerators(knots_u, knots_v, pu, pv, points, weights, ids, u, v, side, work, acc):
    """Add b w P and b w of the listed points into ``acc[0:4]``."""
    acc[:4] = 0.0
    for q in range(ids.shape[0]):
        i = ids[q]
        bu = blend(knots_u, i, pu[i], u, side & 1, work)
        if bu == 0.0:
            continue
        bw = bu * blend(knots_v, i, pv[i], v, side & 2, work) * weights[i]
        acc[0] += bw * points[i, 0]
        acc[1] += bw * points[i, 1]
        acc[2] += bw * points[i, 2]
        acc[3] += bw


@kernel
def sample(knots_u, knots_v, pu, pv, points, weights, grid, shape, start, bins, uv, side, out):
    """Write S into ``out`` (NaN where nothing covers) and the side used into ``side`` (-1: uncovered)."""
    work, acc = np.zeros(12), np.zeros(4)
    for s in range(uv.shape[0]):
        u, v, wanted = uv[s, 0], uv[s, 1], side[s]
        cell = bin_of(u, v, grid, shape)
        out[s, :] = np.nan
        side[s] = -1
        if cell < 0:
            continue
        ids = bins[start[cell] : start[cell + 1]]
        for extra in range(4):
            sum_numerators(knots_u, knots_v, pu, pv, points, weights, ids, u, v, wanted | extra, work, acc)
            if acc[3] > TINY:
                side[s] = wanted | extra
                for c in range(3):
                    out[s, c] = acc[c] / acc[3]
                break


@kernel
def sum_slopes(knots_u, knots_v, pu, pv, points, weights, ids, u, v, side, work, acc):
    """Add b w (P, 1) and its first derivatives into ``acc (6, 4)``: rows S, u, v."""
    acc[:, :] = 0.0
    for q in range(ids.shape[0]):
        i = ids[q]
        a0, a1 = blend1(knots_u, i, pu[i], u, side & 1, work)
        if a0 == 0.0 and a1 == 0.0:
            continue
        b0, b1 = blend1(knots_v, i, pv[i], v, side & 2, work)
        for c in range(4):
            value = weights[i] if c == 3 else weights[i] * points[i, c]
            acc[0, c] += a0 * b0 * value
            acc[1, c] += a1 * b0 * value
            acc[2, c] += a0 * b1 * value


@kernel
def sum_bends(knots_u, knots_v, pu, pv, points, weights, ids, u, v, side, work, acc):
    """Add the second derivatives of b w (P, 1) into ``acc (6, 4)``: rows uu, uv, vv from the fourth on."""
    for q in range(ids.shape[0]):
        i = ids[q]
        a0, a1, a2 = blend2(knots_u, i, pu[i], u, side & 1, work)
        if a0 == 0.0 and a1 == 0.0 and a2 == 0.0:
            continue
        b0, b1, b2 = blend2(knots_v, i, pv[i], v, side & 2, work)
        for c in range(4):
            value = weights[i] if c == 3 else weights[i] * points[i, c]
            acc[3, c] += a2 * b0 * value
            acc[4, c] += a1 * b1 * value
            acc[5, c] += a0 * b2 * value


@kernel
def quotient(acc, out, second):
    """S, S_u, S_v, and S_uu, S_uv, S_vv if ``second``, into ``out (3 or 6, 3)`` (quotient rule, NURBS Book 4.5)."""
    w, wu, wv, wuu, wuv, wvv = acc[0, 3], acc[1, 3], acc[2, 3], acc[3, 3], acc[4, 3], acc[5, 3]
    for c in range(3):
        p = acc[0, c] / w
        du = (acc[1, c] - wu * p) / w
        dv = (acc[2, c] - wv * p) / w
        out[0, c], out[1, c], out[2, c] = p, du, dv
        if second:
            out[3, c] = (acc[3, c] - 2.0 * wu * du - wuu * p) / w
            out[4, c] = (acc[4, c] - wu * dv - wv * du - wuv * p) / w
            out[5, c] = (acc[5, c] - 2.0 * wv * dv - wvv * p) / w


@kernel
def sample_derivatives(knots_u, knots_v, pu, pv, points, weights, grid, shape, start, bins, uv, side, out):
    """As :func:`sample`, with derivatives: ``out (m, 3, 3)`` for S, S_u, S_v, ``(m, 6, 3)`` for second ones too."""
    work, acc = np.zeros(12), np.zeros((6, 4))
    second = out.shape[1] == 6
    for s in range(uv.shape[0]):
        u, v, wanted = uv[s, 0], uv[s, 1], side[s]
        cell = bin_of(u, v, grid, shape)
        out[s, :, :] = np.nan
        side[s] = -1
        if cell < 0:
            continue
        ids = bins[start[cell] : start[cell + 1]]
        for extra in range(4):
            limit = wanted | extra
            sum_slopes(knots_u, knots_v, pu, pv, points, weights, ids, u, v, limit, work, acc)
            if acc[0, 3] > TINY:
                if second:
                    sum_bends(knots_u, knots_v, pu, pv, points, weights, ids, u, v, limit, work, acc)
                side[s] = limit
                quotient(acc, out[s], second)
                break


@kernel
def row_capacity(grid, shape, start, uv):
    """Upper bound of the number of influences of all samples together."""
    total = 0
    for s in range(uv.shape[0]):
        cell = bin_of(uv[s, 0], uv[s, 1], grid, shape)
        if cell >= 0:
            total += start[cell + 1] - start[cell]
    return total


@kernel
def fill_rows(knots_u, knots_v, pu, pv, weights, grid, shape, start, bins, uv, side, data, columns, row_start):
    """Write b w and its two derivatives ``data (k, 3)`` row by row; returns the number of entries."""
    work, top = np.zeros(12), 0
    for s in range(uv.shape[0]):
        row_start[s] = top
        if side[s] < 0:
            continue
        u, v = uv[s, 0], uv[s, 1]
        cell = bin_of(u, v, grid, shape)
        for q in range(start[cell], start[cell + 1]):
            i = bins[q]
            a0, a1 = blend1(knots_u, i, pu[i], u, side[s] & 1, work)
            if a0 == 0.0 and a1 == 0.0:
                continue
            b0, b1 = blend1(knots_v, i, pv[i], v, side[s] & 2, work)
            if b0 == 0.0 and b1 == 0.0:
                continue
            data[top, 0] = a0 * b0 * weights[i]
            data[top, 1] = a1 * b0 * weights[i]
            data[top, 2] = a0 * b1 * weights[i]
            columns[top] = i
            top += 1
    row_start[uv.shape[0]] = top
    return top


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
def _distinct(uv, side, axis, first, last, values, index):
    """Distinct coordinates (with the limit they take in ``values (k, 2)``) of vertices; returns how many."""
    count = 0
    for s in range(first, last):
        x, left = uv[s, axis], float(side[s] >> axis & 1)
        k = count - 1
        while k >= 0 and not (values[k, 0] == x and values[k, 1] == left):
            k -= 1
        if k < 0:
            k = count
            values[k, 0], values[k, 1] = x, left
            count += 1
        index[s - first] = k
    return count


@kernel
def _along(knots, i, p, values, count, work, out):
    """Value and slope of one blending function at distinct coordinates into ``out (k, 2)``; any nonzero?"""
    found = False
    for k in range(count):
        out[k, 0], out[k, 1] = blend1(knots, i, p, values[k, 0], values[k, 1] != 0.0, work)
        found |= out[k, 0] != 0.0 or out[k, 1] != 0.0
    return found


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
    knots_u, knots_v, pu, pv, weights, uv, side, cell_start, list_start, list_ids, value, slope, at, rows, ids, ids_at
):
    """Weights of all cells, block after block, without rows that are all zero; layout in :mod:`surface.lists`.

    The vertices of a cell share most of their coordinates, so blending functions are computed once for each.
    """
    work, most, widest = np.zeros(12), 0, 0
    for c in range(cell_start.shape[0] - 1):
        most = max(most, list_start[c + 1] - list_start[c])
        widest = max(widest, (cell_start[c + 1] - cell_start[c] + 7) // 8 * 8)
    numbers = np.zeros((most, 3, widest))
    at_u, at_v = np.zeros(widest, dtype=np.int64), np.zeros(widest, dtype=np.int64)
    values_u, values_v = np.zeros((widest, 2)), np.zeros((widest, 2))
    along_u, along_v = np.zeros((widest, 2)), np.zeros((widest, 2))
    for c in range(cell_start.shape[0] - 1):
        first, size = cell_start[c], cell_start[c + 1] - cell_start[c]
        many_u = _distinct(uv, side, 0, first, first + size, values_u, at_u)
        many_v = _distinct(uv, side, 1, first, first + size, values_v, at_v)
        count, tiles = 0, (size + 7) // 8
        for q in range(list_start[c], list_start[c + 1]):
            i = list_ids[q]
            if not _along(knots_u, i, pu[i], values_u, many_u, work, along_u):
                continue
            if not _along(knots_v, i, pv[i], values_v, many_v, work, along_v):
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
