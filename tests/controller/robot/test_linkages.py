"""Linkages of a robot: its servos follow them, limits come after them, and a channel follows one thing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.config import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.channels import build_table
from controller.robot.following import Mirror
from controller.robot.linkages.kind import LINKAGES
from controller.robot.robot import load_robot
from controller.robot.safety import GoalFilter
from tests.controller.robot.necks import NECK, ROBOT, face, robot_file


def test_the_mirror_turns_measured_servos_into_the_head(tmp_path: Path) -> None:
    robot = load_robot(robot_file(tmp_path, ROBOT + NECK), P)
    table = build_table(robot.channels, P, linkages=robot.linkages)
    assert table.reached[P.indices(["headPitch", "headRoll"])].all()
    mirror = Mirror(table, P)
    worst = 0.0
    for pitch, roll in np.random.default_rng(5).uniform(-0.45, 0.45, (30, 2)):
        angles, held = table.angles(face(headPitch=pitch, headRoll=roll))
        assert held == 0
        found = mirror.read(angles)
        away = found[P.indices(["headPitch", "headRoll"])] - [pitch, roll]
        worst = max(worst, *np.abs(away * [40.0, 30.0]))
    assert worst < 0.1  # degrees


def test_limits_of_the_servos_come_after_the_linkage(tmp_path: Path) -> None:
    robot = load_robot(robot_file(tmp_path, ROBOT.replace("-90, 90", "-12, 12") + NECK), P)
    goals = GoalFilter(robot.channels, P, robot.rules, 0.01, None, robot.linkages_on("neck"))
    for _ in range(200):
        wanted, _ = goals.table.angles(face(headPitch=1.0, headRoll=1.0))
        sent = goals.step(wanted)
        assert (np.abs(np.degrees(sent)) <= 12.0 + 1e-9).all()
    assert goals.out_of_reach() == {"neck": 1}


def test_a_channel_follows_one_thing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="or a linkage that names it"):
        load_robot(robot_file(tmp_path, ROBOT), P)
    with pytest.raises(ConfigError, match="has a mix, formula or anchor of its own"):
        load_robot(robot_file(tmp_path, ROBOT.replace("id = 1", 'id = 1\nformula = "jawOpen"') + NECK), P)


def test_kinds_register_themselves() -> None:
    assert LINKAGES.kinds() == ["differential", "gimbal", "stewart", "table"]
    kinds: list[Any] = LINKAGES.all()
    assert [each.kind for each in kinds] == LINKAGES.kinds()
