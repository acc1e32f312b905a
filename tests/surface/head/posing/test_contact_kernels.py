"""What keeps lids on an eyeball, and what lines them out of it."""

import numpy as np
import pytest
from face_measures import eye_height

from surface.fit.points.eyeball import surface_height
from surface.head.posing.contact import LID_MM, TOUCH_MM, HeightLimits
from surface.head.posing.contact_kernels import find_heights, find_lifts, lift_points, place_samples
from surface.head.posing.rig import optical_axis

RADIUS = 12.1
LOOKS = ((0.0, 0.0), (0.5, -0.3), (-0.4, 0.5))


def directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors in front of an eye."""
    out = np.random.default_rng(2).normal(size=(count, 3)) * [1.0, 1.0, 0.5] + [0.0, 0.0, 1.0]
    out = out[out[:, 2] > 0.1]
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def samples_at(points: np.ndarray) -> np.ndarray:
    """(s, 3) as (x, height, depth) of points (s, 3) from the eyeball's centre."""
    start, ids, share = np.arange(len(points) + 1), np.arange(len(points)), np.zeros(8 * len(points), np.float32)
    share[::8] = 1.0
    out = np.empty((8 * len(points), 3))
    place_samples(start, ids, share, points, np.zeros(3), RADIUS, np.empty(24, np.float32), out)
    return np.ascontiguousarray(out[::8])


@pytest.mark.parametrize("look", LOOKS)
def test_heights_are_those_above_ball_and_cornea(look):
    way, axis = directions(300), optical_axis(np.array(look))
    points = way * (RADIUS + np.linspace(-1, 4, len(way)))[:, None]
    found = np.empty(len(way))
    find_heights(samples_at(points), RADIUS, axis, found)
    wanted = np.linalg.norm(points, axis=1) - RADIUS * eye_height(way, axis)
    np.testing.assert_allclose(found, wanted, atol=5e-3)
    assert (eye_height(way, axis) > 1.05).any()


@pytest.mark.parametrize("look", LOOKS)
def test_lids_are_seated_on_the_surface_that_is_measured(look):
    axis, way = optical_axis(np.array(look)), directions(300)
    np.testing.assert_allclose(surface_height(way, axis), eye_height(way, axis), atol=1e-9)


def test_what_is_too_low_is_lifted_and_what_is_too_high_laid_down():
    lifts = np.full(4, 9.0)
    heights, most = np.array([0.2, 1.0, 2.0, 2.0]), np.array([0.5, 1.5, 1.5, 1.5])
    worst = find_lifts(heights, np.array([0.5, 0.5, 0.5, 0.5]), most, np.array([1.0, 1.0, 1.0, 0.0]), 1.5, lifts)
    np.testing.assert_allclose(lifts, [0.45, 0.0, -0.75, 0.0])
    assert worst == pytest.approx(0.5)


def test_a_lift_goes_away_from_the_eyeball_where_its_sample_stands():
    way = directions(5)
    points, rest = np.zeros((7, 3)), samples_at(13.0 * way)
    lift_points(
        np.arange(len(way)) + 1, np.full(len(way), 0.5), rest, RADIUS, np.eye(len(way), dtype=np.float32), points
    )
    np.testing.assert_allclose(points[1 : 1 + len(way)], 0.5 * way, atol=1e-5)
    assert not points[0].any()


def test_what_lay_on_the_ball_follows_the_cornea_and_what_stood_off_does_not():
    ahead, aside = optical_axis(np.zeros(2)), optical_axis(np.array([0.6, 0.0]))
    way = np.array([[0.0, 0.1, 1.0], [0.0, 0.1, 1.0], [0.0, 0.1, 1.0]]) / np.hypot(0.1, 1.0)
    ground = RADIUS * eye_height(way, ahead)
    rest = samples_at(way * (ground + np.array([0.3, LID_MM, 4.0]))[:, None])
    cushion = HeightLimits(rest, RADIUS, held=True)
    assert cushion.find(rest, ahead) == pytest.approx(0.0, abs=1e-9)
    fall = ground[0] - RADIUS * eye_height(way, aside)[0]
    assert fall > 0.9  # the cornea turned away
    assert cushion.find(rest, aside) == pytest.approx(fall, abs=0.01)
    assert cushion.lifts[0] < -fall and cushion.lifts[1] < -fall and cushion.lifts[2] == 0.0


def test_a_lining_only_keeps_out():
    way = np.array([[0.0, 0.3, 1.0]]) / np.hypot(0.3, 1.0)
    ground = RADIUS * eye_height(way, optical_axis(np.zeros(2)))
    cushion = HeightLimits(samples_at(way * (ground + 0.5)[:, None]), RADIUS, held=False)
    for height, wanted in ((2.0, 0.0), (0.1, 0.0), (-0.4, 0.4 + TOUCH_MM)):
        off = cushion.find(samples_at(way * (ground + height)[:, None]), optical_axis(np.zeros(2)))
        assert off == pytest.approx(wanted, abs=5e-3)
