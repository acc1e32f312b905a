"""Blending functions: partition of unity, derivatives, both limits, degenerate knots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import blending
from surface.spline import basis


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 9), st.integers(0, 10_000), st.sampled_from(["left", "right"]))
def test_partition_of_unity_over_a_common_knot_vector(degree: int, seed: int, side: str) -> None:
    rng = np.random.default_rng(seed)
    inner = rng.choice(np.round(np.sort(rng.uniform(0, 1, 6)), 2), 8)  # some knots repeat
    knots = np.concatenate([[0.0] * (degree + 1), np.sort(inner), [1.0] * (degree + 1)])
    x = np.concatenate([rng.uniform(0, 1, 50), np.unique(knots)[1:-1]])
    total, slope = np.zeros(len(x)), np.zeros(len(x))
    for i in range(len(knots) - degree - 1):
        window = knots[i : i + degree + 2]
        if window[0] == window[-1]:
            continue
        total += blending(window, x, side=side)
        slope += blending(window, x, 1, side=side)
    assert np.allclose(total, 1, rtol=0, atol=1e-12)
    assert np.abs(slope).max() < 1e-6


@settings(max_examples=40, deadline=None)
@given(st.integers(3, 9), st.integers(0, 10_000))
def test_derivatives_agree_with_differences(degree: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    knots = np.cumsum(rng.uniform(0.2, 1, degree + 2))
    x, h = rng.uniform(knots[0], knots[-1], 30), 1e-5
    for order in (1, 2):
        numeric = (blending(knots, x + h, order - 1) - blending(knots, x - h, order - 1)) / (2 * h)
        assert np.allclose(blending(knots, x, order), numeric, atol=2e-3)


def test_written_out_cubic_is_the_recursion() -> None:
    rng = np.random.default_rng(0)
    for knots in (rng.uniform(0, 1, 5), [0, 0, 0, 0, 1], [0, 0, 0.5, 1, 1], [0, 1, 1, 1, 1], [0, 0.5, 0.5, 0.5, 1]):
        row = np.sort(knots)
        x = np.linspace(row[0], row[-1], 101)[:-1]
        low, high = (
            blending(row[:-1], x) if row[3] > row[0] else 0 * x,
            blending(row[1:], x) if row[4] > row[1] else 0 * x,
        )
        a = (x - row[0]) / (row[3] - row[0]) if row[3] > row[0] else 0
        b = (row[4] - x) / (row[4] - row[1]) if row[4] > row[1] else 0
        assert np.allclose(blending(row, x), a * low + b * high, rtol=0, atol=1e-14)


def test_limits_at_the_ends() -> None:
    assert blending([0, 1, 1], [0, 1, 2]).tolist() == [0, 0, 0]
    assert blending([0, 1, 1], [0, 1, 2], side="left").tolist() == [0, 1, 0]
    assert blending([0, 0, 1], [0]).tolist() == [1]
    assert blending([0, 1], [0, 0.5, 1]).tolist() == [1, 1, 0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 1, 0], [0]), "decrease"),
        (([1, 1], [0]), "distinct"),
        ((range(12), [0]), "degree 0 to 9"),
        (([0, 1], [0], 3), "derivative"),
    ],
)
def test_bad_arguments_are_named(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        blending(*arguments)
    with pytest.raises(ValueError, match="side"):
        blending([0, 1], [0], side="up")


def test_padded_knots_are_checked_row_by_row_and_padded_anew() -> None:
    rows = np.array([[0.0, 1, 2, 9, 7], [0, 0, 1, 2, 4], [1, 2, 9, 9, 0]])
    kept, degrees = basis.check_padded([[0, 1, 2, 2, 2], [0, 0, 1, 2, 4], [1, 2, 2, 2, 2]], [1, 3, 0], "u", 3)
    assert kept.tolist() == [[0, 1, 2, 2, 2], [0, 0, 1, 2, 4], [1, 2, 2, 2, 2]] and degrees.tolist() == [1, 3, 0]
    rising = np.array([[0.0, 1, 2, 5, 7], [0, 0, 1, 2, 4], [1, 2, 3, 4, 5]])  # more than a point needs
    kept, _ = basis.check_padded(rising, [1, 3, 0], "u", 3)
    assert kept.tolist() == [[0, 1, 2, 2, 2], [0, 0, 1, 2, 4], [1, 2, 2, 2, 2]]
    for knots, per_point, message in (
        (rising, [1, 4, 0], r"degrees_v\[1\]: 4 needs more knots than the 5 per row"),
        (rising[:2], [1, 3, 0], "knots_v: 2 rows for 3 points"),
        (rising, [1, 3], "degrees_v: 2 rows for 3 points"),
        (rows, [1, 3, 0], r"knots_v\[0\]: knots decrease at knot 4 \(7.0 after 9.0\)"),
        (rising * [[1], [0], [1]], [1, 3, 0], r"knots_v\[1\]: fewer than two distinct knots \(all are 0.0\)"),
        (
            np.where(rising == 4, np.nan, rising),
            [1, 3, 3],
            r"knots_v\[1\]: knots must be finite, got \[0.0, 0.0, 1.0, 2.0, nan\]",
        ),
        (rising, [1, -1, 0], r"knots_v\[1\]: 1 knots; a point has degree \+ 2 knots"),
        (np.tile(np.arange(12.0), (3, 1)), [1, 10, 0], r"knots_v\[1\]: 12 knots"),
    ):
        with pytest.raises(ValueError, match=message):
            basis.check_padded(knots, per_point, "v", 3)
    assert basis.check_padded(np.tile(np.arange(12.0), (3, 1)), [9, 7, 0], "v", 3)[1].tolist() == [9, 7, 0]
