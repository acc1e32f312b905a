"""Compiled parts of sums over packed weights, see :mod:`.packing`: every tile has a list of its own."""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

from surface.base.jit import inlined
from surface.spline.lanes import (
    PAIRS_FAST,
    add,
    add_pairs,
    first_of,
    fma,
    fma_at,
    fma_pair,
    item,
    load,
    load_fixed,
    load_fixed_pair,
    load_pair,
    prefetch,
    second_of,
    store,
    store3,
    store3_at,
    zero,
    zero_pair,
)

AHEAD = 128  # entries that are prefetched before they are needed


@inlined
def sum_packed(packed, entry_row, e, end, local):
    """Return three sums of the tile with entries ``e`` to ``end``, as :func:`.apply.sum_values`."""
    x0, y0, z0 = zero(), zero(), zero()
    x1, y1, z1 = zero(), zero(), zero()
    x2, y2, z2 = zero(), zero(), zero()
    x3, y3, z3 = zero(), zero(), zero()
    while e + 4 <= end:
        p, q = 3 * item(entry_row, e), 3 * item(entry_row, e + 1)
        r, s = 3 * item(entry_row, e + 2), 3 * item(entry_row, e + 3)
        a, b = load_fixed(packed, e), load_fixed(packed, e + 1)
        c, d = load_fixed(packed, e + 2), load_fixed(packed, e + 3)
        prefetch(packed, 24 * (e + AHEAD))
        prefetch(packed, 24 * (e + AHEAD) + 48)
        x0, y0, z0 = fma_at(a, local, p, x0), fma_at(a, local, p + 1, y0), fma_at(a, local, p + 2, z0)
        x1, y1, z1 = fma_at(b, local, q, x1), fma_at(b, local, q + 1, y1), fma_at(b, local, q + 2, z1)
        x2, y2, z2 = fma_at(c, local, r, x2), fma_at(c, local, r + 1, y2), fma_at(c, local, r + 2, z2)
        x3, y3, z3 = fma_at(d, local, s, x3), fma_at(d, local, s + 1, y3), fma_at(d, local, s + 2, z3)
        e += 4
    while e < end:
        a, p = load_fixed(packed, e), 3 * item(entry_row, e)
        x0, y0, z0 = fma_at(a, local, p, x0), fma_at(a, local, p + 1, y0), fma_at(a, local, p + 2, z0)
        e += 1
    return add(add(x0, x1), add(x2, x3)), add(add(y0, y1), add(y2, y3)), add(add(z0, z1), add(z2, z3))


@inlined
def _sum_singly(packed, packed_slope, entry_row, e, end, local):
    """As :func:`sum_all_packed`, entry by entry: nine sums in registers are as many as processors without AVX-512
    have room for."""
    x, y, z = zero(), zero(), zero()
    ax, ay, az, bx, by, bz = zero(), zero(), zero(), zero(), zero(), zero()
    while e < end:
        p = 3 * item(entry_row, e)
        w, u, v = load_fixed(packed, e), load(packed_slope, 16 * e), load(packed_slope, 16 * e + 8)
        prefetch(packed, 24 * (e + AHEAD))
        prefetch(packed_slope, 16 * (e + AHEAD))
        x, y, z = fma_at(w, local, p, x), fma_at(w, local, p + 1, y), fma_at(w, local, p + 2, z)
        ax, ay, az = fma_at(u, local, p, ax), fma_at(u, local, p + 1, ay), fma_at(u, local, p + 2, az)
        bx, by, bz = fma_at(v, local, p, bx), fma_at(v, local, p + 1, by), fma_at(v, local, p + 2, bz)
        e += 1
    return x, y, z, ax, ay, az, bx, by, bz


@inlined
def _sum_in_pairs(packed, packed_slope, entry_row, e, end, local):
    """As :func:`sum_all_packed`, with the derivatives of an entry in u and v as a pair, and the weights of two
    entries."""
    x, y, z = zero(), zero(), zero()
    wx, wy, wz = zero_pair(), zero_pair(), zero_pair()
    sx, sy, sz, tx, ty, tz = zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair(), zero_pair()
    if e % 2 == 1 and e < end:
        a, s, p = load_fixed(packed, e), load_pair(packed_slope, 16 * e), 3 * item(entry_row, e)
        x, y, z = fma_at(a, local, p, x), fma_at(a, local, p + 1, y), fma_at(a, local, p + 2, z)
        sx, sy = fma_pair(s, local, p, p, sx), fma_pair(s, local, p + 1, p + 1, sy)
        sz = fma_pair(s, local, p + 2, p + 2, sz)
        e += 1
    while e + 2 <= end:
        p, q = 3 * item(entry_row, e), 3 * item(entry_row, e + 1)
        w, s, t = load_fixed_pair(packed, e), load_pair(packed_slope, 16 * e), load_pair(packed_slope, 16 * e + 16)
        prefetch(packed, 24 * (e + AHEAD))
        prefetch(packed_slope, 16 * (e + AHEAD))
        wx, sx, tx = fma_pair(w, local, p, q, wx), fma_pair(s, local, p, p, sx), fma_pair(t, local, q, q, tx)
        p, q = p + 1, q + 1
        wy, sy, ty = fma_pair(w, local, p, q, wy), fma_pair(s, local, p, p, sy), fma_pair(t, local, q, q, ty)
        p, q = p + 1, q + 1
        wz, sz, tz = fma_pair(w, local, p, q, wz), fma_pair(s, local, p, p, sz), fma_pair(t, local, q, q, tz)
        e += 2
    if e < end:
        a, t, p = load_fixed(packed, e), load_pair(packed_slope, 16 * e), 3 * item(entry_row, e)
        x, y, z = fma_at(a, local, p, x), fma_at(a, local, p + 1, y), fma_at(a, local, p + 2, z)
        tx, ty = fma_pair(t, local, p, p, tx), fma_pair(t, local, p + 1, p + 1, ty)
        tz = fma_pair(t, local, p + 2, p + 2, tz)
    x, y = add(x, add(first_of(wx), second_of(wx))), add(y, add(first_of(wy), second_of(wy)))
    z = add(z, add(first_of(wz), second_of(wz)))
    sx, sy, sz = add_pairs(sx, tx), add_pairs(sy, ty), add_pairs(sz, tz)
    return x, y, z, first_of(sx), first_of(sy), first_of(sz), second_of(sx), second_of(sy), second_of(sz)


sum_all_packed = _sum_in_pairs if PAIRS_FAST else _sum_singly
"""``(packed, packed_slope, entry_row, e, end, local)``: return nine sums of the tile with entries ``e`` to ``end``, as
:func:`.apply.sum_all`."""


@inlined
def write_lanes(out, first, last, vertex, at, order, x, y, z, scratch):
    """Write the vectors of the tile that begins at ``vertex`` of a cell with vertices ``first`` to ``last``.

    ``at`` : where the cell's order starts in ``order``, or less than 0 where lanes follow vertices.
    """
    if at < 0 and vertex + 8 <= last:
        store3(out, 3 * vertex, x, y, z)
    elif vertex + 8 <= last:
        store3_at(out, 3 * first, order, at + vertex - first, x, y, z)
    else:
        store3(scratch, 0, x, y, z)
        for j in range(last - vertex):
            place = 3 * (vertex + j)
            if at >= 0:
                place = 3 * (first + item(order, at + vertex - first + j))
            out[place], out[place + 1], out[place + 2] = scratch[3 * j], scratch[3 * j + 1], scratch[3 * j + 2]


@inlined
def accumulate(numerators, place, weights, number):
    """``numerators[place : place + 8] += weights * number``."""
    store(numerators, place, fma(weights, number, load(numerators, place)))


@inlined
def add_products(numerators, place, weights, dx, dy, dz):
    """``numerators[place : place + 24] += weights * d``, eight numbers each for x, y and z; Eq. (2) for one tile."""
    accumulate(numerators, place, weights, dx)
    accumulate(numerators, place + 8, weights, dy)
    accumulate(numerators, place + 16, weights, dz)


@inlined
def add_packed_row(
    first_tile, end_tile, at, place, dx, dy, dz, slopes, tile_entry, packed, packed_slope, places, touched, numerators,
):  # fmt: skip
    """Eq. (2): add b w dP of one control point to the numerators of a packed cell, in the tiles that it reaches.

    ``at`` : where the cell's tiles start in ``tile_entry``; ``place``: where those of the point's row do in ``places``.
    ``touched`` gets 1 for these tiles.
    """
    size = 72 if slopes else 24
    for tile in range(first_tile, end_tile):
        number = item(places, place + tile - first_tile)
        if number == 0:
            continue
        e, base = item(tile_entry, at + tile - first_tile) + number - 1, tile * size
        touched[tile] = 1
        a = load_fixed(packed, e)
        add_products(numerators, base, a, dx, dy, dz)
        if slopes:
            u, v = load(packed_slope, 16 * e), load(packed_slope, 16 * e + 8)
            add_products(numerators, base + 24, u, dx, dy, dz)
            add_products(numerators, base + 48, v, dx, dy, dz)
