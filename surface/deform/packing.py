"""Plain weights without rows of zeros: every tile of a packed cell lists the points that reach one of its vertices.

A cell's list is longer than that of any of its tiles, so a block holds many rows of eight zeros. A packed cell keeps,
tile after tile, the rows that are not all zero, and for each which point of the cell's list it belongs to. Its vertices
are put into tiles so that those of a tile share most of their points; ``order`` leads back to the mesh's order. Cells
that are packed get blocks of plain weights, in the mesh's order, before their weights or knots change.

Weights are fixed-point numbers of 24 bits, see :mod:`.fixed`, times a power of two for each vertex; kernels take the
numbers as they are, since they divide by the sum of these. Derivatives of weights are whole numbers of steps, one step
in u and one in v for each tile, so that they take half of the memory that every frame reads. Normals are directions, in
which a common factor of all derivatives does not show: kernels take these numbers as they are, too. Each is rounded up
or down so that together they change the derivatives of the surface as it is packed least; where control points lie
close together, those further away would change them most.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Bools, Floats, Floats32, Ints, Shorts
from surface.base.jit import kernel

from .fixed import power_of, put, room, take_all
from .lists import LANES, Lists

PLAIN = -1  # in ``packed_at``: the cell is not packed; in ``order_at``: its lanes follow the mesh's order
CANDIDATES = 64  # vertices, the next ones in the mesh's order, among which the next one of a tile is chosen
MAX_REMAINING = 0.97  # fraction of rows that reordering may leave; if it leaves more, vertices stay in order
MAX_STEPS = 32766  # of the largest derivative; rounding may add one, and 16 bits hold 32767
MIN_SLOPE = 1e-30  # a smaller largest one counts as 0: its step would leave the range of float32
ROUNDING_PASSES = 2  # of choosing how derivatives are rounded
MAX_ROWS = 1 << 16  # rows or vertices of a cell that can be packed: their numbers are uint16


@dataclass
class Packed:
    """The packed cells of a mesh. An entry is eight weights of one point.

    packed_at : (c,) int64, where every cell's tiles start in ``tile_entry``; PLAIN where the cell is not packed
    tile_entry : (t,) int64, where every tile's entries start; after a cell's last tile, where these end
    entry_row : (e,) uint16, the row of each entry's point in the cell's list
    packed : (:func:`.fixed.room` of e,) uint8, fixed-point numbers; packed_slope : (16 e,) int16 in steps, or empty
        for a mesh without normals
    places_at : (c,) int64, where every cell's rows start in ``places``
    places : (p,) uint16, by row and tile: the entry's number in its tile, from 1 on; 0 if there is none
    order_at : (c,) int64, where every cell's lanes start in ``order``; PLAIN where they follow the mesh's order
    order : (o,) uint16, the vertex of every lane, counted from the cell's first one
    slope_step : (t, 2) float32, the step of every tile's derivatives in u and in v; (0, 2) for a mesh without normals
    power : (8 t,) int16, the exponent of the power of two that belongs to the weights of every lane
    """

    packed_at: Ints
    tile_entry: Ints
    entry_row: np.ndarray
    packed: NDArray[np.uint8]
    packed_slope: Shorts
    places_at: Ints
    places: np.ndarray
    order_at: Ints
    order: np.ndarray
    slope_step: Floats32
    power: Shorts

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for array in vars(self).values())


class Order(NamedTuple):
    """How vertices are put into tiles: ``order (8 t,)`` uint16 is the vertex of every lane, counted from its cell's
    first one, ``moved (c,)`` where that is not the mesh's order, ``entries (c,)`` how many rows of tiles are not zero.
    """

    order: np.ndarray
    moved: Bools
    entries: Ints


def order_vertices(lists: Lists) -> Order:
    """Put the vertices of every cell into tiles that share points."""
    cells, tiles = len(lists.rows), int(lists.tile_start[-1])
    found = Order(np.zeros(LANES * tiles, np.uint16), np.zeros(cells, np.bool_), np.zeros(cells, np.int64))
    _order_cells(
        lists.cell_start,
        lists.tile_start,
        lists.rows,
        lists.at,
        lists.value,
        lists.slope,
        CANDIDATES,
        MAX_REMAINING,
        MAX_ROWS,
        *found,
    )
    return found


def pack(lists: Lists, order: Order, wanted: Bools, points: Floats) -> Packed:
    """Pack those of the ``wanted (c,)`` cells that have rows of zeros; ``points (n, 3)`` are the control points."""
    tiles = np.diff(lists.tile_start)
    blocks = lists.rows * tiles
    chosen = wanted & (order.entries < blocks) & (lists.rows < MAX_ROWS) & (np.diff(lists.cell_start) <= MAX_ROWS)
    entries, moved = int(order.entries[chosen].sum()), chosen & order.moved
    sloped, ends = len(lists.slope) > 0, int((tiles + 1)[chosen].sum())
    made = Packed(
        packed_at=_cell_starts(tiles + 1, chosen), tile_entry=np.zeros(ends, np.int64),
        entry_row=np.zeros(entries, np.uint16), packed=np.zeros(room(entries), np.uint8),
        packed_slope=np.zeros(2 * LANES * entries * sloped, np.int16),
        places_at=_cell_starts(blocks, chosen), places=np.zeros(int(blocks[chosen].sum()), np.uint16),
        order_at=_cell_starts(LANES * tiles, moved), order=order.order[np.repeat(moved, LANES * tiles)],
        slope_step=np.ones((ends * sloped, 2), np.float32), power=np.zeros(LANES * ends, np.int16),
    )  # fmt: skip
    _pack_cells(
        lists.cell_start, lists.tile_start, lists.rows, lists.at, lists.value, lists.slope, *vars(made).values()
    )
    if sloped:
        _round_slopes(
            lists.cell_start, lists.tile_start, lists.rows, lists.at, lists.ids_at, lists.ids, lists.value, lists.slope,
            made.packed_at, made.tile_entry, made.entry_row, made.packed_slope, made.order_at, made.order,
            made.slope_step, points,
        )  # fmt: skip
    return made


def _cell_starts(sizes: Ints, chosen: Bools) -> Ints:
    """Return (c,): where each of the ``chosen`` cells starts if they follow each other; PLAIN for the others."""
    held = np.where(chosen, sizes, 0)
    return np.where(chosen, np.cumsum(held) - held, PLAIN)


def unpack_cell(lists: Lists, made: Packed, c: int) -> list[Floats32]:
    """Return (tiles, rows, 8): b w of a packed cell, and (tiles, rows, 16) b_u w and b_v w if it has slopes, in the
    mesh's order."""
    rows, tiles = int(lists.rows[c]), int(lists.tile_start[c + 1] - lists.tile_start[c])
    size = int(lists.cell_start[c + 1] - lists.cell_start[c])
    first, at = int(made.packed_at[c]), int(made.order_at[c])
    starts = made.tile_entry[first : first + tiles + 1]
    which = slice(int(starts[0]), int(starts[-1]))
    tile = np.repeat(np.arange(tiles), np.diff(starts))
    row = made.entry_row[which].astype(np.int64)
    lanes = made.order[at : at + size].astype(np.int64) if at >= 0 else np.arange(size)
    weights = take_all(made.packed, which.start, which.stop)
    power = made.power.reshape(-1, LANES)[first : first + tiles]
    tables = [np.ldexp(weights, power[tile])[:, None]]
    if len(made.slope_step):
        slopes = made.packed_slope.reshape(-1, 2, LANES)[which]
        tables.append(slopes * made.slope_step[first : first + tiles][tile, :, None])
    blocks = []
    for entries in tables:
        wide = entries.shape[1]
        own = np.zeros((rows, wide, tiles, LANES), np.float32)
        own[row, :, tile] = entries
        flat = own.reshape(rows, wide, -1)
        back = np.zeros_like(flat)
        back[..., lanes] = flat[..., :size]
        blocks.append(back.reshape(rows, wide, tiles, LANES).transpose(2, 0, 1, 3).reshape(tiles, rows, -1))
    return blocks


@kernel
def _mark_points(size, rows, at, value, slope, masks):
    """Set bit k of ``masks[s]`` if point k of a cell with a block at ``at`` influences its vertex s.

    Returns the number of set bits."""
    count = 0
    for s in range(size):
        masks[s] = 0
        start = at + (s // 8) * rows * 8
        for k in range(rows):
            w = start + 8 * k
            j = s % 8
            found = value[w + j] != 0.0
            if slope.shape[0] > 0:
                found = found or slope[2 * w + j] != 0.0 or slope[2 * w + 8 + j] != 0.0
            if found:
                masks[s, k >> 6] |= np.uint64(1) << np.uint64(k & 63)
                count += 1
    return count


@kernel
def _count_bits(word):
    """Return how many bits of a number are set (Warren, Hacker's Delight 5-1)."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def _count_entries(size, masks, order, union):
    """Return how many rows of tiles of eight vertices in the given order are not all zero."""
    count = 0
    for first in range(0, size, 8):
        union[:] = 0
        for j in range(first, min(first + 8, size)):
            union |= masks[order[j]]
        for word in union:
            count += _count_bits(word)
    return count


@kernel
def _next_vertex(masks, union, left, choice):
    """Return which of the first ``choice`` of the vertices ``left`` adds fewest points to the ``union`` of a tile, and
    shares most with it."""
    best, found = 1 << 60, 0
    for q in range(min(choice, len(left))):
        more, common = 0, 0
        for k in range(len(union)):
            word = masks[left[q], k]
            more += _count_bits(word & ~union[k])
            common += _count_bits(word & union[k])
        if (more << 20) - common < best:
            best, found = (more << 20) - common, q
    return found


@kernel
def _arrange(size, masks, choice, union, left, order):
    """Order the vertices of a cell: a tile starts with the first one left and takes those that fit it best."""
    for s in range(size):
        left[s] = s
    for s in range(size):
        at = s
        if s % 8 == 0:
            union[:] = 0
        else:
            at += _next_vertex(masks, union, left[s:size], choice)
        vertex = left[at]
        for q in range(at, s, -1):
            left[q] = left[q - 1]
        order[s] = vertex
        union |= masks[vertex]


@kernel
def _order_cells(cell_start, tile_start, rows, at, value, slope, choice, worth, most, order, moved, entries):
    """Fill the arrays of :class:`Order`; cells of more than ``most`` vertices are left as they are."""
    widest, words = 1, 1
    for c in range(rows.shape[0]):
        widest, words = max(widest, cell_start[c + 1] - cell_start[c]), max(words, (rows[c] + 63) >> 6)
    all_masks, left = np.zeros((widest, words), np.uint64), np.zeros(widest, np.int64)
    same, other = np.arange(widest), np.zeros(widest, np.int64)
    for c in range(rows.shape[0]):
        size, wide = cell_start[c + 1] - cell_start[c], (rows[c] + 63) >> 6
        masks, union = all_masks[:, :wide], np.zeros(wide, np.uint64)
        reached = _mark_points(size, rows[c], at[c], value, slope, masks)
        entries[c] = _count_entries(size, masks, same, union)
        chosen = same
        if size <= most and reached < rows[c] * size:
            _arrange(size, masks, choice, union, left, other)
            count = _count_entries(size, masks, other, union)
            if count <= worth * entries[c]:
                entries[c], moved[c], chosen = count, True, other
        for s in range(size):
            order[8 * tile_start[c] + s] = chosen[s]


@kernel
def _read_row(first, count, k, rows, at, value, slope, order_at, order, own):
    """Copy b w, b_u w and b_v w of point k in ``count`` lanes from ``first`` to ``own (3, 8)``; is any not 0?"""
    own[:] = 0.0
    for j in range(count):
        s = np.int64(order[order_at + first + j]) if order_at >= 0 else first + j
        w = at + ((s // 8) * rows + k) * 8
        own[0, j] = value[w + s % 8]
        if slope.shape[0] > 0:
            own[1, j], own[2, j] = slope[2 * w + s % 8], slope[2 * w + 8 + s % 8]
    return own.any()


@kernel
def _choose_steps(first, count, rows, at, slope, order_at, order, step):
    """Set ``step (2,)`` so that the largest derivatives in u and in v of ``count`` lanes from ``first`` are MAX_STEPS
    of them; 1 where all are zero."""
    most_u, most_v = 0.0, 0.0
    for j in range(first, first + count):
        s = np.int64(order[order_at + j]) if order_at >= 0 else j
        for k in range(rows):
            w = 2 * (at + ((s // 8) * rows + k) * 8) + s % 8
            most_u, most_v = max(most_u, abs(slope[w])), max(most_v, abs(slope[w + 8]))
    step[0] = most_u / MAX_STEPS if most_u > MIN_SLOPE else 1.0
    step[1] = most_v / MAX_STEPS if most_v > MIN_SLOPE else 1.0


@kernel
def _choose_powers(first, count, rows, at, value, order_at, order, power):
    """Set ``power (8,)`` for ``count`` lanes from ``first`` by the greatest weight of each."""
    for j in range(count):
        s, most = np.int64(order[order_at + first + j]) if order_at >= 0 else first + j, 0.0
        for k in range(rows):
            most = max(most, abs(value[at + ((s // 8) * rows + k) * 8 + s % 8]))
        power[j] = power_of(most)


@kernel
def _pack_cells(
    cell_start, tile_start, rows, at, value, slope, packed_at, tile_entry, entry_row, packed, packed_slope, places_at,
    places, order_at, order, slope_step, power,
):  # fmt: skip
    """Fill the arrays of :class:`Packed` from the blocks of cells."""
    e, own, unit = 0, np.zeros((3, 8), np.float32), np.ones(2, np.float32)
    for c in range(rows.shape[0]):
        if packed_at[c] < 0:
            continue
        size, tiles = cell_start[c + 1] - cell_start[c], tile_start[c + 1] - tile_start[c]
        for t in range(tiles):
            tile_entry[packed_at[c] + t] = first = e
            step = slope_step[packed_at[c] + t] if slope.shape[0] > 0 else unit
            own_power, count = power[8 * (packed_at[c] + t) :], min(8, size - 8 * t)
            _choose_powers(8 * t, count, rows[c], at[c], value, order_at[c], order, own_power)
            if slope.shape[0] > 0:
                _choose_steps(8 * t, count, rows[c], at[c], slope, order_at[c], order, step)
            for k in range(rows[c]):
                if not _read_row(8 * t, count, k, rows[c], at[c], value, slope, order_at[c], order, own):
                    continue
                for j in range(8):
                    put(packed, e, j, own[0, j] * 2.0 ** -np.int64(own_power[j]))
                if slope.shape[0] > 0:
                    for j in range(8):
                        packed_slope[16 * e + j] = np.int16(np.rint(own[1, j] / step[0]))
                        packed_slope[16 * e + 8 + j] = np.int16(np.rint(own[2, j] / step[1]))
                entry_row[e] = k
                e += 1
                places[places_at[c] + k * tiles + t] = e - first
        tile_entry[packed_at[c] + tiles] = e


@kernel
def _round_slopes(
    cell_start, tile_start, rows, at, ids_at, ids, value, slope, packed_at, tile_entry, entry_row, packed_slope,
    order_at, order, slope_step, points,
):  # fmt: skip
    """Round the derivatives of all packed cells so that those of the surface with ``points (n, 3)`` change least."""
    for c in range(rows.shape[0]):
        if packed_at[c] < 0:
            continue
        places, away = np.empty((rows[c], 3)), np.empty((rows[c], 3))
        for k in range(rows[c]):
            places[k] = points[ids[ids_at[c] + k]]
        for lane in range(cell_start[c + 1] - cell_start[c]):
            t = packed_at[c] + lane // 8
            s = np.int64(order[order_at[c] + lane]) if order_at[c] >= 0 else lane
            w = at[c] + (s // 8) * rows[c] * 8 + s % 8
            _from_vertex(w, entry_row[tile_entry[t] : tile_entry[t + 1]], value, places, away)
            for q in range(2):
                _round_vertex(
                    2 * w - s % 8 + 8 * q, lane % 8 + 8 * q, tile_entry[t], tile_entry[t + 1], slope_step[t, q], slope,
                    entry_row, packed_slope, away,
                )  # fmt: skip


@kernel
def _from_vertex(w, used, value, places, away):
    """Write those of ``places (rows, 3)`` of a cell's points that are ``used (k,)``, from the vertex whose weights
    start at ``w``, eight apart, to ``away (rows, 3)``."""
    total = 0.0
    for k in used:
        total += value[w + 8 * np.int64(k)]
    for c in range(3):
        middle = 0.0
        for k in used:
            if total > 0.0:  # else the mesh is refused later
                middle += value[w + 8 * np.int64(k)] / total * places[k, c]
        for k in used:
            away[k, c] = places[k, c] - middle


@kernel
def _round_vertex(w, lane, first, end, step, slope, entry_row, packed_slope, away):
    """Round the derivatives of one vertex in one direction, whose entries are ``first`` to ``end``, so that the sum of
    their errors times ``away (rows, 3)`` is short; ``w`` : where they start in ``slope``, sixteen apart."""
    x, y, z = 0.0, 0.0, 0.0
    for e in range(first, end):
        k = np.int64(entry_row[e])
        error = step * packed_slope[16 * e + lane] - slope[w + 16 * k]
        x, y, z = x + error * away[k, 0], y + error * away[k, 1], z + error * away[k, 2]
    for _ in range(ROUNDING_PASSES):
        for e in range(first, end):
            k = np.int64(entry_row[e])
            error = step * packed_slope[16 * e + lane] - slope[w + 16 * k]
            turn = -step if error > 0.0 else step
            nx, ny, nz = x + turn * away[k, 0], y + turn * away[k, 1], z + turn * away[k, 2]
            if error != 0.0 and nx * nx + ny * ny + nz * nz < x * x + y * y + z * z:
                packed_slope[16 * e + lane] += -1 if error > 0.0 else 1
                x, y, z = nx, ny, nz
