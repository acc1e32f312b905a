"""Knot insertion leaves the surface where it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import DCPSurface
from surface.spline import refine
from tests.surface import shapes


def samples(seed: int, n: int = 80) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1, (n, 2))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 0.95), st.sampled_from("uv"))
def test_a_knot_leaves_a_scattered_surface_unchanged(seed: int, value: float, axis: str) -> None:
    surface = shapes.scattered(25, seed, degrees=(0, 9))
    uv = samples(seed)
    refined = surface.insert_knot(axis, value).surface
    assert refined.n > surface.n
    assert np.allclose(refined.evaluate(uv), surface.evaluate(uv), rtol=0, atol=1e-12)
    again = refined.insert_knot(axis, value).surface  # a double knot
    assert np.allclose(again.evaluate(uv), surface.evaluate(uv), rtol=0, atol=1e-12)


def test_a_net_gets_one_row_of_points_as_in_the_book() -> None:
    surface = shapes.hills(12)
    refined = surface.insert_knot("u", 0.37)
    assert refined.surface.n == 12 * 12 + 12
    assert np.allclose(refined.surface.weights, 1)
    assert np.allclose(refined.surface.evaluate(samples(1)), surface.evaluate(samples(1)), rtol=0, atol=1e-12)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_refining_a_region_touches_nothing_else(seed: int) -> None:
    surface = shapes.scattered(25, seed)
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(0, 0.8, 2)
    region = (u, u + 0.2, v, v + 0.2)
    made = surface.refine(region)
    uv = samples(seed)
    assert np.allclose(made.surface.evaluate(uv), surface.evaluate(uv), rtol=0, atol=1e-11)
    s = surface.supports
    away = (s[:, 0] >= region[1]) | (s[:, 1] <= region[0]) | (s[:, 2] >= region[3]) | (s[:, 3] <= region[2])
    kept = int(away.sum())
    assert np.array_equal(made.surface.points[:kept], surface.points[away])
    assert np.array_equal(made.surface.supports[:kept], s[away])


def test_data_is_carried_with_the_points() -> None:
    surface = shapes.hills(10)
    made = surface.refine((0.3, 0.6, 0.2, 0.5))
    assert made.surface.n > surface.n
    assert np.allclose(np.bincount(made.point, made.share), 1)
    assert np.allclose(made.carry(surface.points), made.surface.points, rtol=0, atol=1e-12)
    push = np.zeros((surface.n, 3))
    push[44] = 5.0
    moved = surface.with_points(surface.points + push).evaluate(samples(2))
    same = made.surface.with_points(made.surface.points + made.carry(push)).evaluate(samples(2))
    assert np.allclose(moved, same, rtol=0, atol=1e-12)


def test_full_multiplicity_makes_a_slit() -> None:
    surface: DCPSurface = shapes.hills(12)
    for _ in range(4):
        surface = surface.insert_knot("v", 0.5).surface
    below = surface.supports[:, 3] <= 0.5
    above = surface.supports[:, 2] >= 0.5
    assert (below | above).all()
    assert np.allclose(surface.evaluate([[0.3, 0.5]], side=[2]), surface.evaluate([[0.3, 0.5]]), atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("w", 0.5), "axis"),
        (("u", np.nan), "value"),
        (("v", 1.5), "value: v = 1.5 is outside the domain"),
        (("u", 0.5, [1, 999]), r"ids\[1\]: 999"),
        (("u", 0.5, [0.5]), "ids"),
    ],
)
def test_bad_arguments_are_named(arguments: tuple, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        shapes.hills(8).insert_knot(*arguments)


def test_bad_regions_are_named() -> None:
    with pytest.raises(ValueError, match="region"):
        shapes.hills(8).refine((0.5, 0.5, 0, 1))
    with pytest.raises(ValueError, match="region: needs"):
        shapes.hills(8).refine((0, 1))  # type: ignore[arg-type]


def test_knots_at_the_ends_and_outside_subdomains_change_nothing() -> None:
    surface = shapes.hills(8)
    for value in (0.0, 1.0):
        assert surface.insert_knot("u", value).surface.n == surface.n
    only = surface.insert_knot("v", 0.5, [0])  # point 0 ends before 0.5
    assert only.surface.n == surface.n
    assert np.array_equal(only.surface.points, surface.points)


def test_boehms_weights_of_one_split_point() -> None:
    surface = DCPSurface([[1.0, 2, 3]], [2.0], [[0.0, 1, 3, 6]], [[0.0, 1]])
    made = surface.insert_knot("u", 2.0)
    assert [k.tolist() for k in made.surface.knots_u] == [[0, 1, 2, 3], [1, 2, 3, 6]]
    assert np.allclose(made.surface.weights, [2 * 2 / 3, 2 * 4 / 5])  # (2 - 0) / (3 - 0) and (6 - 2) / (6 - 1)
    assert made.surface.points.tolist() == [[1, 2, 3]] * 2
    assert made.point.tolist() == [0, 1] and made.parent.tolist() == [0, 0] and made.share.tolist() == [1, 1]


def test_only_named_points_are_split() -> None:
    surface = shapes.hills(8)
    made = surface.insert_knot("u", 0.5, [27])
    assert made.surface.n == surface.n + 1
    rest = np.delete(np.arange(64), 27)
    assert np.array_equal(made.surface.points[:63], surface.points[rest])
    assert sorted(made.parent[made.point >= 63].tolist()) == [27, 27]


def test_middles_are_of_spans_that_share_more_than_an_end() -> None:
    knots = np.array([[0.0, 0.0, 1.0, 3.0, 4.0], [2.0, 2.5, 3.0, 3.0, 7.0]])
    found = refine._middles(knots, 1.0, 3.0)
    np.testing.assert_array_equal(found, [[np.nan, np.nan, 2.0, np.nan], [2.25, 2.75, np.nan, np.nan]])
    np.testing.assert_array_equal(refine._middles(knots, 0.5, 3.1)[:, 1:], [[0.5, 2.0, 3.5], [2.75, np.nan, 5.0]])
