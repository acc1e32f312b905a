"""controller.robot.joint_limits: joints reach as far, and are as fast, as the servos that turn them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.robot.joint_limits import joint_limits
from controller.robot.robot import load_robot
from surface.head.model.joints import Joint, JointLimit

FULL = math.radians(60.0)
JOINTS = [Joint(name, "base_link", np.zeros(3), JointLimit(-FULL, FULL)) for name in ("headYaw", "headPitch")]


def test_limits_are_those_of_the_shipped_robot(root: Path) -> None:
    found = joint_limits(load_robot(root / "configs/robots/head24.toml", P), P, JOINTS)
    yaw = found["headYaw"]  # 60 degrees of servo for 60 of the head, 180 deg/s
    assert (yaw.low_rad, yaw.high_rad) == pytest.approx((-FULL, FULL))
    assert yaw.speed_rad_s == pytest.approx(math.pi)


def test_a_servo_that_ends_early_or_is_slow_limits_the_joint(root: Path, tmp_path: Path) -> None:
    text = (root / "configs/robots/head24.toml").read_text()
    before = "map = { at = [-1, 1], deg = [-60, 60] }\nlimit_deg = [-65, 65]\nmax_speed_deg_s = 180"
    assert before in text
    after = "map = { at = [-0.5, 0.25], deg = [-30, 15] }\nlimit_deg = [-30, 15]\nmax_speed_deg_s = 30"
    path = tmp_path / "robot.toml"
    path.write_text(text.replace(before, after))
    yaw = joint_limits(load_robot(path, P), P, JOINTS)["headYaw"]
    assert yaw.low_rad == pytest.approx(-0.5 * FULL, abs=0.01) and yaw.high_rad == pytest.approx(0.25 * FULL, abs=0.01)
    assert yaw.speed_rad_s == pytest.approx(math.radians(30.0))


def test_a_joint_that_no_servo_follows_keeps_its_own_limits(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", P)
    joint = Joint("tongueOut", "base_link", np.zeros(3), JointLimit(-FULL, FULL))
    assert joint_limits(robot, P, [joint]) == {}
