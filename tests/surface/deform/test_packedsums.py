"""Sums over packed weights against the same sums term by term in float64, and where vertices are written."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numba import njit

from surface.deform import packedsums
from surface.deform.fixed import take_all
from surface.spline import lanes


def entries(count: int, rows: int = 12) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Weights (24 k,) uint8, k even, and slopes (16 k,) int16 of so many entries, the row of each, and places of the
    rows (rows + 1, 3)."""
    rng = np.random.default_rng(count)
    slopes = rng.integers(-9, 10, 16 * count).astype(np.int16)
    weights = rng.integers(0, 256, 24 * count).astype(np.uint8)
    weights.reshape(-1, 48)[:, 1:32:2] = rng.choice([0, 255], (count // 2, 16))  # from -256 to 256
    return weights, slopes, rng.integers(0, rows, count).astype(np.uint16), rng.normal(size=(rows + 1, 3)).astype("f4")


def made(sum_all):
    """A kernel that writes ``values (24,)`` of :func:`sum_packed` and ``everything (72,)`` of ``sum_all``."""

    @njit
    def run(packed, packed_slope, entry_row, first, end, local, values, everything):
        packedsums.store3(values, 0, *packedsums.sum_packed(packed, entry_row, first, end, local))
        x, y, z, ax, ay, az, bx, by, bz = sum_all(packed, packed_slope, entry_row, first, end, local)
        packedsums.store3(everything, 0, x, y, z)
        packedsums.store3(everything, 24, ax, ay, az)
        packedsums.store3(everything, 48, bx, by, bz)

    return run


SUMS = [made(packedsums._sum_singly), made(packedsums._sum_in_pairs)]


def test_pairs_are_used_where_a_register_holds_one() -> None:
    wanted = packedsums._sum_in_pairs if lanes.PAIRS_FAST else packedsums._sum_singly
    assert packedsums.sum_all_packed is wanted


@pytest.mark.parametrize("run_sums", SUMS)
@pytest.mark.parametrize(("first", "end"), [(0, 0), (1, 1), (0, 1), (2, 5), (1, 5), (0, 9), (3, 14)])
def test_a_tile_sums_its_own_entries(first: int, end: int, run_sums: Callable[..., None]) -> None:
    """Two or four at a time and the rest one by one, from none to several, beginning with either of two."""
    weights, slopes, row, local = entries(14)
    values, everything = np.full(24, np.nan, np.float32), np.full(72, np.nan, np.float32)
    run_sums(weights, slopes, row, first, end, local, values, everything)
    places = local[row[first:end]].astype(np.float64)
    own = take_all(weights, first, end).astype(np.float64)
    along = slopes[16 * first : 16 * end].reshape(-1, 2, 8).astype(np.float64)
    wanted = np.stack([each.T @ places for each in (own, along[:, 0], along[:, 1])])  # (3, 8, 3)
    wanted[0] /= 256.0
    values, everything[:24] = values / 256.0, everything[:24] / 256.0
    np.testing.assert_allclose(values.reshape(8, 3), wanted[0], atol=5e-6)
    np.testing.assert_allclose(everything.reshape(3, 8, 3), wanted, atol=1e-5)


@njit
def run_write(out, first, last, vertex, at, order, xyz, scratch):
    """Write lanes whose coordinates are ``xyz (3, 8)``."""
    x, y, z = packedsums.load(xyz, 0), packedsums.load(xyz, 8), packedsums.load(xyz, 16)
    packedsums.write_lanes(out, first, last, vertex, at, order, x, y, z, scratch)


@pytest.mark.parametrize("size", [8, 16, 5, 13, 1])
@pytest.mark.parametrize("ordered", [False, True])
def test_lanes_are_written_to_their_vertices_and_nowhere_else(size: int, ordered: bool) -> None:
    first, before = 3, 2  # vertices of other cells, and lanes of other cells in the order
    rng = np.random.default_rng(size)
    order = np.concatenate([np.full(before, 9), rng.permutation(size)]).astype(np.uint16)
    places, scratch = rng.normal(size=(size, 3)).astype(np.float32), np.zeros(24, np.float32)
    out = np.full((first + size + 8, 3), -7.0, np.float32)
    for lane in range(0, size, 8):
        vector = np.zeros((3, 8), np.float32)
        vector[:, : min(8, size - lane)] = places[lane : lane + 8].T
        at = before if ordered else -1
        run_write(out.ravel(), first, first + size, first + lane, at, order, vector.ravel(), scratch)
    wanted = np.full_like(out, -7.0)
    wanted[first + (order[before:].astype(int) if ordered else np.arange(size))] = places
    np.testing.assert_array_equal(out, wanted)


@njit
def run_row(first, end, at, place, d, slopes, tile_entry, packed, packed_slope, places, touched, numerators):
    packedsums.add_packed_row(
        first, end, at, place, d[0], d[1], d[2], slopes, tile_entry, packed, packed_slope, places, touched, numerators
    )  # fmt: skip


@pytest.mark.parametrize("slopes", [False, True])
def test_a_difference_is_added_in_the_tiles_that_its_point_reaches(slopes: bool) -> None:
    """Eq. (2): numerators grow by b w dP. The point is the second entry of the first tile, none of the second and the
    first of the third."""
    weights, along, _, _ = entries(10)
    tile_entry = np.array([0, 1, 3, 7, 9])  # the cell's tiles follow one of another cell
    places = np.array([5, 2, 0, 1], np.uint16)
    size, d = 72 if slopes else 24, np.array([0.5, -2.0, 3.0], np.float32)
    numerators, touched = np.ones(7 * size, np.float32), np.zeros(7, np.uint8)
    run_row(3, 6, 1, 1, d, slopes, tile_entry, weights, along, places, touched, numerators)
    assert touched.tolist() == [0, 0, 0, 1, 0, 1, 0]
    wanted = np.ones((7, size // 24, 3, 8))
    for tile, entry in ((3, 1 + 1), (5, 7)):
        kinds = [*take_all(weights, entry, entry + 1), *along[16 * entry : 16 * entry + 16].reshape(2, 8)]
        for k in range(size // 24):
            wanted[tile, k] += d[:, None] * kinds[k]
    np.testing.assert_allclose(numerators.reshape(wanted.shape), wanted, rtol=1e-5, atol=1e-6)
