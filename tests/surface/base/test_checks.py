"""Checks of arguments: what passes comes back clean, what does not is named with its index."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base import checks


def test_numbers_are_a_float_copy() -> None:
    given = np.arange(6.0).reshape(2, 3)
    out = checks.numbers(given, "x")
    out[0, 0] = 9
    assert given[0, 0] == 0
    assert checks.numbers([1, 2], "x").dtype == np.float64
    assert checks.numbers(np.asfortranarray(given), "x").flags.c_contiguous


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "x: must be numbers, got {}"),
        ("up", "x: must be numbers, got 'up'"),
        ([1, "a"], r"x\[1\]: must be numbers, got 'a'"),
        ([[1, 2], [3], [4, 5]], r"x\[1\]: shape \(1,\), expected \(2,\)"),
    ],
)
def test_what_is_no_number_is_named(values: object, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        checks.numbers(values, "x")  # type: ignore[arg-type]


def test_required_elements_are_named_with_all_their_indices() -> None:
    values = np.arange(6.0).reshape(2, 3)
    checks.require(values >= 0, values, "x")
    with pytest.raises(ValueError, match=r"^x\[1, 2\]: must be less than 5, got 5.0$"):
        checks.require(values < 5, values, "x", "less than 5")
    with pytest.raises(ValueError, match=r"^x\[1\]: must be finite, got \[3.0, 4.0, 5.0\]$"):
        checks.require(values[:, 0] < 3, values, "x")


def test_points() -> None:
    assert checks.check_points([[1, 2, 3]]).tolist() == [[1, 2, 3]]
    for points, message in (
        ([[1, 2]], r"^p: shape \(1, 2\), expected \(n, 3\)"),
        ([1, 2, 3], r"^p: shape \(3,\)"),
        (np.zeros((0, 3)), "^p: empty"),
        ([[0, 0, 0], [0, np.inf, 0]], r"^p\[1\]: must be finite, got \[0.0, inf, 0.0\]"),
    ):
        with pytest.raises(ValueError, match=message):
            checks.check_points(points, "p")


def test_weights() -> None:
    assert checks.check_weights([1, 2], n=2).tolist() == [1, 2]
    for weights, message in (
        ([[1.0]], r"^weights: shape \(1, 1\), expected \(n,\)"),
        ([1, 0], r"^weights\[1\]: must be positive and finite, got 0.0"),
        ([1, -1], r"^weights\[1\]"),
        ([np.inf, 1], r"^weights\[0\]"),
        ([1, 1, 1], "^weights: 3 weights for 2 points"),
        ([1], "^weights: 1 weights for 2 points"),
    ):
        with pytest.raises(ValueError, match=message):
            checks.check_weights(weights, n=2)


def test_integers_are_not_copied_where_they_are_int64() -> None:
    ids = np.array([3, 1])
    assert checks.integers(ids) is ids
    assert checks.integers(ids[::-1]).tolist() == [1, 3]
    assert checks.integers(np.array([1, 2], dtype=np.uint8)).dtype == np.int64
    assert checks.integers([]).shape == (0,)
    for bad in ([[1]], [1.5], [[1], [1, 2]], [True]):
        with pytest.raises(ValueError, match="ids: needs a flat sequence of integers, got"):
            checks.integers(bad)  # type: ignore[arg-type]


def test_ids_are_within_the_points() -> None:
    assert checks.check_ids([0, 4], 5).tolist() == [0, 4]
    for bad, message in (([0, 5], r"^ids\[1\]: 5 is not a control point \(0 to 4\)"), ([-1], r"^ids\[0\]: -1")):
        with pytest.raises(ValueError, match=message):
            checks.check_ids(bad, 5)


def test_samples() -> None:
    uv = np.zeros((2, 2))
    assert checks.check_uv(uv) is uv
    assert checks.check_uv([[1, 2]]).tolist() == [[1, 2]]
    for bad, message in (
        ([1, 2], r"^uv: shape \(2,\), expected \(m, 2\)"),
        ([[1, 2, 3]], r"^uv: shape \(1, 3\)"),
        ([[0, 0], [0, np.nan]], r"^uv\[1\]: must be finite, got \[0.0, nan\]"),
    ):
        with pytest.raises(ValueError, match=message):
            checks.check_uv(bad)


def test_the_ends_of_the_rectangle_are_inside_and_closed_directions_have_no_outside() -> None:
    rect, corners = (0.0, 1.0, 2.0, 3.0), np.array([[0.0, 2], [1, 3]])
    assert checks.check_inside(corners, rect, (None, None)) is corners
    for axis, place in ((0, -0.1), (0, 1.1), (1, 1.9), (1, 3.1)):
        samples = corners.copy()
        samples[1, axis] = place
        name = "uv"[axis]
        with pytest.raises(ValueError, match=rf"^uv\[1\]: {name} = {place} is outside the domain, "):
            checks.check_inside(samples, rect, (None, None))
        closed = [None, None]
        closed[axis] = (0.0, 1.0)  # type: ignore[call-overload]
        assert checks.check_inside(samples, rect, tuple(closed)) is samples


def test_sides_are_a_copy_of_0_to_3() -> None:
    samples, given = np.zeros((3, 2)), np.array([0, 3, 1])
    out = checks.check_sides(samples, given)
    out[0] = 2
    assert given[0] == 0
    assert checks.check_sides(samples, None).tolist() == [0, 0, 0]
    assert checks.check_sides(samples, 2).tolist() == [2, 2, 2]
    for bad, message in (
        ([0, 1], r"^side: shape \(2,\), expected \(3,\)"),
        ([0, 1, 4], r"^side\[2\]: must be 0, 1, 2 or 3, not 4"),
        ([0, -1, 0], r"^side\[1\]: .*not -1"),
        ([0, 0.5, 0], r"^side\[1\]: .*not 0.5"),
    ):
        with pytest.raises(ValueError, match=message):
            checks.check_sides(samples, bad)
