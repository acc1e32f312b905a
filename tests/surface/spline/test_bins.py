"""Bins list every point that reaches them, and few others."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface.spline.bins import build_bins
from surface.spline.kernels import points_in


@pytest.mark.parametrize("seed", range(4))
def test_every_point_stands_in_every_bin_it_reaches(seed: int) -> None:
    surface = shapes.scattered(30, seed)
    bins, supports = surface.bins, surface.supports
    rng = np.random.default_rng(seed)
    for u, v in rng.uniform(-0.5, 1.6, (200, 2)):
        a = min(int((u - bins.grid[0]) * bins.grid[2]), int(bins.shape[0]) - 1)
        b = min(int((v - bins.grid[1]) * bins.grid[3]), int(bins.shape[1]) - 1)
        cell = a * int(bins.shape[1]) + b
        held = set(bins.ids[bins.start[cell] : bins.start[cell + 1]].tolist())
        s = supports
        reached = np.flatnonzero((s[:, 0] <= u) & (u <= s[:, 1]) & (s[:, 2] <= v) & (v <= s[:, 3]))
        assert set(reached.tolist()) <= held


def test_lists_rise_and_are_not_much_longer_than_needed() -> None:
    surface = shapes.hills(40)
    bins = surface.bins
    for first, last in zip(bins.start, bins.start[1:], strict=False):
        assert (np.diff(bins.ids[first:last]) > 0).all()
    assert np.diff(bins.start).mean() < 1.6 * 16


def test_one_tiny_point_makes_no_endless_grid() -> None:
    knots = np.array([[0.0, 1e-12, 2e-12], [0.0, 0.5, 1.0]])
    bins = build_bins(knots, knots)
    assert int(bins.shape.prod()) <= 64
    assert set(bins.ids.tolist()) == {0, 1}


def test_points_in_a_box_are_found_wherever_the_directions_begin() -> None:
    """u from 0 to 1 and v from 500 to 540: nothing of one direction fits the other."""
    knots_u = np.linspace(0.0, 0.8, 30)[:, None] + np.array([0.0, 0.1, 0.2])
    knots_v = 500.0 + 40.0 * np.random.default_rng(3).random((30, 1)) * 0.8 + np.array([0.0, 4.0, 8.0])
    bins = build_bins(knots_u, knots_v)
    assert min(bins.shape) > 1
    out = np.empty(30, dtype=np.int32)
    for u, v in np.random.default_rng(4).random((100, 2)):
        box = np.array([0.7 * u, 0.7 * u + 0.2, 500 + 28 * v, 500 + 28 * v + 6])
        count = points_in(box, knots_u, knots_v, bins.grid, bins.shape, bins.start, bins.ids, out)
        meets_u = (knots_u[:, 0] <= box[1]) & (knots_u[:, -1] >= box[0])
        meets_v = (knots_v[:, 0] <= box[3]) & (knots_v[:, -1] >= box[2])
        assert sorted(out[:count]) == np.flatnonzero(meets_u & meets_v).tolist()
