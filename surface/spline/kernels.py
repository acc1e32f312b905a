"""Compiled kernels that evaluate a surface at samples, and find control points by their subdomains.

Consecutive samples are mostly close together and share control points and coordinates. So they are evaluated in runs,
and blending functions are computed once for each distinct coordinate of a run.

``knots`` is as in :mod:`surface.spline.blends`. ``side`` is a bit mask per sample: 1 takes the limit from the left in
u, 2 in v. ``grid``, ``shape``, ``start`` and ``ids`` are those of :class:`surface.spline.bins.Bins`.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel

from .blends import blend, blend1, blend2

TINY = 1e-290  # denominators below this count as "nothing covers"
RUN = 256  # maximum number of samples that are computed together, and of the bins and of the points they reach


@inlined
def bin_of(u, v, grid, shape):
    """Return the bin of (u, v), or -1 outside the grid; ``grid`` = (u0, v0, bins per u, bins per v, u1, v1)."""
    if not (grid[0] <= u <= grid[4] and grid[1] <= v <= grid[5]):
        return -1
    a = min(int((u - grid[0]) * grid[2]), shape[0] - 1)
    b = min(int((v - grid[1]) * grid[3]), shape[1] - 1)
    return a * shape[1] + b


@inlined
def bin_along(x, start, scale, count):
    """Return the bin of a coordinate along one direction; the first or last one outside the grid."""
    return max(0, min(int((x - start) * scale), count - 1))


@kernel
def fill_bins(knots_u, knots_v, grid, shape, start, ids, count_only):
    """Count, or write, the points whose closed support reaches each bin."""
    last_u, last_v = knots_u.shape[1] - 1, knots_v.shape[1] - 1
    for i in range(knots_u.shape[0]):
        a0 = bin_along(knots_u[i, 0], grid[0], grid[2], shape[0])
        a1 = bin_along(knots_u[i, last_u], grid[0], grid[2], shape[0])
        b0 = bin_along(knots_v[i, 0], grid[1], grid[3], shape[1])
        b1 = bin_along(knots_v[i, last_v], grid[1], grid[3], shape[1])
        for a in range(a0, a1 + 1):
            for b in range(b0, b1 + 1):
                cell = a * shape[1] + b
                if not count_only:
                    ids[start[cell]] = i
                start[cell] += 1


@kernel
def points_in(box, knots_u, knots_v, grid, shape, start, ids, out):
    """Write the points whose closed support meets ``box`` to ``out``, as far as it has room; return their number."""
    last_u, last_v = knots_u.shape[1] - 1, knots_v.shape[1] - 1
    a0, a1 = bin_along(box[0], grid[0], grid[2], shape[0]), bin_along(box[1], grid[0], grid[2], shape[0])
    b0, b1 = bin_along(box[2], grid[1], grid[3], shape[1]), bin_along(box[3], grid[1], grid[3], shape[1])
    count = 0
    for a in range(a0, a1 + 1):
        for b in range(b0, b1 + 1):
            for q in range(start[a * shape[1] + b], start[a * shape[1] + b + 1]):
                i = ids[q]
                if knots_u[i, 0] > box[1] or knots_u[i, last_u] < box[0]:
                    continue
                if knots_v[i, 0] > box[3] or knots_v[i, last_v] < box[2]:
                    continue
                # A point is in several bins; it counts in the first one that the box shares with it.
                if a != max(a0, bin_along(knots_u[i, 0], grid[0], grid[2], shape[0])):
                    continue
                if b != max(b0, bin_along(knots_v[i, 0], grid[1], grid[3], shape[1])):
                    continue
                if count < out.shape[0]:
                    out[count] = i
                count += 1
    return count


@kernel
def bounding_box(uv, low, high, box):
    """The rectangle (u0, u1, v0, v1) around ``uv[low:high]``, at least one sample."""
    box[0], box[1], box[2], box[3] = uv[low, 0], uv[low, 0], uv[low, 1], uv[low, 1]
    for s in range(low + 1, high):
        box[0], box[1] = min(box[0], uv[s, 0]), max(box[1], uv[s, 0])
        box[2], box[3] = min(box[2], uv[s, 1]), max(box[3], uv[s, 1])


@kernel
def points_near(uv, knots_u, knots_v, grid, shape, start, bins, out):
    """Write points whose support meets the rectangle around samples, ascending, into ``out``.

    Returns their number; -1 if a sample is outside the grid, or if more bins or points than ``RUN`` meet it.
    """
    box = np.zeros(4)
    bounding_box(uv, 0, uv.shape[0], box)
    if not (grid[0] <= box[0] and box[1] <= grid[4] and grid[1] <= box[2] and box[3] <= grid[5]):
        return -1
    wide = bin_along(box[1], grid[0], grid[2], shape[0]) - bin_along(box[0], grid[0], grid[2], shape[0]) + 1
    high = bin_along(box[3], grid[1], grid[3], shape[1]) - bin_along(box[2], grid[1], grid[3], shape[1]) + 1
    if wide * high > RUN:
        return -1
    count = points_in(box, knots_u, knots_v, grid, shape, start, bins, out)
    if count > out.shape[0]:
        return -1
    out[:count].sort()
    return count


@kernel
def distinct(uv, side, axis, values, index):
    """Write distinct coordinates (with the limit they take in ``values (k, 2)``) of samples; returns how many."""
    count = 0
    for s in range(uv.shape[0]):
        x, left = uv[s, axis], float(side[s] >> axis & 1)
        k = count - 1
        while k >= 0 and not (values[k, 0] == x and values[k, 1] == left):
            k -= 1
        if k < 0:
            k = count
            values[k, 0], values[k, 1] = x, left
            count += 1
        index[s] = k
    return count


@kernel
def blend_along(knots, i, p, values, count, slopes, work, out):
    """Write one blending function (and its slope) at distinct coordinates into ``out (k, 2)``; return whether any
    is nonzero."""
    found = False
    for k in range(count):
        if slopes:
            out[k, 0], out[k, 1] = blend1(knots, i, p, values[k, 0], values[k, 1] != 0.0, work)
        else:
            out[k, 0] = blend(knots, i, p, values[k, 0], values[k, 1] != 0.0, work)
        found |= out[k, 0] != 0.0 or out[k, 1] != 0.0
    return found


@inlined
def add_value(a, b, weight, point, acc):
    """Add b w (P, 1) of one point to ``acc (4,)``."""
    bw = a * b * weight
    acc[0] += bw * point[0]
    acc[1] += bw * point[1]
    acc[2] += bw * point[2]
    acc[3] += bw


@inlined
def add_slopes(a0, a1, b0, b1, weight, point, acc):
    """Add b w (P, 1) of one point and its first derivatives to ``acc (12,)``: S, u, v."""
    for c in range(4):
        value = weight if c == 3 else weight * point[c]
        acc[c] += a0 * b0 * value
        acc[4 + c] += a1 * b0 * value
        acc[8 + c] += a0 * b1 * value


@kernel
def sum_one(knots_u, knots_v, pu, pv, points, weights, ids, u, v, side, slopes, work, acc):
    """Sums of one sample over the listed points into ``acc (12,)``."""
    acc[:] = 0.0
    for q in range(ids.shape[0]):
        i = ids[q]
        if slopes:
            a0, a1 = blend1(knots_u, i, pu[i], u, side & 1, work)
            if a0 != 0.0 or a1 != 0.0:
                b0, b1 = blend1(knots_v, i, pv[i], v, side & 2, work)
                add_slopes(a0, a1, b0, b1, weights[i], points[i], acc)
            continue
        a0 = blend(knots_u, i, pu[i], u, side & 1, work)
        if a0 != 0.0:
            add_value(a0, blend(knots_v, i, pv[i], v, side & 2, work), weights[i], points[i], acc)


@kernel
def sum_run(knots_u, knots_v, pu, pv, points, weights, ids, uv, side, slopes, work, acc):
    """Sums of a run of samples over the listed points into ``acc (m, 12)``."""
    m = uv.shape[0]
    values_u, values_v = np.zeros((m, 2)), np.zeros((m, 2))
    index_u, index_v = np.zeros(m, np.int64), np.zeros(m, np.int64)
    many_u, many_v = distinct(uv, side, 0, values_u, index_u), distinct(uv, side, 1, values_v, index_v)
    along_u, along_v = np.zeros((m, 2)), np.zeros((m, 2))
    acc[:m] = 0.0
    for q in range(ids.shape[0]):
        i = ids[q]
        if not blend_along(knots_u, i, pu[i], values_u, many_u, slopes, work, along_u):
            continue
        if not blend_along(knots_v, i, pv[i], values_v, many_v, slopes, work, along_v):
            continue
        for s in range(m):
            a0, a1 = along_u[index_u[s], 0], along_u[index_u[s], 1]
            b0, b1 = along_v[index_v[s], 0], along_v[index_v[s], 1]
            if slopes and (a0 != 0.0 or a1 != 0.0) and (b0 != 0.0 or b1 != 0.0):
                add_slopes(a0, a1, b0, b1, weights[i], points[i], acc[s])
            elif not slopes and a0 != 0.0 and b0 != 0.0:
                add_value(a0, b0, weights[i], points[i], acc[s])


@kernel
def sum_samples(knots_u, knots_v, pu, pv, points, weights, grid, shape, start, bins, uv, side, slopes, work, acc):
    """Sums of up to ``RUN`` samples, together if they are close; uncovered ones again with other limits.

    ``side`` gets the limit that was taken, -1 where nothing covers.
    """
    ids = np.zeros(RUN, dtype=np.int32)
    count = points_near(uv, knots_u, knots_v, grid, shape, start, bins, ids)
    if count >= 0:
        sum_run(knots_u, knots_v, pu, pv, points, weights, ids[:count], uv, side, slopes, work, acc)
    for s in range(uv.shape[0]):
        if count >= 0 and acc[s, 3] > TINY:
            continue
        wanted, cell = side[s], bin_of(uv[s, 0], uv[s, 1], grid, shape)
        side[s] = -1
        if cell < 0:
            continue
        near = bins[start[cell] : start[cell + 1]]
        for extra in range(4):
            limit, total = wanted | extra, acc[s]
            sum_one(knots_u, knots_v, pu, pv, points, weights, near, uv[s, 0], uv[s, 1], limit, slopes, work, total)
            if total[3] > TINY:
                side[s] = limit
                break


@kernel
def sum_second_derivatives(knots_u, knots_v, pu, pv, points, weights, ids, u, v, side, work, acc):
    """Add the second derivatives of b w (P, 1) into ``acc (12,)``: uu, uv, vv."""
    acc[:] = 0.0
    for q in range(ids.shape[0]):
        i = ids[q]
        a0, a1, a2 = blend2(knots_u, i, pu[i], u, side & 1, work)
        if a0 == 0.0 and a1 == 0.0 and a2 == 0.0:
            continue
        b0, b1, b2 = blend2(knots_v, i, pv[i], v, side & 2, work)
        for c in range(4):
            value = weights[i] if c == 3 else weights[i] * points[i, c]
            acc[c] += a2 * b0 * value
            acc[4 + c] += a1 * b1 * value
            acc[8 + c] += a0 * b2 * value


@kernel
def quotient(acc, out):
    """S into ``out[0]``, and S_u and S_v into ``out[1:3]`` if there is room (quotient rule, NURBS Book 4.5)."""
    w, wu, wv = acc[3], acc[7], acc[11]
    for c in range(3):
        p = acc[c] / w
        out[0, c] = p
        if out.shape[0] > 1:
            out[1, c], out[2, c] = (acc[4 + c] - wu * p) / w, (acc[8 + c] - wv * p) / w


@kernel
def second_quotient(acc, second, out):
    """S_uu, S_uv and S_vv into ``out[3:]`` from ``out[:3]`` and the sums of :func:`sum_second_derivatives`."""
    w, wu, wv, wuu, wuv, wvv = acc[3], acc[7], acc[11], second[3], second[7], second[11]
    for c in range(3):
        p, du, dv = out[0, c], out[1, c], out[2, c]
        out[3, c] = (second[c] - 2.0 * wu * du - wuu * p) / w
        out[4, c] = (second[4 + c] - wu * dv - wv * du - wuv * p) / w
        out[5, c] = (second[8 + c] - 2.0 * wv * dv - wvv * p) / w


@kernel
def sample(knots_u, knots_v, pu, pv, points, weights, grid, shape, start, bins, uv, side, out):
    """Evaluate samples into ``out``, NaN where nothing covers; ``side`` gets the limit that was taken (-1: uncovered).

    ``out (m, 1, 3)`` is for S, ``(m, 3, 3)`` for S, S_u and S_v, ``(m, 6, 3)`` for S_uu, S_uv and S_vv as well.
    """
    work, acc, second, slopes = np.zeros(12), np.zeros((RUN, 12)), np.zeros(12), out.shape[1] > 1
    for first in range(0, uv.shape[0], RUN):
        part, sides = uv[first : first + RUN], side[first : first + RUN]
        sum_samples(
            knots_u, knots_v, pu, pv, points, weights, grid, shape, start, bins, part, sides, slopes, work, acc
        )  # fmt: skip
        for s in range(part.shape[0]):
            if sides[s] < 0:
                out[first + s, :, :] = np.nan
                continue
            quotient(acc[s], out[first + s])
            if out.shape[1] == 6:
                cell = bin_of(part[s, 0], part[s, 1], grid, shape)
                near = bins[start[cell] : start[cell + 1]]
                sum_second_derivatives(
                    knots_u, knots_v, pu, pv, points, weights, near, part[s, 0], part[s, 1], sides[s], work, second
                )  # fmt: skip
                second_quotient(acc[s], second, out[first + s])


@kernel
def row_capacity(grid, shape, start, uv):
    """Return the upper bound of the number of influences of all samples together."""
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
