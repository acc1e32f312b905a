"""Compiled blending functions: value and derivatives of one control point in one direction.

``knots`` is ``(n, w)`` float64, row i holds the ``degree[i] + 2`` knots of point i and repeats the last one up to the
width ``w``. ``left`` asks for the limit from the left, ``work`` is scratch of 12 float64.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel


@inlined
def span(knots, i, p, x, left):
    """Return the index j of the knot interval that holds x, [t_j, t_j+1), or (t_j, t_j+1] from the left; -1 if none."""
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
    """Return a / b with 0 for b = 0, the convention for repeated knots (Piegl and Tiller, The NURBS Book, 2.2)."""
    return a / b if b > 0.0 else 0.0


@kernel
def cox_de_boor(knots, i, p, x, j, top, work):
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
    """Return the value and first derivative for degree 3 in knot interval j, written out: most surfaces are cubic."""
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
    """Return the value of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0
    if p == 3:
        return cubic(knots, i, x, j)[0]
    cox_de_boor(knots, i, p, x, j, p, work)
    return work[0]


@kernel
def blend1(knots, i, p, x, left, work):
    """Return the value and first derivative of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0, 0.0
    if p == 3:
        return cubic(knots, i, x, j)
    if p == 0:
        return 1.0, 0.0
    cox_de_boor(knots, i, p, x, j, p - 1, work)
    low = ratio(work[0], knots[i, p] - knots[i, 0])
    high = ratio(work[1], knots[i, p + 1] - knots[i, 1])
    return (x - knots[i, 0]) * low + (knots[i, p + 1] - x) * high, p * (low - high)


@kernel
def blend2(knots, i, p, x, left, work):
    """Return the value, first and second derivative of point i's blending function at x."""
    j = span(knots, i, p, x, left)
    if j < 0:
        return 0.0, 0.0, 0.0
    if p < 2:
        value, slope = blend1(knots, i, p, x, left, work)
        return value, slope, 0.0
    cox_de_boor(knots, i, p, x, j, p - 2, work)
    t0, t1, t2 = knots[i, 0], knots[i, 1], knots[i, 2]
    s0, s1, s2 = knots[i, p - 1], knots[i, p], knots[i, p + 1]
    a, b, c = ratio(work[0], s0 - t0), ratio(work[1], s1 - t1), ratio(work[2], s2 - t2)
    low = ratio((x - t0) * a + (s1 - x) * b, s1 - t0)
    high = ratio((x - t1) * b + (s2 - x) * c, s2 - t1)
    second = ratio((p - 1) * (a - b), s1 - t0) - ratio((p - 1) * (b - c), s2 - t1)
    return (x - t0) * low + (s2 - x) * high, p * (low - high), p * second


@kernel
def blend_samples(knots, p, x, left, out):
    """``out[s] = (value, first, second derivative)`` of one blending function at ``x[s]``."""
    work = np.zeros(12)
    for s in range(x.shape[0]):
        out[s, 0], out[s, 1], out[s, 2] = blend2(knots, 0, p, x[s], left, work)
