"""Cubes of points against scipy's tree and components."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from surface.check import cells


@pytest.mark.parametrize("size", [0.5, 2.0, 40.0])
def test_the_cubes_around_a_point_hold_all_that_is_nearer_than_their_size(size: float) -> None:
    points = np.random.default_rng(1).uniform(-9.0, 9.0, (300, 3))
    found = cells.sort_into_cells(points, size)
    assert sorted(found.order.tolist()) == list(range(300)) and len(found.keys) == found.own.max() + 1
    for k, key in enumerate(found.keys):
        own = found.order[found.start[k] : found.start[k + 1]]
        assert (np.floor(points[own] / size) == key).all() and (found.own[own] == k).all() and (np.diff(own) > 0).all()
    first, last = found.columns()
    near = cKDTree(points).query_ball_point(points, size)
    for i, wanted in enumerate(near):
        k = found.own[i]
        around = np.concatenate([found.order[a:b] for a, b in zip(first[k], last[k], strict=True)])
        assert len(set(around.tolist())) == len(around) and set(wanted) <= set(around.tolist())
        assert (np.abs(np.floor(points[around] / size) - found.keys[k]) <= 1).all()


@pytest.mark.parametrize("least", [0.3, 1.0, 5.0])
def test_what_is_near_to_any_other_point(least: float) -> None:
    rng = np.random.default_rng(2)
    points, others = rng.uniform(-9.0, 9.0, (200, 3)), rng.uniform(-9.0, 9.0, (60, 3))
    points[:2] = others[0] + [[0.9999 * least, 0, 0], [0, 40.0, 0]]
    wanted = cKDTree(others).query(points)[0] < least
    assert wanted.any() and not wanted.all()
    np.testing.assert_array_equal(cells.any_nearer(points, others, least), wanted)
    assert not cells.any_nearer(points, np.zeros((0, 3)), least).any()
    assert cells.any_nearer(np.zeros((0, 3)), others, least).shape == (0,)


@pytest.mark.parametrize("reach", [0.2, 0.8, 3.0])
def test_points_are_joined_by_chains_of_near_ones_and_by_their_numbers(reach: float) -> None:
    rng = np.random.default_rng(3)
    points, known = rng.uniform(-6.0, 6.0, (400, 3)), rng.integers(0, 390, 400)
    near = np.linalg.norm(points[:, None] - points, axis=2) < reach
    count, label = connected_components(near | (known[:, None] == known), directed=False)
    joined = cells.joined_nearer(points, known, reach)
    assert len(np.unique(joined)) == count == len(np.unique(np.column_stack([joined, label]), axis=0))
    assert cells.joined_nearer(np.zeros((0, 3)), np.zeros(0, np.int64), reach).shape == (0,)


def test_a_dense_line_and_a_point_far_away_take_little_memory() -> None:
    """All pairs of the line's 20,000 points, 0.1 mm long, would be 400 million."""
    points = np.zeros((20_001, 3))
    points[:-1, 0], points[-1] = np.linspace(0.0, 0.1, 20_000), 1e12
    tracemalloc.start()
    try:
        joined = cells.joined_nearer(points, np.arange(20_001), 0.4)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(np.unique(joined)) == 2 and (joined[:-1] == joined[0]).all()
    assert most < 20e6


def test_cubes_beyond_whole_numbers_are_the_last_ones() -> None:
    found = cells.sort_into_cells(np.array([[0.0, 0, 0], [1e30, 0, 0], [-1e30, 0, 0], [1e31, 0, 0]]), 1.0)
    assert found.keys[:, 0].tolist() == [-(1 << 60), 0, 1 << 60] and found.order.tolist() == [2, 0, 1, 3]
