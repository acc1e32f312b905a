"""Spheres through points, the point that an eye turns about, and what cannot be told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.fit.points.ballfit import Ball, fit_ball, front_ball, turn_angle, turning_centre, weighted_median

CENTRE, RADIUS = np.array([30.0, -20.0, 55.0]), 12.0
RNG = np.random.default_rng(0)


def directions(count: int = 400, reach: float = np.pi) -> np.ndarray:
    """Unit vectors, evenly over a cap around +z that reaches ``reach`` rad from it."""
    z = np.linspace(1.0, np.cos(reach), count)
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(np.maximum(1 - z**2, 0))
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


@pytest.mark.parametrize("reach", [np.pi, 1.2, 0.6])
def test_a_sphere_is_found_from_a_part_of_it(reach: float) -> None:
    ball = fit_ball(CENTRE + RADIUS * directions(reach=reach), np.ones(400))
    np.testing.assert_allclose(ball.centre, CENTRE, atol=1e-6)
    assert ball.radius == pytest.approx(RADIUS) and ball.off < 1e-9


@pytest.mark.parametrize("reach", [0.2, 0.5, 0.8, 1.1])
def test_spread_is_the_sine_of_half_the_angle_that_points_span(reach: float) -> None:
    ball = fit_ball(CENTRE + RADIUS * directions(2000, reach), np.ones(2000))
    inner = np.arccos(1 - 0.95 * (1 - np.cos(reach)))  # nineteen of twenty of them lie within
    assert ball.spread == pytest.approx(np.sin(inner), abs=0.01)
    assert fit_ball(CENTRE + RADIUS * directions(400), np.ones(400)).spread == 1.0


def test_what_stands_out_of_a_sphere_does_not_move_it() -> None:
    d = directions(600)
    length = np.full(600, RADIUS)
    length[:90] += 2.5  # a cornea
    ball = fit_ball(CENTRE + length[:, None] * d, np.ones(600))
    np.testing.assert_allclose(ball.centre, CENTRE, atol=0.02)
    assert ball.radius == pytest.approx(RADIUS, abs=0.02) and ball.off < 0.002


def test_points_count_by_their_weight() -> None:
    d = directions(400)
    both = np.vstack([CENTRE + RADIUS * d, CENTRE + 20.0 * d])
    for radius, weight in ((RADIUS, [1.0, 0.1]), (20.0, [0.1, 1.0])):
        ball = fit_ball(both, np.repeat(weight, 400))
        assert ball.radius == pytest.approx(radius, rel=0.02)


def test_off_is_the_weighted_median_of_distances_in_radii() -> None:
    noise = RNG.normal(size=3000) * 0.6
    d = directions(3000)
    ball = fit_ball(CENTRE + (RADIUS + noise)[:, None] * d, np.ones(3000))
    assert ball.off == pytest.approx(np.median(np.abs(noise)) / RADIUS, rel=0.05)
    cap = directions(3000, 0.9)
    ball = fit_ball(CENTRE + (RADIUS + 0.1 * noise)[:, None] * cap, np.full(3000, 1e-6))
    assert ball.off == pytest.approx(0.1 * np.median(np.abs(noise)) / RADIUS, rel=0.1)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_what_is_no_sphere_is_none_in_any_unit(scale: float) -> None:
    flat = np.column_stack([RNG.normal(size=(50, 2)), np.zeros(50)]) * scale
    assert fit_ball(flat, np.ones(50)) is None
    assert fit_ball(np.zeros((20, 3)), np.ones(20)) is None
    assert fit_ball(scale * directions(50), np.zeros(50)) is None
    assert fit_ball(scale * directions(5), np.ones(5)) is None
    hardly = flat + scale * 1e-6 * RNG.normal(size=(50, 3))
    assert fit_ball(hardly, np.ones(50)) is None
    six = fit_ball(scale * np.vstack([np.eye(3), -np.eye(3)]), np.ones(6))
    assert six.radius == pytest.approx(scale)


def test_a_weighted_median_is_where_half_of_the_weight_lies() -> None:
    values, weight = RNG.normal(size=101), RNG.integers(1, 5, 101)
    repeated = np.sort(np.repeat(values, weight))
    assert weighted_median(values, weight.astype(float)) == repeated[(len(repeated) - 1) // 2]


def test_the_front_of_a_flat_eye_has_a_sphere_of_its_own() -> None:
    d = directions(3000)
    points = CENTRE + d * [12.0, 12.0, 10.0]
    ball = fit_ball(points, np.ones(3000))
    front = front_ball(points, np.ones(3000), ball)
    near = points[d[:, 2] > 0.7]
    off = [np.abs(np.linalg.norm(near - b.centre, axis=1) - b.radius).max() for b in (front, ball)]
    assert off[0] < 0.3 * off[1] and front.radius > ball.radius  # flat in front: less curved
    few = points[::60]
    whole = fit_ball(few, np.ones(50))
    assert front_ball(few[few[:, 2] < CENTRE[2]], np.ones((few[:, 2] < CENTRE[2]).sum()), whole) is whole


def test_a_front_that_is_nearly_flat_or_pointed_is_not_believed() -> None:
    d = directions(3000)
    for deep in (2.0, 40.0):
        points = CENTRE + d * [12.0, 12.0, deep]
        ball = Ball(CENTRE, RADIUS, 0.0, 1.0)
        front = front_ball(points, np.ones(3000), ball)
        assert front is ball or 0.6 < front.radius / RADIUS < 2.2


def moves(angles, centre=CENTRE):
    turns = [Rotation.from_rotvec(np.radians(a) * np.array(axis)).as_matrix() for a, axis in angles]
    return [(t, centre - t @ centre) for t in turns]


def test_an_eye_turns_about_where_the_axes_of_its_motions_cross() -> None:
    np.testing.assert_allclose(turning_centre(moves([(20, (1, 0, 0)), (-15, (0, 1, 0))])), CENTRE)
    np.testing.assert_allclose(turning_centre(moves([(5, (1, 0, 0)), (5, (0, 1, 0)), (0.5, (0, 0, 1))])), CENTRE)


@pytest.mark.parametrize(
    "angles",
    [[], [(20, (1, 0, 0))], [(20, (1, 0, 0)), (3, (0, 1, 0))], [(20, (1, 0, 0)), (-30, (1, 0, 0))]],
)
def test_one_axis_or_small_turns_do_not_tell_the_centre(angles) -> None:
    assert turning_centre(moves(angles)) is None


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.7, 3.1])
def test_the_angle_of_a_rotation(angle: float) -> None:
    assert turn_angle(Rotation.from_rotvec(angle * np.array([0.6, 0, 0.8])).as_matrix()) == pytest.approx(
        angle, abs=1e-7
    )
