"""Which two balls of a file are its eyes: round enough, of one size, beside each other, at an eye's distance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.fit.surfaces.eyes import find_eyeballs, sphere

R = 12.0
LEFT, RIGHT = (32.0, 5.0, 8.0), (-32.0, 5.0, 8.0)


def ball(centre: Any, radius: float = R, *, factors: Any = (1.0, 1.0, 1.0), front: float = -1.0) -> Floats:
    """Samples of a ball; ``front``: only those whose z, in radii, is more."""
    at = np.random.default_rng(3).normal(size=(2000, 3))
    at /= np.linalg.norm(at, axis=1, keepdims=True)
    return np.asarray(centre, float) + radius * at[at[:, 2] >= front] * factors


def found(*points: Floats, titles: Any = None) -> Any:
    names = titles or [f"surface {k}" for k in range(len(points))]
    return find_eyeballs([SimpleNamespace(title=name) for name in names], list(points))  # type: ignore[misc]


SKIN = np.random.default_rng(0).uniform(-100, 100, (500, 3))


def test_a_sphere_is_found_from_any_part_of_it() -> None:
    for front in (-1.0, 0.3):
        centre, radius, off = sphere(ball((3.0, -40.0, 700.0), 2.5, front=front))
        np.testing.assert_allclose(centre, [3.0, -40.0, 700.0], atol=1e-7)
        assert radius == pytest.approx(2.5) and off < 1e-7
    rough = ball((0.0, 0.0, 0.0), 10.0)
    rough *= 1.0 + 0.05 * np.where(np.arange(len(rough)) % 2, 1.0, -1.0)[:, None]
    centre, radius, off = sphere(rough)
    assert radius == pytest.approx(10.0, rel=0.01) and off == pytest.approx(0.5, rel=0.02)


def test_two_balls_of_one_size_beside_each_other_are_eyes_the_left_first() -> None:
    eyes = found(SKIN, ball(RIGHT), ball(LEFT, 12.5))
    np.testing.assert_allclose(eyes.centres, [LEFT, RIGHT], atol=1e-6)
    assert eyes.radius == pytest.approx(12.25) and eyes.pieces == ([2], [1])


def test_what_lies_about_an_eyes_centre_belongs_to_it() -> None:
    cornea, away = ball((32.0, 5.0, 16.0), 6.0, front=0.5), ball((32.0, 5.0, 16.0), 8.0, front=0.5)
    eyes = found(ball(LEFT), ball(RIGHT), cornea, away)  # 14 and 16 mm before the centre: 1.3 radii are 15.6
    assert eyes.pieces == ([0, 2], [1])


@pytest.mark.parametrize(("squeezed", "is_eye"), [(0.92, True), (0.75, False)])
def test_an_eyeball_is_nearly_round(squeezed: float, is_eye: bool) -> None:
    both = [ball(at, factors=(1.0, squeezed, 1.0)) for at in (LEFT, RIGHT)]
    assert (found(*both) is not None) == is_eye


@pytest.mark.parametrize(("front", "is_eye"), [(0.0, True), (0.2, True), (0.3, False)])
def test_an_eyeball_covers_most_of_a_front_half(front: float, is_eye: bool) -> None:
    """A shell whose depth is 0.8 radii is one; 0.7 is too flat."""
    assert (found(ball(LEFT, front=front), ball(RIGHT, front=front)) is not None) == is_eye


@pytest.mark.parametrize(("larger", "is_pair"), [(1.14, True), (1.17, False), (0.87, True), (0.85, False)])
def test_both_eyes_have_one_size(larger: float, is_pair: bool) -> None:
    """They differ by less than 0.15 of their mean radius."""
    assert (found(ball(LEFT), ball(RIGHT, larger * R)) is not None) == is_pair


@pytest.mark.parametrize(("apart", "is_pair"), [(2.15, False), (2.25, True), (8.9, True), (9.1, False)])
def test_eyes_lie_at_an_eyes_distance(apart: float, is_pair: bool) -> None:
    eyes = found(ball((0.5 * apart * R, 0.0, 0.0)), ball((-0.5 * apart * R, 0.0, 0.0)))
    assert (eyes is not None) == is_pair


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize(("off", "is_pair"), [(0.34, True), (0.36, False), (-0.34, True), (-0.36, False)])
def test_eyes_lie_beside_each_other(axis: int, off: float, is_pair: bool) -> None:
    shifted = np.array(RIGHT)
    shifted[axis] += off * 64.0
    assert (found(ball(LEFT), ball(shifted)) is not None) == is_pair


def test_of_many_balls_the_largest_pair_counts_unless_some_are_named_eyes() -> None:
    beads = [ball((32.0, -60.0, 8.0), 5.0), ball((0.0, -60.0, 8.0), 5.0)]
    assert found(*beads, ball(LEFT), ball(RIGHT)).pieces == ([2], [3])
    named = found(*beads, ball(LEFT), ball(RIGHT), titles=["Eye_L", "Eye_R", "ball", "ball"])
    assert named.pieces == ([0], [1]) and named.radius == pytest.approx(5.0)
    assert found(*beads, ball(LEFT), titles=["bead", "bead", "eye"]) is None  # an eye alone has no other


def test_without_two_balls_there_are_no_eyes() -> None:
    assert found(SKIN) is None and found(SKIN, ball(LEFT)) is None and found() is None
