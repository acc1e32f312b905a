"""Weights of cells as products of factors in u and in v, which take less memory than the weights themselves.

A weight is b(u) b(v) w. The vertices of a cell share most of their coordinates, so a control point has few different
factors b(u) w and b(v) there. They are stored once for each different coordinate, in ascending order, with their slopes
after them; equal rows of different cells and points are stored once. A tile picks its eight factors from a window of
eight, so that the order of vertices does not matter. A cell keeps plain weights where these are cheaper or a tile's
coordinates fit no window.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg"
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats32, Ints
from surface.base.jit import kernel
from surface.mesh.mesh import Mesh
from surface.spline.kernels import blend_along, distinct
from surface.spline.lanes import PICKS_FAST

from .groupsums import HEAD, STEP
from .lists import LANES, Basis, Lists, cells_by_point

PLAIN = -1  # in ``rows_at``: the cell has plain weights
# Operations of factors relative to plain weights, without and with normals, beyond which factors are slower (measured
# on sheets and heads; they read less memory).
MAX_COST = 1.0, 1.5
MAX_WHOLE = 3.0  # numbers in rows of whole windows relative to rows in ascending order
MAX_NUMBERS = 1 << 30  # numbers that are stored as factors; further cells keep plain weights
MIX = 0x9E3779B1  # multiplier of the hash (Knuth, The Art of Computer Programming 6.4)


@dataclass
class Factors:
    """The factors of a mesh's cells.

    rows_at : (c,) int64, where every cell's rows start in ``factor_u`` and ``factor_v``; PLAIN without factors
    picks_at : (c,) int64, where every cell's picks start in ``picks``
    factor_u, factor_v : (k,) int32, where the factors of a cell's rows start in ``factors``
    factors : (f,) float32: those of a row in ascending order of their coordinates, or of lanes where tiles take whole
        windows, then as many slopes if there are any
    picks : (p,) int32: how many factors the rows of a cell have in u and in v, and 1 if its tiles take whole windows,
        else 0; then, by tile, which of a window's eight the lanes take in u, which in v, and where the windows start
    slopes : are there any?
    sums : how many numbers of scratch space a kernel needs
    """

    rows_at: Ints
    picks_at: Ints
    factor_u: np.ndarray
    factor_v: np.ndarray
    factors: np.ndarray
    picks: np.ndarray
    slopes: bool = False
    sums: int = LANES * 3

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray))


def no_factors(cells: int) -> Factors:
    """Return empty factors of that many cells, all with plain weights."""
    single = np.zeros(0, np.int32)
    return Factors(np.full(cells, PLAIN), np.zeros(cells, np.int64), single, single, np.zeros(0, np.float32), single)


def factorize(
    basis: Basis, lists: Lists, mesh: Mesh, entries: Ints | None = None, cost: tuple[float, float] = MAX_COST
) -> Factors:
    """Find factors of cells where these need at most ``cost`` times as many operations as weights, see
    :data:`MAX_COST`.

    entries : (c,) rows of eight weights that a cell needs without factors; as many as its block has if not given
        The lists of points of such cells are sorted; their blocks stay, see :mod:`.storage`.
    """
    cells, listed = len(lists.rows), len(lists.ids)
    made = no_factors(cells)
    if not PICKS_FAST or not cells:
        return made
    tiles, slopes = np.diff(lists.tile_start), len(lists.slope) > 0
    factor_u, factor_v = np.zeros(listed, np.int32), np.zeros(listed, np.int32)
    entries = lists.rows * tiles if entries is None else entries
    factors = np.zeros(len(lists.value) + len(lists.slope), np.float32)
    picks = np.zeros(HEAD * cells + STEP * int(tiles.sum()), np.int32)
    *used, room = _factor_cells(
        *basis.knots, *basis.degrees, basis.weights, mesh.uv, mesh.side, lists.cell_start, lists.tile_start, lists.rows,
        lists.ids_at, lists.ids, entries, slopes, cost[slopes], int(tiles.max()), made.rows_at, made.picks_at, factor_u,
        factor_v, factors, picks, _make_slots(2 * listed), _make_slots(cells),
    )  # fmt: skip
    by_point = cells_by_point(lists.ids, lists.rows, len(lists.point_start))
    lists.point_start, lists.point_count, lists.point_cell, lists.point_row = by_point
    arrays = zip((factor_u, factor_v, factors, picks), used, strict=True)
    u, v, *others = (array[:count].copy() for array, count in arrays)
    return Factors(made.rows_at, made.picks_at, u, v, others[0], others[1], slopes, made.sums + room)


def _make_slots(entries: int) -> Ints:
    """Return an empty hash table, at most half of which so many entries fill."""
    return np.zeros(1 << (2 * entries).bit_length(), np.int64)


def expand_factors(factors: Factors, lists: Lists, c: int) -> list[Floats32]:
    """Return (tiles, rows, 8): b w of a cell with factors, and (tiles, rows, 16) b_u w and b_v w if it has slopes."""
    rows, tiles = int(lists.rows[c]), int(lists.tile_start[c + 1] - lists.tile_start[c])
    head, first = factors.picks_at[c], factors.rows_at[c]
    wide, picks = factors.picks[head : head + HEAD], factors.picks[head + HEAD : head + HEAD + STEP * tiles]
    of_tile = picks.reshape(tiles, 1, STEP)
    along_u, along_v = (
        table[first : first + rows, None] + of_tile[..., 16 + k : 17 + k] + of_tile[..., 8 * k : 8 * k + 8]
        for k, table in enumerate((factors.factor_u, factors.factor_v))
    )
    a, b = factors.factors[along_u], factors.factors[along_v]
    blocks = [a * b]
    if factors.slopes:
        u, v = factors.factors[along_u + wide[0]], factors.factors[along_v + wide[1]]
        blocks.append(np.concatenate([u * b, a * v], axis=2))
    filled = int(lists.cell_start[c + 1] - lists.cell_start[c]) - LANES * (tiles - 1)
    for block in blocks:
        block.reshape(tiles, rows, -1, LANES)[-1, ..., filled:] = 0.0
    return blocks


@kernel
def _sort_distinct(uv, side, axis, values, rank, order):
    """Write distinct coordinates of a cell's vertices, ascending, into ``values (k, 2)``, and each vertex's place among
    them into ``rank``; returns how many there are."""
    count = distinct(uv, side, axis, values, rank)
    before = values[:count].copy()
    for k in range(count):
        order[k] = 0
        for other in range(count):
            low, high = before[other, 0], before[k, 0]
            order[k] += low < high or (low == high and before[other, 1] < before[k, 1])
        values[order[k]] = before[k]
    for s in range(uv.shape[0]):
        rank[s] = order[rank[s]]
    return count


@kernel
def _put_windows(rank, size, wide, axis, tiles, picks):
    """Write which of a window's eight every lane takes, and where windows start; False where one is too narrow."""
    for t in range(tiles):
        low, high = rank[8 * t], rank[8 * t]
        for s in range(8 * t, min(8 * t + 8, size)):
            low, high = min(low, rank[s]), max(high, rank[s])
        low = min(low, wide - 8)
        if high - low > 7:
            return False
        at = HEAD + STEP * t
        picks[at + 16 + axis] = low
        for j in range(8):
            picks[at + 8 * axis + j] = rank[8 * t + j] - low if 8 * t + j < size else 0
    picks[axis] = wide
    return True


@kernel
def _intern_row(row, size, table, used, slots):
    """Return the place of ``row[:size]`` in ``table``, where it is added at ``used`` if it is new; both int32."""
    total, last = np.uint32(size), slots.shape[0] - 1
    for k in range(size):
        total = np.uint32((total ^ np.uint32(row[k])) * np.uint32(MIX))
        total ^= total >> np.uint32(15)
    slot = np.int64(total) & last
    while slots[slot] > 0:
        place, same = slots[slot] - 1, slots[slot] - 1 + size <= used
        k = 0
        while same and k < size:
            same = table[place + k] == row[k]
            k += 1
        if same:
            return place
        slot = (slot + 1) & last
    slots[slot] = used + 1
    table[used : used + size] = row[:size]
    return used


@kernel
def _put_whole_windows(rank, size, axis, tiles, ranks, picks):
    """Write the different windows of eight that tiles take, lane by lane, into ``ranks (8 k)``, and which of them each
    tile takes into ``picks``; returns 8 k.
    """
    count = 0
    for t in range(tiles):
        for j in range(8):
            ranks[8 * count + j] = rank[min(8 * t + j, size - 1)]
        k = 0
        while not (ranks[8 * k : 8 * k + 8] == ranks[8 * count : 8 * count + 8]).all():
            k += 1
        count = max(count, k + 1)
        at = HEAD + STEP * t
        picks[at + 16 + axis] = 8 * k
        for j in range(8):
            picks[at + 8 * axis + j] = j
    picks[axis] = 8 * count
    return 8 * count


@kernel
def _factor_row(knots, i, p, values, many, ranks, wide, weight, slopes, work, numbers, row):
    """One point's factors, times its weight, in ``row``: those of the coordinates with ``ranks (<= wide)``, then zeros
    up to ``wide``."""
    blend_along(knots, i, p, values, many, True, work, numbers)
    row[:] = 0.0
    for k in range(len(ranks)):
        row[k] = numbers[ranks[k], 0] * weight
        if slopes:
            row[wide + k] = numbers[ranks[k], 1] * weight


@kernel
def _sort_rows(keys, ids):
    """Sort ``keys (k,)`` and the points ``ids (k,)`` along with them; returns how many keys differ."""
    for k in range(1, len(keys)):
        key, i, q = keys[k], ids[k], k
        while q > 0 and keys[q - 1] > key:
            keys[q], ids[q] = keys[q - 1], ids[q - 1]
            q -= 1
        keys[q], ids[q] = key, i
    groups = 1
    for k in range(1, len(keys)):
        groups += keys[k] != keys[k - 1]
    return groups


@kernel
def _count_operations(rows, groups, tiles, wide_u, whole, slopes):
    """Return how many operations on eight numbers a cell takes with factors."""
    if slopes:
        return 6 * rows * (wide_u // 8) + (14 if whole else 17) * groups * tiles
    return 3 * rows * (wide_u // 8) + (4 if whole else 7) * groups * tiles


@kernel
def _count_groups(knots, degrees, points):
    """Return how many different knots the ``points (k,)`` have, and so at most how many different factors."""
    groups = 0
    for k in range(len(points)):
        i, new = points[k], True
        for q in range(k):
            j = points[q]
            if degrees[i] == degrees[j] and (knots[i, : degrees[i] + 2] == knots[j, : degrees[j] + 2]).all():
                new = False
                break
        groups += new
    return groups


@kernel
def _factor_cells(
    knots_u, knots_v, pu, pv, weights, uv, side, cell_start, tile_start, rows, ids_at, ids, entries, slopes, cost, most,
    rows_at, picks_at, factor_u, factor_v, factors, picks, slots, pick_slots,
):  # fmt: skip
    """Fill the arrays of :class:`Factors`; returns how much of the last four is used, and the room for sums."""
    widest, used, each, scratch = 8 * most, np.zeros(3, dtype=np.int64), 1 + slopes, 0
    rank_u, rank_v, order = np.zeros(widest, np.int64), np.zeros(widest, np.int64), np.zeros(widest, np.int64)
    lanes_u, lanes_v, ascending = np.zeros(widest, np.int64), np.zeros(widest, np.int64), np.arange(widest)
    values_u, values_v, numbers = np.zeros((widest, 2)), np.zeros((widest, 2)), np.zeros((widest, 2))
    row, work = np.zeros(2 * widest, np.float32), np.zeros(12)
    own_picks, picks_whole = np.zeros(HEAD + STEP * most, np.int32), np.zeros(HEAD + STEP * most, np.int32)
    picks_whole[2] = 1
    bits, table = row.view(np.int32), factors.view(np.int32)
    for c in range(rows.shape[0]):
        first, last, tiles, at = cell_start[c], cell_start[c + 1], tile_start[c + 1] - tile_start[c], used[0]
        cell_uv, sides, size = uv[first:last], side[first:last], last - first
        many_u = _sort_distinct(cell_uv, sides, 0, values_u, rank_u, order)
        many_v = _sort_distinct(cell_uv, sides, 1, values_v, rank_v, order)
        points = ids[ids_at[c] : ids_at[c] + rows[c]].copy()
        groups = _count_groups(knots_v, pv, points)
        wide_u, wide_v = (many_u + 7) // 8 * 8, (many_v + 7) // 8 * 8
        ranks_u, ranks_v = ascending[:many_u], ascending[:many_v]
        own, plain = own_picks, (9 if slopes else 3) * entries[c]
        fits = _put_windows(rank_u, size, wide_u, 0, tiles, own) and _put_windows(rank_v, size, wide_v, 1, tiles, own)
        operations = _count_operations(rows[c], groups, tiles, wide_u, False, slopes)
        fits = fits and operations <= cost * plain
        limit = min(min(cost, 1.0) * plain, operations if fits else plain)
        whole_u = _put_whole_windows(rank_u, size, 0, tiles, lanes_u, picks_whole)
        whole_v = _put_whole_windows(rank_v, size, 1, tiles, lanes_v, picks_whole)
        few = whole_u + whole_v <= MAX_WHOLE * (wide_u + wide_v)
        whole = few and _count_operations(rows[c], groups, tiles, whole_u, True, slopes) <= limit
        if whole:
            fits, wide_u, wide_v, own = True, whole_u, whole_v, picks_whole
            ranks_u, ranks_v = lanes_u[:whole_u], lanes_v[:whole_v]
        if not fits or used[1] + each * (wide_u + wide_v) * rows[c] > min(MAX_NUMBERS, len(factors)):
            continue
        for k in range(rows[c]):
            i = points[k]
            _factor_row(knots_v, i, pv[i], values_v, many_v, ranks_v, wide_v, 1.0, slopes, work, numbers, row)
            factor_v[at + k] = _intern_row(bits, each * wide_v, table, used[1], slots)
            used[1] = max(used[1], factor_v[at + k] + each * wide_v)
        groups = _sort_rows(factor_v[at : at + rows[c]], points)
        for k in range(rows[c]):
            i = ids[ids_at[c] + k] = points[k]
            _factor_row(knots_u, i, pu[i], values_u, many_u, ranks_u, wide_u, weights[i], slopes, work, numbers, row)
            factor_u[at + k] = _intern_row(bits, each * wide_u, table, used[1], slots)
            used[1] = max(used[1], factor_u[at + k] + each * wide_u)
        picks_at[c] = _intern_row(own, HEAD + STEP * tiles, picks, used[2], pick_slots)
        used[2] = max(used[2], picks_at[c] + HEAD + STEP * tiles)
        rows_at[c] = at
        used[0] += rows[c]
        scratch = max(scratch, 3 * each * groups * wide_u)
    return used[0], used[0], used[1], used[2], scratch
