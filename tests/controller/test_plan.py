"""A dry run tells every channel of the shipped robot."""

from __future__ import annotations

from pathlib import Path

from controller.parameters import PARAMETERS
from controller.plan import plan_rows
from controller.robot import load_robot


def test_every_channel_has_a_row_with_its_mix_and_limits(root: Path) -> None:
    robot = load_robot(root / "configs/robots/head24.toml", PARAMETERS)
    rows = {row["channel"]: row for row in plan_rows(robot, PARAMETERS)}
    assert list(rows) == [channel.name for channel in robot.channels]
    jaw = rows["jawOpen"]
    assert jaw["servo"] == "head id 4, xl330-m288"
    assert jaw["mix"] == "1 jawOpen -0.4 mouthClose"
    assert jaw["travel (deg)"] == "0 to 28"
    assert jaw["limits (deg)"] == "-2 to 30"
    assert jaw["neutral (deg)"] == "0.0"
