"""Compiled loops of posing: group displacements, jaw, lids, head rotation, seams and distances from polylines."""

# mypy: disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import math

import numpy as np

from surface.base.addresses import flat, shaped, wide
from surface.base.arrays import Floats, Floats32, Ints
from surface.base.jit import inlined, kernel, nonallocating
from surface.spline.lanes import (
    add,
    div,
    fma,
    item,
    load,
    load_x,
    load_y,
    load_z,
    mul,
    prefetch,
    root,
    splat,
    store,
    store3,
)

ONE, TINY = np.float32(1.0), np.float32(1e-30)
AHEAD = 512  # numbers that are fetched before they are needed


@nonallocating
def add_moves(
    amounts: Floats, start: Ints, tile: Ints, rows: Floats32, order: Ints, sums: Floats32, rest: Floats, points: Floats
) -> None:
    """Write to ``points (n, 3)`` those at ``rest (n, 3)`` and the displacements of groups, each by its one of ``amounts
    (g,)``.

    Group g moves the tiles ``tile[start[g]]`` to ``tile[start[g + 1] - 1]`` by 24 numbers each in ``rows``, those of
    eight points. Points are put into tiles by ``order (n,)``; ``sums (24 t,)`` is scratch space.
    """
    for k in range(sums.shape[0]):
        sums[k] = np.float32(0.0)
    for g in range(amounts.shape[0]):
        amount = np.float32(amounts[g])
        if amount == 0.0:
            continue
        for e in range(start[g], start[g + 1]):
            at, row = 24 * item(tile, e), 24 * e
            prefetch(rows, row + AHEAD)
            prefetch(rows, row + AHEAD + 16)
            for part in range(0, 24, 8):
                store(sums, at + part, fma(load(rows, row + part), amount, load(sums, at + part)))
    for k in range(order.shape[0]):
        i = order[k]
        for c in range(3):
            points[i, c] = rest[i, c] + sums[3 * k + c]


@nonallocating
def mix_rows(amounts: Floats, rows: Floats32, rest: Floats, least: Floats, out: Floats) -> None:
    """Write ``rest (k,)`` plus ``amounts (g,) @ rows (g, k)``, nowhere less than ``least (k,)``, to ``out (k,)``."""
    for k in range(out.shape[0]):
        out[k] = rest[k]
    for g in range(amounts.shape[0]):
        if amounts[g] != 0.0:
            for k in range(out.shape[0]):
                out[k] += amounts[g] * rows[g, k]
    for k in range(out.shape[0]):
        out[k] = max(out[k], least[k])


@inlined
def map_vectors(rows, at, linear, x0, y0, z0):  # type: ignore[no-untyped-def]
    """Return ``linear @ p`` plus a shift (x0, y0, z0) of the eight vectors p from ``rows[at]`` on."""
    x, y, z = load_x(rows, at), load_y(rows, at), load_z(rows, at)
    return (
        fma(x, linear[0, 0], fma(y, linear[0, 1], fma(z, linear[0, 2], splat(x0)))),
        fma(x, linear[1, 0], fma(y, linear[1, 1], fma(z, linear[1, 2], splat(y0)))),
        fma(x, linear[2, 0], fma(y, linear[2, 1], fma(z, linear[2, 2], splat(z0)))),
    )


@nonallocating
def move_tile(
    rest: Floats32, rest_normals: Floats32, linear: Floats32, shift: Floats32, turn: Floats32, at: int,
    vertices: Floats32, normals: Floats32, to: int,
) -> None:  # fmt: skip
    """Eight vertices of :func:`move_rigid` from ``at`` on, to ``to``; all arrays but the matrices are flat, and
    ``turn (3, 3)`` is for normals."""
    none = np.float32(0.0)
    x, y, z = map_vectors(rest, at, linear, shift[0], shift[1], shift[2])
    store3(vertices, to, x, y, z)
    x, y, z = map_vectors(rest_normals, at, turn, none, none, none)
    square = add(mul(x, x), add(mul(y, y), mul(z, z)))
    scale = div(splat(ONE), root(add(square, splat(TINY))))
    store3(normals, to, mul(x, scale), mul(y, scale), mul(z, scale))


@kernel
def move_rigid(
    rest: Floats32, rest_normals: Floats32, linear: Floats32, shift: Floats32, vertices: Floats32, normals: Floats32
) -> None:
    """Write ``linear (3, 3) @ p + shift (3,)`` of every row of ``rest (m, 3)``, and the unit normal there.

    Normals go by the matrix of cofactors, which the cross product of two mapped tangents is: ``linear`` need not be a
    rotation.
    """
    turn = np.empty((3, 3), np.float32)
    for r in range(3):
        i, j = (r + 1) % 3, (r + 2) % 3
        for c in range(3):
            k, m = (c + 1) % 3, (c + 2) % 3
            turn[r, c] = linear[i, k] * linear[j, m] - linear[i, m] * linear[j, k]
    flat, directions = rest.reshape(-1), rest_normals.reshape(-1)
    out, out_directions = vertices.reshape(-1), normals.reshape(-1)
    whole = 24 * (len(rest) // 8)
    for at in range(0, whole, 24):
        move_tile(flat, directions, linear, shift, turn, at, out, out_directions, at)
    left = 3 * len(rest) - whole
    if left > 0:  # fewer than eight are left: they are moved in a tile of their own
        own = np.zeros((4, 24), np.float32)
        own[0, :left], own[1, :left] = flat[whole:], directions[whole:]
        move_tile(own[0], own[1], linear, shift, turn, 0, own[2], own[3], 0)
        for k in range(left):
            out[whole + k], out_directions[whole + k] = own[2, k], own[3, k]


@nonallocating
def place_vertices(
    start: Ints, ids: Ints, weights: Floats, points: Floats32, share: Floats32,
    turn: Floats, pivot: Floats, out: Floats,
) -> None:  # fmt: skip
    """Write to ``out (k, 3)`` vertices as sums of ``weights`` of ``points (n, 4)``, the entries of the k-th from
    ``start[k]`` to ``start[k + 1]``, each rotated about ``pivot (3,)`` by its ``share`` of the rotation vector
    ``turn (3,)``, by Rodrigues' formula."""
    angle = math.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
    small = 1.0 / max(angle, 1e-12)
    x, y, z = turn[0] * small, turn[1] * small, turn[2] * small
    for k in range(out.shape[0]):
        a, b, c = -pivot[0], -pivot[1], -pivot[2]
        for i in range(start[k], start[k + 1]):
            a += weights[i] * points[ids[i], 0]
            b += weights[i] * points[ids[i], 1]
            c += weights[i] * points[ids[i], 2]
        cosine, sine = math.cos(share[k] * angle), math.sin(share[k] * angle)
        along = (1.0 - cosine) * (a * x + b * y + c * z)
        out[k, 0] = pivot[0] + cosine * a + sine * (y * c - z * b) + along * x
        out[k, 1] = pivot[1] + cosine * b + sine * (z * a - x * c) + along * y
        out[k, 2] = pivot[2] + cosine * c + sine * (x * b - y * a) + along * z


@nonallocating
def swing_jaw(
    rest: Floats, share: Floats, turn: Floats, shift: Floats, full_turn: Floats, full_shift: Floats,
    amount: float, undo: Floats, points: Floats,
) -> None:  # fmt: skip
    """Add to ``points (n, 3)`` each point's ``share`` of the jaw's motion from its place at rest.

    ``undo (n,)`` takes back the difference between the arc and the straight way, for lips that mouthClose
    (a straight displacement) brings together.
    """
    for i in range(rest.shape[0]):
        if share[i] == 0.0:
            continue
        for r in range(3):
            arc = shift[r] - rest[i, r]
            line = full_shift[r] - amount * rest[i, r]
            for c in range(3):
                arc += turn[r, c] * rest[i, c]
                line += full_turn[r, c] * rest[i, c]
            points[i, r] += share[i] * (arc + undo[i] * (line - arc))


@nonallocating
def keep_on_eyeball(ids: Ints, eye: Floats, hold: Floats, radius: Floats, points: Floats) -> None:
    """Set the distance of points ``ids (k,)`` from ``eye (k, 3)`` to ``radius (k,)``, by the share ``hold (k,)``.

    Straight displacements would cut through the eyeball half-way; distances that are mixed like the
    displacements themselves do not.
    """
    for k in range(ids.shape[0]):
        i = ids[k]
        x, y, z = points[i, 0] - eye[k, 0], points[i, 1] - eye[k, 1], points[i, 2] - eye[k, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length < 1e-6:
            continue
        scale = hold[k] * (radius[k] / length - 1.0)
        points[i, 0] += scale * x
        points[i, 1] += scale * y
        points[i, 2] += scale * z


@kernel
def hold_lids(table: Ints, given: Floats, points: Floats) -> None:
    """Set the distance of the lids among ``points (n, 3)`` for ``given (g,)`` amounts of groups, by :func:`mix_rows`
    and :func:`keep_on_eyeball`.

    table : addresses of used, the (h,) groups that change distances, moves (h, k) float32, rest, least and radius (k,),
        ids (k,), eye (k, 3), hold (k,), and room (h,) for amounts.
    """
    used, rest, ids = flat(table, 0, np.int64), flat(table, 2, np.float64), flat(table, 5, np.int64)
    moves, amounts = shaped(table, 1, (len(used), len(ids)), np.float32), flat(table, 8, np.float64)
    radius = flat(table, 4, np.float64)
    for g in range(len(used)):
        amounts[g] = given[used[g]]
    mix_rows(amounts, moves, rest, flat(table, 3, np.float64), radius)
    keep_on_eyeball(ids, wide(table, 6, 3, np.float64), flat(table, 7, np.float64), radius, points)


@nonallocating
def nearest_on_line(uv: Floats, line: Floats, closed: bool, distance: Floats, at: Floats) -> None:
    """For every point of ``uv (m, 2)``: its distance from the polyline ``line (k, 2)``, and how far along it the
    nearest place lies, in the line's points; written to ``distance (m,)`` and ``at (m,)``."""
    steps = line.shape[0] if closed else max(line.shape[0] - 1, 1)
    for i in range(uv.shape[0]):
        best = np.inf
        for k in range(steps):
            n = (k + 1) % line.shape[0]
            du, dv = line[n, 0] - line[k, 0], line[n, 1] - line[k, 1]
            pu, pv = uv[i, 0] - line[k, 0], uv[i, 1] - line[k, 1]
            t = min(max((pu * du + pv * dv) / max(du * du + dv * dv, 1e-18), 0.0), 1.0)
            pu, pv = pu - t * du, pv - t * dv
            d = pu * pu + pv * pv
            if d < best:
                best = d
                at[i] = k + t
        distance[i] = np.sqrt(best)


@nonallocating
def stitch_border(
    vertices: Floats32, normals: Floats32, to_vertices: Floats32, to_normals: Floats32, ids: Ints,
    low: Ints, high: Ints, share: Floats32, inward: Floats32,
) -> None:  # fmt: skip
    """Put rows ``ids`` of ``to_vertices (m, 3)`` between rows ``low`` and ``high`` of ``vertices``, at ``share`` of
    the way; normals alike, to length 1 where they have any. ``inward`` : mm by which each goes on beside that way, in
    the surface, to the left where it is above 0, seen with the normal upright."""
    for k in range(ids.shape[0]):
        i, a, b, t = ids[k], low[k], high[k], share[k]
        square = np.float32(0.0)
        for c in range(3):
            to_vertices[i, c] = vertices[a, c] + t * (vertices[b, c] - vertices[a, c])
            to_normals[i, c] = normals[a, c] + t * (normals[b, c] - normals[a, c])
            square += to_normals[i, c] ** 2
        if square > 1e-24:
            scale = 1.0 / np.sqrt(square)
            for c in range(3):
                to_normals[i, c] *= scale
            if inward[k] != 0.0:
                _go_beside(to_vertices[i], to_normals[i], vertices[a], vertices[b], inward[k])


@kernel
def _go_beside(place: Floats32, normal: Floats32, start: Floats32, end: Floats32, far: float) -> None:
    """Move a place (3,) by ``far`` across the way from ``start`` to ``end``, and across the normal."""
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    u = normal[1] * z - normal[2] * y
    v = normal[2] * x - normal[0] * z
    w = normal[0] * y - normal[1] * x
    length = np.sqrt(u * u + v * v + w * w)
    if length > 1e-9:
        place[0] += far * u / length
        place[1] += far * v / length
        place[2] += far * w / length


@kernel
def stitch_bound(table: Ints) -> None:
    """Run :func:`stitch_border` with arrays of which the table has the addresses, in its order."""
    stitch_border(
        wide(table, 0, 3, np.float32), wide(table, 1, 3, np.float32), wide(table, 2, 3, np.float32),
        wide(table, 3, 3, np.float32), flat(table, 4, np.int64), flat(table, 5, np.int64), flat(table, 6, np.int64),
        flat(table, 7, np.float32), flat(table, 8, np.float32),
    )  # fmt: skip
