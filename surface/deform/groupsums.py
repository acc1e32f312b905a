"""Compiled parts of sums whose weights are products of factors in u and in v, see :mod:`.factors`.

The sum over the points of a cell is factorized: points with the same factors in v form a group, which is summed once
for every coordinate in u; a tile joins the sums of few groups instead of those of many points.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

from surface.base.jit import inlined
from surface.spline.lanes import add, fma, load, mul, pick, store, zero

HEAD, STEP = 2, 18  # numbers of a cell's picks before those of its tiles, and per tile; see :mod:`.factors`


@inlined
def sum_groups(factors, factor_u, factor_v, row, rows, wide_u, slopes, local, starts, sums):
    """Write the first half of a factorized sum: of the points of a cell that have the same factors in v, for every
    coordinate in u; returns how many groups of such points there are.

    ``starts`` gets where each group's factors in v start; ``sums`` from 24 on, group after group, ``wide_u`` numbers
    each for x, y and z, and if there are ``slopes`` as many for their derivatives in u.
    """
    groups, k, at = 0, 0, 24
    while k < rows:
        first, shared = k, factor_v[row + k]
        while k < rows and factor_v[row + k] == shared:
            k += 1
        for u in range(0, wide_u, 8):
            x, y, z = zero(), zero(), zero()
            ax, ay, az = zero(), zero(), zero()
            for q in range(first, k):
                a = load(factors, factor_u[row + q] + u)
                x, y, z = fma(a, local[q, 0], x), fma(a, local[q, 1], y), fma(a, local[q, 2], z)
                if slopes:
                    a = load(factors, factor_u[row + q] + wide_u + u)
                    ax, ay, az = fma(a, local[q, 0], ax), fma(a, local[q, 1], ay), fma(a, local[q, 2], az)
            store(sums, at + u, x)
            store(sums, at + wide_u + u, y)
            store(sums, at + 2 * wide_u + u, z)
            if slopes:
                store(sums, at + 3 * wide_u + u, ax)
                store(sums, at + 4 * wide_u + u, ay)
                store(sums, at + 5 * wide_u + u, az)
        starts[groups] = shared
        groups += 1
        at += 6 * wide_u if slopes else 3 * wide_u
    return groups


@inlined
def join_values(groups, wide_u, tile, factors, picks, starts, sums):
    """Return the second half: the sums of one tile, as :func:`sum_values`; its picks start at ``tile``."""
    x, y, z = zero(), zero(), zero()
    at, low_v = 24 + picks[tile + 16], picks[tile + 17]
    for g in range(groups):
        b = pick(factors, starts[g] + low_v, picks, tile + 8)
        x = add(x, mul(b, pick(sums, at, picks, tile)))
        y = add(y, mul(b, pick(sums, at + wide_u, picks, tile)))
        z = add(z, mul(b, pick(sums, at + 2 * wide_u, picks, tile)))
        at += 3 * wide_u
    return x, y, z


@inlined
def join_all(groups, wide_u, wide_v, tile, factors, picks, starts, sums):
    """Return the second half: the sums of one tile, as :func:`sum_all`."""
    x, y, z = zero(), zero(), zero()
    ax, ay, az, bx, by, bz = zero(), zero(), zero(), zero(), zero(), zero()
    at, low_v = 24 + picks[tile + 16], picks[tile + 17]
    for g in range(groups):
        b, v = (
            pick(factors, starts[g] + low_v, picks, tile + 8),
            pick(factors, starts[g] + wide_v + low_v, picks, tile + 8),
        )
        px, py, pz = (
            pick(sums, at, picks, tile),
            pick(sums, at + wide_u, picks, tile),
            pick(sums, at + 2 * wide_u, picks, tile),
        )
        x, y, z = add(x, mul(b, px)), add(y, mul(b, py)), add(z, mul(b, pz))
        bx, by, bz = add(bx, mul(v, px)), add(by, mul(v, py)), add(bz, mul(v, pz))
        ax = add(ax, mul(b, pick(sums, at + 3 * wide_u, picks, tile)))
        ay = add(ay, mul(b, pick(sums, at + 4 * wide_u, picks, tile)))
        az = add(az, mul(b, pick(sums, at + 5 * wide_u, picks, tile)))
        at += 6 * wide_u
    return x, y, z, ax, ay, az, bx, by, bz


@inlined
def factor_counts(row, head, picks):
    """Return how many factors the rows of a cell have in u and in v; 0 where it has plain weights."""
    u, v = 0, 0
    if row >= 0:
        u, v = picks[head], picks[head + 1]
    return u, v


@inlined
def product(factors, picks, at_u, at_v, tile):
    """Return eight weights b w of a tile, from the factors in u and v whose windows start at ``at_u`` and ``at_v``."""
    return mul(pick(factors, at_u, picks, tile), pick(factors, at_v, picks, tile + 8))


@inlined
def slope_products(factors, picks, at_u, at_v, wide_u, wide_v, tile):
    """Return eight each of b w, b_u w and b_v w of a tile; slopes lie ``wide_u`` and ``wide_v`` after the factors."""
    a, b = pick(factors, at_u, picks, tile), pick(factors, at_v, picks, tile + 8)
    u, v = pick(factors, at_u + wide_u, picks, tile), pick(factors, at_v + wide_v, picks, tile + 8)
    return mul(a, b), mul(u, b), mul(a, v)
