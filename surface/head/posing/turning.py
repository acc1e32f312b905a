"""Compiled rotation of a head: every vertex turns by its own share of the angle, eight at a time."""

# mypy: disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.base.jit import inlined, kernel, nonallocating
from surface.spline.lanes import add, fma, load, load_x, load_y, load_z, mul, splat, store3, sub

# coefficients of Taylor's series: of x**11 to x**3, and of x**12 to x**2
SINE = tuple(np.float32(x) for x in (-1 / 39916800, 1 / 362880, -1 / 5040, 1 / 120, -1 / 6))
COSINE = tuple(np.float32(x) for x in (1 / 479001600, -1 / 3628800, 1 / 40320, -1 / 720, 1 / 24, -1 / 2))
ONE, TWO = np.float32(1.0), np.float32(2.0)


@inlined
def sine_and_rest(share, half):  # type: ignore[no-untyped-def]
    """Return the sine of twice ``share * half``, and one less its cosine, of eight shares; ``half`` is at most pi /
    2.
    """
    x = mul(share, splat(half))
    q = mul(x, x)
    s = add(mul(q, splat(SINE[0])), splat(SINE[1]))
    s = add(mul(q, s), splat(SINE[2]))
    s = add(mul(q, s), splat(SINE[3]))
    s = add(mul(q, s), splat(SINE[4]))
    s = mul(x, add(mul(q, s), splat(ONE)))
    c = add(mul(q, splat(COSINE[0])), splat(COSINE[1]))
    c = add(mul(q, c), splat(COSINE[2]))
    c = add(mul(q, c), splat(COSINE[3]))
    c = add(mul(q, c), splat(COSINE[4]))
    c = add(mul(q, c), splat(COSINE[5]))
    c = add(mul(q, c), splat(ONE))
    twice = mul(s, splat(TWO))
    return mul(twice, c), mul(twice, s)


@inlined
def turn_vectors(x, y, z, a, b, c, sine, rest):  # type: ignore[no-untyped-def]
    """Return eight vectors turned about the unit axis (a, b, c): Rodrigues' formula, with ``rest`` one less the
    cosine.
    """
    along = mul(rest, fma(x, a, fma(y, b, mul(z, splat(c)))))
    return (
        add(sub(x, mul(rest, x)), add(mul(sine, fma(z, b, mul(y, splat(-c)))), mul(along, splat(a)))),
        add(sub(y, mul(rest, y)), add(mul(sine, fma(x, c, mul(z, splat(-a)))), mul(along, splat(b)))),
        add(sub(z, mul(rest, z)), add(mul(sine, fma(y, a, mul(x, splat(-b)))), mul(along, splat(c)))),
    )


@nonallocating
def turn_tile(
    vertices: Floats32, normals: Floats32, share: Floats32, axis: Floats32, half: float, pivot: Floats32, at: int,
    out_vertices: Floats32, out_normals: Floats32, to: int,
) -> None:  # fmt: skip
    """As :func:`turn_head` for eight rows from ``at``, written from ``to``; all arrays but ``share`` are flat."""
    a, b, c = axis[0], axis[1], axis[2]
    px, py, pz = splat(pivot[0]), splat(pivot[1]), splat(pivot[2])
    sine, rest = sine_and_rest(load(share, at), np.float32(half))
    x, y, z = sub(load_x(vertices, 3 * at), px), sub(load_y(vertices, 3 * at), py), sub(load_z(vertices, 3 * at), pz)
    x, y, z = turn_vectors(x, y, z, a, b, c, sine, rest)
    store3(out_vertices, 3 * to, add(x, px), add(y, py), add(z, pz))
    x, y, z = load_x(normals, 3 * at), load_y(normals, 3 * at), load_z(normals, 3 * at)
    x, y, z = turn_vectors(x, y, z, a, b, c, sine, rest)
    store3(out_normals, 3 * to, x, y, z)


@kernel
def turn_head(
    vertices: Floats32, normals: Floats32, share: Floats32, turn: Floats, pivot: Floats, start: int, stop: int,
    out_vertices: Floats32, out_normals: Floats32,
) -> None:  # fmt: skip
    """Rotate rows start..stop (m, 3) about ``pivot (3,)`` by each one's ``share (m,)`` of the rotation whose vector is
    ``turn (3,)``, which is not zero.

    A vertex that follows in part turns by part of the angle (Rodrigues' formula): the neck bends instead of shearing.
    """
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    axis, middle = (turn / angle).astype(np.float32), pivot.astype(np.float32)
    flat, directions = vertices.reshape(-1), normals.reshape(-1)
    out, out_directions = out_vertices.reshape(-1), out_normals.reshape(-1)
    first = start
    while first + 8 <= stop:
        turn_tile(flat, directions, share, axis, 0.5 * angle, middle, first, out, out_directions, first)
        first += 8
    if first < stop:  # fewer than eight are left: they are turned in a tile of their own
        left, own = stop - first, np.zeros((4, 24), np.float32)
        some = np.zeros(8, np.float32)
        own[0, : 3 * left], own[1, : 3 * left] = flat[3 * first : 3 * stop], directions[3 * first : 3 * stop]
        some[:left] = share[first:stop]
        turn_tile(own[0], own[1], some, axis, 0.5 * angle, middle, 0, own[2], own[3], 0)
        out[3 * first : 3 * stop], out_directions[3 * first : 3 * stop] = own[2, : 3 * left], own[3, : 3 * left]
