"""controller.panels.session.servo_captures"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.panels.session.servo_captures import Captured, ServoCaptures
from controller.robot.calibration import calibrated
from controller.robot.robot import load_robot

ROBOT = load_robot(find_config("robots", "head24"), PARAMETERS)


def servo(measured_deg: float | None, name: str = ROBOT.channels[0].name) -> dict[str, Any]:
    return {"bus": "head", "id": 1, "name": name, "measured_deg": measured_deg}


@pytest.fixture
def captures(tmp_path: Path) -> ServoCaptures:
    return ServoCaptures([ROBOT], tmp_path)


def test_three_angles_become_a_calibration_of_the_robot(captures: ServoCaptures, tmp_path: Path) -> None:
    for mark, angle in (("lowest", -12.345), ("neutral", 1.0), ("highest", 20.0)):
        captures.capture(servo(angle), mark)  # type: ignore[arg-type]
    (path,) = captures.save("desk")
    assert path == tmp_path / f"{ROBOT.name}.desk.calibration.toml"
    found = calibrated(ROBOT, path).channels[0]
    assert found.limit_deg == pytest.approx((-12.35, 20.0), abs=0.011)
    with pytest.raises(ParameterError, match="such a file already"):
        captures.save("desk")


def test_a_servo_that_is_captured_in_part_or_out_of_order_is_not_saved(captures: ServoCaptures) -> None:
    captures.capture(servo(5.0), "lowest")
    captures.capture(servo(0.0), "neutral")
    with pytest.raises(ParameterError, match="lowest, neutral and highest"):
        captures.save("desk")
    captures.capture(servo(9.0), "highest")
    with pytest.raises(ParameterError, match="in this order"):
        captures.save("desk")
    captures.clear(servo(0.0))
    assert captures.of(servo(0.0)) == Captured()


def test_what_cannot_be_captured_or_named_is_refused(captures: ServoCaptures) -> None:
    with pytest.raises(ParameterError, match="does not say where it is"):
        captures.capture(servo(None), "lowest")
    with pytest.raises(ParameterError, match="cannot be the name"):
        captures.save("../up")
    for mark, angle in (("lowest", 0.0), ("neutral", 1.0), ("highest", 2.0)):
        captures.capture(servo(angle, "nobody"), mark)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="belongs to no robot"):
        captures.save("desk")
