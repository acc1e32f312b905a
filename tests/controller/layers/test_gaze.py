"""Gaze shared between eyes and head."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS as P
from controller.layers.gaze import EYE_OFFSET_MM, Gaze

SCALE = P.full_scale_rad[
    P.indices(["headYaw", "headPitch", "leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch"])
]


def settled(gaze: Gaze) -> np.ndarray:
    """(6,) angles in degrees when the head has arrived."""
    face = P.neutral()
    for _ in range(2):
        face[gaze.indices] = gaze.update(face)
    return np.degrees(face[gaze.indices] * SCALE)


@settings(deadline=None)
@given(st.floats(-95, 95), st.floats(-70, 70))
def test_head_and_eyes_together_reach_the_direction(yaw: float, pitch: float) -> None:
    gaze = Gaze(P)
    gaze.look(math.radians(yaw), math.radians(pitch))
    head_yaw, head_pitch, left_yaw, left_pitch, right_yaw, right_pitch = settled(gaze)
    assert head_yaw + left_yaw == pytest.approx(yaw, abs=1e-9) and left_yaw == right_yaw
    assert head_pitch + left_pitch == pytest.approx(pitch, abs=1e-9) and left_pitch == right_pitch


def test_small_shifts_leave_the_head_alone() -> None:
    gaze = Gaze(P)
    gaze.look(math.radians(7), math.radians(-5))
    angles = settled(gaze)
    assert not angles[:2].any()
    assert angles[2:] == pytest.approx([7, -5, 7, -5])


def test_eyes_lead_and_turn_back_as_the_head_arrives() -> None:
    gaze = Gaze(P)
    gaze.look(math.radians(40), 0.0)
    face = P.neutral()
    first = gaze.update(face)[2] * 35
    face[gaze.indices[0]] = 20 / 60
    later = gaze.update(face)[2] * 35
    assert first == pytest.approx(35) and later == pytest.approx(20)


def test_a_near_point_turns_the_eyes_inwards() -> None:
    gaze = Gaze(P)
    gaze.look_at(0.0, 0.0, 300.0)
    _, _, left, _, right, _ = settled(gaze)
    vergence = math.degrees(math.atan2(EYE_OFFSET_MM, 300.0))
    assert (left, right) == pytest.approx((-vergence, vergence))


def test_signs_of_a_point() -> None:
    gaze = Gaze(P)
    gaze.look_at(1000.0, 500.0, 10_000.0)  # to the subject's left and up
    yaw, pitch = gaze.direction_deg
    assert yaw == pytest.approx(5.71, abs=0.02) and pitch == pytest.approx(-2.85, abs=0.02)


def test_off() -> None:
    gaze = Gaze(P)
    assert not gaze.active
    gaze.look(0.1, 0.0)
    assert gaze.active
    gaze.off()
    assert not gaze.active


def test_behind_the_head_stays_in_range() -> None:
    gaze = Gaze(P)
    gaze.look_at(-10.0, 0.0, -500.0)
    assert np.all(np.abs(settled(gaze)) <= np.degrees(SCALE) + 1e-9)


@pytest.mark.parametrize(
    ("point", "yaw", "pitch"),
    [
        ((300.0, -500.0, 400.0), math.degrees(math.atan2(300, 400)), 45.0),  # 500 mm away, 500 mm down
        ((-300.0, 500.0, 400.0), math.degrees(math.atan2(-300, 400)), -45.0),
        ((0.0, 100.0, 100.0), 0.0, -45.0),
        ((400.0, -300.0, 0.0), 90.0, math.degrees(math.asin(0.6))),
    ],
)
def test_the_pitch_of_a_point_is_taken_from_its_distance_in_the_level(
    point: tuple[float, float, float], yaw: float, pitch: float
) -> None:
    gaze = Gaze(P)
    gaze.look_at(*point)
    found_yaw, found_pitch = gaze.direction_deg
    assert found_pitch == pytest.approx(pitch, abs=1e-9)
    assert found_yaw == pytest.approx(yaw, abs=0.5)  # the mean of two eyes, 64 mm apart
    head_yaw, head_pitch, left, left_pitch, right, right_pitch = settled(gaze)
    assert head_pitch + left_pitch == pytest.approx(pitch, abs=1e-9) and left_pitch == right_pitch
    x, _, z = point
    if abs(yaw) < 60:
        assert head_yaw + left == pytest.approx(math.degrees(math.atan2(x - 32, z)), abs=1e-9)
        assert head_yaw + right == pytest.approx(math.degrees(math.atan2(x + 32, z)), abs=1e-9)


def test_the_head_takes_three_quarters_beyond_a_comfortable_angle() -> None:
    gaze = Gaze(P)
    gaze.look(math.radians(28), math.radians(-26))
    assert settled(gaze)[:2] == pytest.approx([15.0, -15.0])
    gaze.look(math.radians(8.001), math.radians(-6.001))
    assert settled(gaze)[:2] == pytest.approx([0.00075, -0.00075])


def test_idle_motion_is_added_to_eyes_and_head() -> None:
    gaze = Gaze(P)
    gaze.look(0.02, -0.03)
    still = gaze.update(P.neutral()) * SCALE
    moved = gaze.update(P.neutral(), (0.01, 0.02), (0.003, 0.004)) * SCALE
    np.testing.assert_allclose(moved - still, [0.003, 0.004, 0.01, 0.02, 0.01, 0.02], atol=1e-12)


def test_how_far_a_command_moves_the_gaze() -> None:
    gaze = Gaze(P)
    assert gaze.shift_rad == 0.0
    gaze.look(0.3, 0.4)
    assert gaze.shift_rad == pytest.approx(0.5)
    gaze.look(0.3, 0.1)
    assert gaze.shift_rad == pytest.approx(0.3)
    gaze.look(-0.1, 0.1)
    assert gaze.shift_rad == pytest.approx(0.4)
    assert gaze.direction_deg == pytest.approx((math.degrees(-0.1), math.degrees(0.1)))


def test_straight_ahead_is_told_without_a_sign() -> None:
    gaze = Gaze(P)
    gaze.look(-0.0, -0.0)
    assert [math.copysign(1.0, angle) for angle in gaze.direction_deg] == [1.0, 1.0]
