"""Bins list every point that reaches them, and few others."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface.spline.bins import build_bins


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
