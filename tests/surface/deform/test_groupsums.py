"""Factorized sums over points against the same sums term by term in float64."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

from surface.deform import groupsums
from surface.deform.groupsums import HEAD, STEP

TILES = 2
SHIFT = 3  # rows of other cells before those of the cell


class Cell(NamedTuple):
    """The factors of one cell of random points, as :class:`surface.deform.factors.Factors` has them."""

    factors: np.ndarray
    factor_u: np.ndarray
    factor_v: np.ndarray
    picks: np.ndarray
    local: np.ndarray
    rows: int
    wide_u: int
    wide_v: int

    def along(self, table: np.ndarray, axis: int, shift: int) -> np.ndarray:
        """(tiles, rows, 8) float64: the numbers that lanes pick from every point's factors, ``shift`` further on."""
        starts, tiles = table[SHIFT : SHIFT + self.rows], self.picks[HEAD:].reshape(TILES, STEP)
        at = tiles[:, None, 8 * axis : 8 * axis + 8] + tiles[:, None, 16 + axis, None] + starts[None, :, None]
        return self.factors[at + shift].astype(np.float64)

    def sums(self) -> np.ndarray:
        """(tiles, 9, 8): by tile the sums of b w, of b_u w and of b_v w times x, y and z."""
        a, b = self.along(self.factor_u, 0, 0), self.along(self.factor_v, 1, 0)
        u, v = self.along(self.factor_u, 0, self.wide_u), self.along(self.factor_v, 1, self.wide_v)
        places = self.local[: self.rows].astype(np.float64)
        return np.concatenate([np.einsum("trj,rc->tcj", one, places) for one in (a * b, u * b, a * v)], axis=1)


def made_cell(groups: tuple[int, ...], wide_u: int = 16, wide_v: int = 24, whole: bool = False) -> Cell:
    """A cell with so many points in each group; points of a group share their factors in v.

    whole : its tiles take whole windows of eight.
    """
    rng, rows = np.random.default_rng(sum(groups)), sum(groups)
    factors = rng.normal(size=2 * wide_u * rows + 2 * wide_v * len(groups)).astype(np.float32)
    factor_u = 2 * wide_u * rng.permutation(rows)
    factor_v = 2 * wide_u * rows + 2 * wide_v * np.repeat(np.arange(len(groups)), groups)
    picks = np.zeros(HEAD + STEP * TILES, np.int32)
    picks[:HEAD] = wide_u, wide_v, whole
    for tile in picks[HEAD:].reshape(TILES, STEP):
        tile[:16] = np.tile(np.arange(8), 2) if whole else rng.integers(0, 8, 16)
        tile[16:] = (
            8 * rng.integers(0, [wide_u // 8, wide_v // 8]) if whole else rng.integers(0, [wide_u - 7, wide_v - 7])
        )
    other = np.full(SHIFT, -1)
    rows_u, rows_v = (np.concatenate([other, k]).astype(np.int32) for k in (factor_u, factor_v))
    return Cell(factors, rows_u, rows_v, picks, rng.normal(size=(rows + 1, 3)).astype(np.float32), rows, wide_u, wide_v)


@njit
def run_groups(factors, factor_u, factor_v, picks, local, rows, wide_u, wide_v, slopes, starts, scratch, out):
    """Both halves of the sum; ``out (tiles, 72)``. Returns how many groups there are."""
    whole = groupsums.takes_whole(0, 0, picks)
    groups = groupsums.sum_groups(
        factors, factor_u, factor_v, SHIFT, rows, wide_u, whole, slopes, local, starts, scratch
    )
    for tile in range(TILES):
        at = HEAD + STEP * tile
        if slopes:
            sums = groupsums.join_all(groups, wide_u, wide_v, whole, at, factors, picks, starts, scratch)
            groupsums.store(out, 72 * tile + 24, sums[3])
            groupsums.store(out, 72 * tile + 32, sums[4])
            groupsums.store(out, 72 * tile + 40, sums[5])
            groupsums.store(out, 72 * tile + 48, sums[6])
            groupsums.store(out, 72 * tile + 56, sums[7])
            groupsums.store(out, 72 * tile + 64, sums[8])
            groupsums.store(out, 72 * tile, sums[0])
            groupsums.store(out, 72 * tile + 8, sums[1])
            groupsums.store(out, 72 * tile + 16, sums[2])
        else:
            x, y, z = groupsums.join_values(groups, wide_u, whole, at, factors, picks, starts, scratch)
            groupsums.store(out, 72 * tile, x)
            groupsums.store(out, 72 * tile + 8, y)
            groupsums.store(out, 72 * tile + 16, z)
    return groups


@pytest.mark.parametrize("slopes", [False, True])
@pytest.mark.parametrize("groups", [(1,), (4, 1, 2), (1, 1, 1, 1, 1), (9,)])
@pytest.mark.parametrize(("whole", "wide_u"), [(False, 16), (False, 24), (True, 8), (True, 32), (True, 40)])
def test_two_halves_of_a_sum_make_the_whole(groups: tuple[int, ...], slopes: bool, whole: bool, wide_u: int) -> None:
    cell = made_cell(groups, wide_u, whole=whole)
    starts, scratch = np.full(len(groups), -1, np.int32), np.zeros(24 + 6 * cell.wide_u * len(groups), np.float32)
    out = np.full(72 * TILES, np.nan, np.float32)
    assert run_groups(*cell, slopes, starts, scratch, out) == len(groups)
    first = SHIFT + np.cumsum(groups) - groups
    assert starts.tolist() == cell.factor_v[first].tolist()
    assert not scratch[:24].any()  # these numbers belong to the caller
    wanted, found = cell.sums(), out.reshape(TILES, 9, 8)
    if not slopes:
        assert np.isnan(found[:, 3:]).all()
    kept = 9 if slopes else 3
    np.testing.assert_allclose(found[:, :kept], wanted[:, :kept], atol=3e-6 * np.abs(wanted).max())


def test_equal_factors_that_do_not_follow_each_other_are_groups_of_their_own() -> None:
    """Rows are sorted by their factors in v, so that a sum never has to look back."""
    cell = made_cell((2, 1, 1))
    factor_v = cell.factor_v.copy()
    factor_v[SHIFT + 3] = factor_v[SHIFT]
    cell = cell._replace(factor_v=factor_v)
    starts, scratch = np.zeros(3, np.int32), np.zeros(24 + 6 * cell.wide_u * 3, np.float32)
    out = np.zeros(72 * TILES, np.float32)
    assert run_groups(*cell, True, starts, scratch, out) == 3 and starts[0] == starts[2]
    np.testing.assert_allclose(out.reshape(TILES, 9, 8), cell.sums(), atol=1e-5)


@njit
def run_products(factors, picks, at_u, at_v, wide_u, wide_v, tile, out):
    """``out (4, 8)``: the weights of :func:`product`, then those of :func:`slope_products`."""
    groupsums.store(out, 0, groupsums.product(factors, picks, at_u, at_v, tile))
    a, u, v = groupsums.slope_products(factors, picks, at_u, at_v, wide_u, wide_v, tile)
    groupsums.store(out, 8, a)
    groupsums.store(out, 16, u)
    groupsums.store(out, 24, v)


def test_weights_of_a_point_are_products_of_what_its_lanes_pick() -> None:
    cell, out = made_cell((1,)), np.zeros(32, np.float32)
    low_u, low_v = cell.picks[HEAD + STEP + 16 : HEAD + 2 * STEP]
    at_u, at_v = int(cell.factor_u[SHIFT] + low_u), int(cell.factor_v[SHIFT] + low_v)
    run_products(cell.factors, cell.picks, at_u, at_v, cell.wide_u, cell.wide_v, HEAD + STEP, out)
    a, b = cell.along(cell.factor_u, 0, 0)[1, 0], cell.along(cell.factor_v, 1, 0)[1, 0]
    u, v = cell.along(cell.factor_u, 0, cell.wide_u)[1, 0], cell.along(cell.factor_v, 1, cell.wide_v)[1, 0]
    np.testing.assert_allclose(out.reshape(4, 8), [a * b, a * b, u * b, a * v], rtol=1e-6)


@njit
def run_wide(row, head, picks):
    return groupsums.factor_counts(row, head, picks)


def test_a_cell_says_how_many_factors_its_rows_have_and_one_with_plain_weights_none() -> None:
    picks = np.array([9, 9, 16, 24], np.int32)
    assert run_wide(0, 2, picks) == (16, 24)
    assert run_wide(-1, 2, picks) == (0, 0)


@njit
def run_whole(row, head, picks):
    return groupsums.takes_whole(row, head, picks)


def test_a_cell_says_whether_its_tiles_take_whole_windows() -> None:
    picks = np.array([9, 16, 24, 1, 16, 24, 0], np.int32)
    assert run_whole(5, 1, picks) and not run_whole(5, 4, picks)
    assert not run_whole(-1, 1, picks)  # plain weights
