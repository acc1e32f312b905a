"""surface.head.model.joints: joints of neck, jaw and eyes, in the axes of ROS."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_head import small_head

from surface.head.model.joints import BASE, JAW, ROS_AXES, SKULL, Joint, JointLimit, joints_of
from surface.head.model.parameters import NAMES, rotation

CHAIN = {
    "headYaw": BASE, "headPitch": "headYaw", "headRoll": "headPitch", "jawOpen": "headRoll", "leftEyeYaw": "headRoll",
    "leftEyePitch": "leftEyeYaw", "rightEyeYaw": "headRoll", "rightEyePitch": "rightEyeYaw",
}  # fmt: skip


def test_every_joint_is_carried_by_one_before_it_and_named_as_its_parameter() -> None:
    joints = joints_of(small_head())
    assert {joint.name: joint.parent for joint in joints} == CHAIN and len(joints) == len(CHAIN)
    seen = {BASE}
    for joint in joints:
        assert joint.parent in seen and joint.name in NAMES
        seen.add(joint.name)
    assert (BASE, SKULL, JAW) == ("base_link", "headRoll", "jawOpen")


def test_joints_stand_at_the_neck_the_jaw_and_the_eyes() -> None:
    head = small_head()
    at = {joint.name: joint.origin.tolist() for joint in joints_of(head)}
    for name in ("headYaw", "headPitch", "headRoll"):
        assert at[name] == [0.0, -50.0, 0.0]
    assert at["jawOpen"] == list(head.jaw.centre)
    for side, eye in (("left", [30.0, 30.0, 0.0]), ("right", [-30.0, 30.0, 0.0])):
        assert at[f"{side}EyeYaw"] == at[f"{side}EyePitch"] == eye


def test_axes_are_those_of_ros() -> None:
    """REP 103: x forward, y left, z up; head space is x left, y up, z forward."""
    np.testing.assert_array_equal(ROS_AXES @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(ROS_AXES @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(ROS_AXES @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    axes = {joint.name: joint.axis for joint in joints_of(small_head())}
    for name, axis in axes.items():
        wanted = {"Yaw": (0, 0, 1), "Roll": (1, 0, 0)}
        assert axis == next((own for ending, own in wanted.items() if name.endswith(ending)), (0, 1, 0)), name


def test_joints_of_the_neck_turn_the_head_as_its_parameters_do() -> None:
    angles = np.array([0.4, -0.3, 0.2])
    joints = joints_of(small_head())[:3]
    turn = Rotation.identity()
    for joint, angle in zip(joints, angles, strict=True):
        turn = turn * Rotation.from_rotvec(angle * np.array(joint.axis, float))
    np.testing.assert_allclose(ROS_AXES.T @ turn.as_matrix() @ ROS_AXES, rotation(*angles), atol=1e-12)


def test_limits_are_those_of_the_parameters_where_no_others_are_given() -> None:
    degrees = {"headYaw": 60, "headPitch": 40, "headRoll": 30, "leftEyeYaw": 35, "leftEyePitch": 30, "rightEyeYaw": 35,
               "rightEyePitch": 30}  # fmt: skip
    limits = {joint.name: joint.limit for joint in joints_of(small_head())}
    for name, most in degrees.items():
        assert (limits[name].low_rad, limits[name].high_rad) == pytest.approx((-math.radians(most), math.radians(most)))
        assert limits[name].speed_rad_s == 6.0
    assert (limits["jawOpen"].low_rad, limits["jawOpen"].high_rad) == (0.0, 0.4)  # the jaw of the head
    given = JointLimit(-0.5, 0.25, 1.5)
    found = {joint.name: joint.limit for joint in joints_of(small_head(), {"headYaw": given, "wheel": given})}
    assert found.pop("headYaw") is given
    assert found == {name: limit for name, limit in limits.items() if name != "headYaw"}


def test_a_head_with_one_eye_has_its_joints_alone() -> None:
    names = [joint.name for joint in joints_of(small_head(eyes=np.array([[30.0, 30.0, 0.0]])))]
    assert names == ["headYaw", "headPitch", "headRoll", "jawOpen", "leftEyeYaw", "leftEyePitch"]
    names = [joint.name for joint in joints_of(small_head(eyes=np.zeros((0, 3))))]
    assert names == ["headYaw", "headPitch", "headRoll", "jawOpen"]


def test_a_joint_of_an_unknown_ending_has_no_axis() -> None:
    with pytest.raises(StopIteration):
        _ = Joint("earLeft", BASE, np.zeros(3), JointLimit(0.0, 1.0)).axis
