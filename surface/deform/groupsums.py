"""Compiled parts of sums whose weights are products of factors in u and in v, see :mod:`.factors`.

The sum over the points of a cell is factorized: points with the same factors in v form a group, which is summed once
for every coordinate in u; a tile joins the sums of few groups instead of those of many points.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

from surface.base.jit import inlined
from surface.spline.lanes import add, fma_at, item, load, mul, pick, store, zero

HEAD, STEP = 3, 18  # numbers of a cell's picks before those of its tiles, and per tile; see :mod:`.factors`


@inlined
def sum_groups(factors, factor_u, factor_v, row, rows, wide_u, whole, slopes, local, starts, sums):
    """Write the first half of a factorized sum: of the points of a cell that have the same factors in v, for every
    coordinate in u; returns how many groups of such points there are.

    ``starts`` gets where each group's factors in v start; ``sums`` from 24 on, group after group, ``wide_u`` numbers
    each for x, y and z, and if there are ``slopes`` as many for their derivatives in u. Where tiles take ``whole``
    windows, all these numbers of a window follow each other.
    """
    groups, k, at = 0, 0, 24
    each = 48 if slopes else 24
    step, apart = (each // 8, 8) if whole else (1, wide_u)
    while k < rows:
        first, shared = k, item(factor_v, row + k)
        while k < rows and item(factor_v, row + k) == shared:
            k += 1
        u = 0
        while u + 16 <= wide_u:
            sum_two_windows(factors, factor_u, row, first, k, u, local, sums, at + step * u, 8 * step, apart)
            if slopes:
                to = at + step * u + 3 * apart
                sum_two_windows(factors, factor_u, row, first, k, wide_u + u, local, sums, to, 8 * step, apart)
            u += 16
        if u < wide_u:
            sum_window(factors, factor_u, row, first, k, u, local, sums, at + step * u, apart)
            if slopes:
                sum_window(factors, factor_u, row, first, k, wide_u + u, local, sums, at + step * u + 3 * apart, apart)
        starts[groups] = shared
        groups += 1
        at += each // 8 * wide_u
    return groups


@inlined
def sum_window(factors, factor_u, row, first, end, u, local, sums, to, apart):
    """Sum the points ``first`` to ``end`` times eight factors from ``u`` on: x, y and z lie ``apart`` in ``sums``."""
    x, y, z = zero(), zero(), zero()
    for q in range(first, end):
        a, at = load(factors, item(factor_u, row + q) + u), 3 * q
        x, y, z = fma_at(a, local, at, x), fma_at(a, local, at + 1, y), fma_at(a, local, at + 2, z)
    store(sums, to, x)
    store(sums, to + apart, y)
    store(sums, to + 2 * apart, z)


@inlined
def sum_two_windows(factors, factor_u, row, first, end, u, local, sums, to, step, apart):
    """Do the same as :func:`sum_window` for sixteen factors: every coordinate is loaded once for both windows, whose
    sums lie ``step`` apart."""
    x, y, z, p, q, r = zero(), zero(), zero(), zero(), zero(), zero()
    for k in range(first, end):
        place, at = item(factor_u, row + k) + u, 3 * k
        a, b = load(factors, place), load(factors, place + 8)
        x, y, z = fma_at(a, local, at, x), fma_at(a, local, at + 1, y), fma_at(a, local, at + 2, z)
        p, q, r = fma_at(b, local, at, p), fma_at(b, local, at + 1, q), fma_at(b, local, at + 2, r)
    store(sums, to, x)
    store(sums, to + apart, y)
    store(sums, to + 2 * apart, z)
    store(sums, to + step, p)
    store(sums, to + step + apart, q)
    store(sums, to + step + 2 * apart, r)


@inlined
def join_values(groups, wide_u, whole, tile, factors, picks, starts, sums):
    """Return the second half: the sums of one tile, as :func:`sum_values`; its picks start at ``tile``."""
    x, y, z = zero(), zero(), zero()
    low_u, low_v = item(picks, tile + 16), item(picks, tile + 17)
    at = 24 + 3 * low_u if whole else 24 + low_u
    if whole:
        for g in range(groups):
            x, y, z = add_window(load(factors, item(starts, g) + low_v), sums, at, x, y, z)
            at += 3 * wide_u
    else:
        for g in range(groups):
            b = pick(factors, item(starts, g) + low_v, picks, tile + 8)
            x = add(x, mul(b, pick(sums, at, picks, tile)))
            y = add(y, mul(b, pick(sums, at + wide_u, picks, tile)))
            z = add(z, mul(b, pick(sums, at + 2 * wide_u, picks, tile)))
            at += 3 * wide_u
    return x, y, z


@inlined
def join_all(groups, wide_u, wide_v, whole, tile, factors, picks, starts, sums):
    """Return the second half: the sums of one tile, as :func:`sum_all`."""
    x, y, z = zero(), zero(), zero()
    ax, ay, az, bx, by, bz = zero(), zero(), zero(), zero(), zero(), zero()
    low_u, low_v = item(picks, tile + 16), item(picks, tile + 17)
    at = 24 + 6 * low_u if whole else 24 + low_u
    if whole:
        for g in range(groups):
            place = item(starts, g) + low_v
            b, v = load(factors, place), load(factors, place + wide_v)
            x, y, z = add_window(b, sums, at, x, y, z)
            ax, ay, az = add_window(b, sums, at + 24, ax, ay, az)
            bx, by, bz = add_window(v, sums, at, bx, by, bz)
            at += 6 * wide_u
    else:
        for g in range(groups):
            place = item(starts, g) + low_v
            b, v = pick(factors, place, picks, tile + 8), pick(factors, place + wide_v, picks, tile + 8)
            px, py = pick(sums, at, picks, tile), pick(sums, at + wide_u, picks, tile)
            pz = pick(sums, at + 2 * wide_u, picks, tile)
            x, y, z = add(x, mul(b, px)), add(y, mul(b, py)), add(z, mul(b, pz))
            bx, by, bz = add(bx, mul(v, px)), add(by, mul(v, py)), add(bz, mul(v, pz))
            ax = add(ax, mul(b, pick(sums, at + 3 * wide_u, picks, tile)))
            ay = add(ay, mul(b, pick(sums, at + 4 * wide_u, picks, tile)))
            az = add(az, mul(b, pick(sums, at + 5 * wide_u, picks, tile)))
            at += 6 * wide_u
    return x, y, z, ax, ay, az, bx, by, bz


@inlined
def add_window(factor, sums, at, x, y, z):
    """Return x, y and z plus ``factor`` times eight sums each, which follow each other."""
    x = add(x, mul(factor, load(sums, at)))
    y = add(y, mul(factor, load(sums, at + 8)))
    z = add(z, mul(factor, load(sums, at + 16)))
    return x, y, z


@inlined
def factor_counts(row, head, picks):
    """Return how many factors the rows of a cell have in u and in v; 0 where it has plain weights."""
    u, v = 0, 0
    if row >= 0:
        u, v = picks[head], picks[head + 1]
    return u, v


@inlined
def takes_whole(row, head, picks):
    """Whether the tiles of a cell with factors take whole windows of eight; ``head`` : where its picks start."""
    return row >= 0 and picks[head + 2] == 1


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
