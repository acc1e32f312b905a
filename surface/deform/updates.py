"""Compiled kernels that move control points and bring the cells they affect up to date, Eq. (2).

``table`` holds the addresses of :data:`surface.deform.binding.NAMES`.

Each difference rounds a numerator, by at most ``ROUNDING`` of its size. So every cell keeps a bound on its numerators
per weight (``span``: what they were made of, and all moves since) and on the sum of these errors (``drift``), and is
computed again before the drift exceeds ``MAX_DRIFT`` of the surface's size. That size is measured again when points
have moved so far in all that it may have changed. Everything is computed again, from other origins, where the surface
is less than half as large as it was at any time since origins were chosen, or its middle is further away from the one
it had then than it is large. So no point is further away from an origin than 2.5 times the surface's size.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated, has-type"
from __future__ import annotations

import numpy as np

from surface.base.jit import inlined, kernel, nonallocating
from surface.spline.lanes import load

from .apply import compute_cells, finish_cell, gather, join_ranges, store_numerators
from .binding import arrays_of
from .groupsums import HEAD, STEP, factor_counts, product, slope_products
from .packedsums import add_packed_row, add_products

NOT_STORED = -1  # in ``differences``: the cell's numerators are not stored
STORE = -2  # in ``differences``: compute and store them now
VALID = 1 << 62  # what :func:`first_invalid` returns where nothing is wrong
ROUNDING = 6e-8  # half a unit in the last place of float32
MAX_DRIFT = 8e-7  # of the surface's size
REFUSED = 1 << 61  # subtracted from results of :func:`move_points` that mean a bad argument


@inlined
def add_row(
    first_tile, end_tile, place, step, row, head, dx, dy, dz, slopes, value, slope, factor_u, factor_v, factors, picks,
    numerators,
):  # fmt: skip
    """Eq. (2): add b w dP of one control point to the numerators of one cell.

    Its plain weights start at ``place``, or it is the ``row`` in the factors, unless that is -1.
    """
    size, at = 72 if slopes else 24, head + HEAD
    wide_u, wide_v = factor_counts(row, head, picks)
    for tile in range(first_tile, end_tile):
        base = tile * size
        if row >= 0:
            at_u, at_v = factor_u[row] + picks[at + 16], factor_v[row] + picks[at + 17]
            a = product(factors, picks, at_u, at_v, at)
        else:
            at_u, at_v = 0, 0
            a = load(value, place)
        add_products(numerators, base, a, dx, dy, dz)
        if slopes:
            if row >= 0:
                _, u, v = slope_products(factors, picks, at_u, at_v, wide_u, wide_v, at)
            else:
                u, v = load(slope, 2 * place), load(slope, 2 * place + 8)
            add_products(numerators, base + 24, u, dx, dy, dz)
            add_products(numerators, base + 48, v, dx, dy, dz)
        place += step
        at += STEP


@kernel
def find_affected(ids, delta, count, point_start, point_count, point_cell, hits, pull, affected):
    """List the cells that the first ``count`` of ``ids`` reach, ascending; returns their number.

    ``hits`` counts by how many each is reached, and ``pull`` adds up how far these move.
    """
    total = 0
    for q in range(count):
        i = ids[q]
        far = max(abs(delta[q, 0]), abs(delta[q, 1]), abs(delta[q, 2]))
        for e in range(point_start[i], point_start[i] + point_count[i]):
            c = point_cell[e]
            if hits[c] == 0:
                affected[total] = c
                total += 1
                pull[c] = 0.0
            hits[c] += 1
            pull[c] += far
    affected[:total].sort()
    return total


@nonallocating
def choose_recomputed(
    total, affected, hits, pull, differences, span, drift, rows, rows_at, slopes, limit, bias, most_drift, recomputed
):  # fmt: skip
    """Decide for each affected cell how it is updated; returns how many are computed again from all their points.

    Those are listed in ``recomputed``. Differences cost ``bias`` rows each, computing again costs all rows; factors of
    positions alone are joined faster than numerators are read. A cell is also computed again where its numerators are
    not stored, would take more than ``limit`` differences, or would drift by more than ``most_drift``.
    """
    count = 0
    for q in range(total):
        c = affected[q]
        few = bias * hits[c] < rows[c] and (slopes or rows_at[c] < 0)
        reach = span[c] + pull[c]
        error = drift[c] + ROUNDING * hits[c] * reach
        if differences[c] >= 0 and differences[c] + hits[c] <= limit and few and error <= most_drift:
            differences[c] += hits[c]
            span[c], drift[c] = reach, error
        elif few:
            differences[c] = STORE  # few points, perhaps again next time: compute all and store the numerators
        else:
            differences[c] = NOT_STORED
            recomputed[count] = c
            count += 1
        hits[c] = 0
    return count


@inlined
def largest(local, rows):
    """Return the greatest coordinate of the first ``rows`` of ``local``, without sign."""
    most = 0.0
    for k in range(rows):
        most = max(most, abs(local[k, 0]), abs(local[k, 1]), abs(local[k, 2]))
    return most


@nonallocating
def reach_along(points, k):
    """Return the least and the greatest of coordinate k of ``points (n, 3)``."""
    low, high = points[0, k], points[0, k]
    for i in range(points.shape[0]):
        low, high = min(low, points[i, k]), max(high, points[i, k])
    return low, high


@nonallocating
def measure(points, extent, afresh):
    """Fill ``extent`` for ``points (n, 3)``; returns whether origins are to be chosen again, as they are if ``afresh``.

    ``extent`` : the longest side of the box around the points, how far they have moved since it was measured, the
    longest side since origins were chosen, the greatest coordinate that is allowed, and the box's middle when origins
    were chosen (3).
    """
    extent[0], extent[1], away = 0.0, 0.0, 0.0
    for k in range(3):
        low, high = reach_along(points, k)
        extent[0] = max(extent[0], high - low)
        away = max(away, abs(0.5 * low + 0.5 * high - extent[4 + k]))
    extent[2] = max(extent[2], extent[0])
    if not (afresh or 2.0 * extent[0] < extent[2] or away > extent[0]):
        return False
    extent[2] = extent[0]
    for k in range(3):
        low, high = reach_along(points, k)
        extent[4 + k] = 0.5 * low + 0.5 * high
    return True


@nonallocating
def has_left(points, delta, count, extent):
    """Whether the surface has become so small, or moved so far, that the origins do not fit it any more.

    ``extent`` : as :func:`measure` fills it. The size cannot have changed by more than twice the moves since then, the
    furthest of each call added up.
    """
    far = 0.0
    for q in range(count):
        far = max(far, abs(delta[q, 0]), abs(delta[q, 1]), abs(delta[q, 2]))
    extent[1] += far
    if 4.0 * extent[1] <= extent[0]:
        return False
    return measure(points, extent, False)


@nonallocating
def update_cells(table, count, limit, bias, sign):
    """Bring all cells that the first ``count`` moved points reach up to date; returns how many there are."""
    arrays = arrays_of(table)
    cell_start, tile_start, rows, room, at, ids_at, ids, value, slope = arrays[:9]
    point_start, point_count, point_cell, point_row = arrays[9:13]
    points, origin, inv_w, dw, numerators, differences, vertices, normals = arrays[13:21]
    _, hits, affected, recomputed, moved_ids, delta, local, scratch, pull, span, drift, extent = arrays[21:33]
    rows_at, picks_at, factor_u, factor_v, factors, picks = arrays[33:39]
    packed_at, tile_entry, entry_row, packed, packed_slope, places_at, places, order_at, order = arrays[39:48]
    touched, starts, slopes = arrays[48], arrays[50], dw.shape[0] > 0
    total = find_affected(moved_ids, delta, count, point_start, point_count, point_cell, hits, pull, affected)
    again = choose_recomputed(
        total, affected, hits, pull, differences, span, drift, rows, rows_at, slopes, limit, bias,
        MAX_DRIFT * extent[0], recomputed,
    )  # fmt: skip
    for q in range(count):
        i = moved_ids[q]
        dx, dy, dz = np.float32(delta[q, 0]), np.float32(delta[q, 1]), np.float32(delta[q, 2])
        for e in range(point_start[i], point_start[i] + point_count[i]):
            c = point_cell[e]
            if differences[c] >= 0 and packed_at[c] >= 0:
                add_packed_row(
                    tile_start[c], tile_start[c + 1], packed_at[c],
                    places_at[c] + point_row[e] * (tile_start[c + 1] - tile_start[c]), dx, dy, dz, slopes, tile_entry,
                    packed, packed_slope, places, touched, numerators,
                )  # fmt: skip
            elif differences[c] >= 0:
                row = rows_at[c] + point_row[e] if rows_at[c] >= 0 else -1
                add_row(
                    tile_start[c], tile_start[c + 1], at[c] + 8 * point_row[e], room[c] * 8, row, picks_at[c], dx, dy,
                    dz, slopes, value, slope, factor_u, factor_v, factors, picks, numerators,
                )  # fmt: skip
    for q in range(total):
        c = affected[q]
        if differences[c] == NOT_STORED:
            continue
        every = packed_at[c] < 0 or differences[c] == STORE
        if differences[c] == STORE:
            gather(points, ids, ids_at[c], rows[c], origin, c, local)
            store_numerators(
                tile_start[c], tile_start[c + 1], rows[c], at[c], room[c] * 8, rows_at[c], picks_at[c], slopes, value,
                slope, factor_u, factor_v, factors, picks, packed_at[c], tile_entry, entry_row, packed, packed_slope,
                local, starts, scratch, numerators,
            )  # fmt: skip
            differences[c] = 0
            span[c], drift[c] = largest(local, rows[c]), 0.0
        ox, oy, oz = np.float32(origin[c, 0]), np.float32(origin[c, 1]), np.float32(origin[c, 2])
        first, last = cell_start[c], cell_start[c + 1]
        finish_cell(
            first, last, tile_start[c], ox, oy, oz, sign, inv_w, dw, numerators, vertices, normals, order_at[c], order,
            every, touched, scratch,
        )  # fmt: skip
    if again > 0:
        compute_cells(table, recomputed, np.int64(0), again, sign, local, scratch, starts)
    return total


@nonallocating
def first_invalid(ids, rows, relative, points, farthest):
    """Return the first row with an id out of range (as ``-1 - row``), or one that leads to a number that is not finite
    or beyond ``farthest`` (``row``); or VALID."""
    n = points.shape[0]
    for q in range(ids.shape[0]):
        if ids[q] < 0 or ids[q] >= n:
            return -1 - q
    for q in range(ids.shape[0]):
        for c in range(3):
            x = rows[q, c] + points[ids[q], c] if relative else rows[q, c]
            if not abs(x) <= farthest:
                return q
    return VALID


@nonallocating
def store_positions(ids, rows, relative, points, moved_ids, delta):
    """Store new positions; ``moved_ids`` and ``delta`` get the points that really moved; returns their number."""
    count = 0
    for q in range(ids.shape[0]):
        i = ids[q]
        dx, dy, dz = rows[q, 0], rows[q, 1], rows[q, 2]
        if not relative:
            dx, dy, dz = dx - points[i, 0], dy - points[i, 1], dz - points[i, 2]
        if dx == 0.0 and dy == 0.0 and dz == 0.0:
            continue
        moved_ids[count] = i
        delta[count, 0], delta[count, 1], delta[count, 2] = dx, dy, dz
        if relative:
            points[i, 0] += dx
            points[i, 1] += dy
            points[i, 2] += dz
        else:
            points[i, 0], points[i, 1], points[i, 2] = rows[q, 0], rows[q, 1], rows[q, 2]
        count += 1
    return count


@nonallocating
def move_points(table, ids, rows, relative, most, limit, bias, gap, sign):
    """Move points and bring the mesh up to date: the whole of an update in one call.

    ``rows (k, 3)`` are new positions, or moves if ``relative``. Returns the number of vertex ranges in ``ranges``; -1
    if more than ``most`` points moved, -2 if the origins do not fit any more, and then everything is to be computed
    again; or what :func:`first_invalid` found, less REFUSED, and then nothing has been changed.
    """
    arrays = arrays_of(table)
    cell_start, points = arrays[0], arrays[13]
    found, _, affected, _, moved_ids, delta, _, _, _, _, _, extent = arrays[21:33]
    bad = first_invalid(ids, rows, relative, points, extent[3])
    if bad != VALID:
        return bad - REFUSED
    count = store_positions(ids, rows, relative, points, moved_ids, delta)
    if has_left(points, delta, count, extent):
        return -2
    if count > most:
        return -1
    total = update_cells(table, count, limit, bias, sign)
    return join_ranges(affected, total, cell_start, gap, found)
