"""Settings of linkages of rods: what is said of wrong ones, and that servos get the angles of their rods."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.config import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.linkages.kind import read_linkage
from controller.robot.linkages.kinds.differential_linkage import DifferentialSettings, make_rods
from controller.robot.robot import load_robot
from tests.controller.robot.necks import AXIS, AXLE, HORN, NECK, PLATE, ROBOT, differential, robot_file


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('["left", "right"]', '["left", "rigt"]', "no channel called 'rigt', did you mean 'right'"),
        ('["left", "right"]', '["left", "left"]', "'left' is named twice"),
        ("headPitch = 40", "headPich = 40", "inputs.pitch: unknown parameter 'headPich'"),
        ("inputs.pitch", "inputs.pich", "there is no 'pich'; there are x, y, z"),
        ('"30 * headRoll"', '"30 * headRoll.x"', "is not allowed in a formula"),
        ('kind = "differential"', 'kind = "diferential"', "differential"),
        ("axis = [[1.0", "axis = [[0.0", "axis must not be zero"),
        ("plate = ", "plat = ", "unknown key, did you mean 'plate'"),
    ],
)
def test_a_wrong_linkage_says_what_is_wrong(tmp_path: Path, old: str, new: str, fault: str) -> None:
    assert old in NECK
    with pytest.raises(ConfigError) as caught:
        load_robot(robot_file(tmp_path, ROBOT + NECK.replace(old, new)), P)
    assert fault in str(caught.value)


def table(**changes: object) -> dict[str, object]:
    """The table of a neck, with some of its keys changed."""
    points = {"plate": PLATE.tolist(), "axle": AXLE.tolist(), "horn": HORN.tolist(), "axis": AXIS.tolist()}
    inputs = {"pitch": "40 * headPitch", "roll": "30 * headRoll"}
    return {"name": "neck", "kind": "differential", "channels": ["a", "b"], "inputs": inputs, **points, **changes}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"inputs": {"pitch": "headPitch"}}, "2 servos determine 2 inputs, not 1"),
        ({"channels": ["a"]}, "channels"),
        ({"horn": [*HORN.tolist(), [0.0, 0.0, -18.0]]}, "horn needs a point for each of the 2 channels"),
        ({"axle": AXLE.tolist()[:1]}, "axle"),
        ({"axis": [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}, "axis must not be zero"),
        ({"plate": [[28.0, 0.0, float("nan")], [-28.0, 0.0, -30.0]]}, "plate"),
        ({"horn": AXIS.tolist()}, "horn must not lie along axis"),
        ({"inputs": {"pitch": "headPitch", "yaw": "headYaw"}, "plate": [[0.0, 0, -30.0]] * 2,
          "axle": [[0.0, -70, -12.0]] * 2},
         "do not determine the plate"),
    ],
)  # fmt: skip
def test_geometry_that_moves_no_plate_is_refused(changes: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read_linkage(table(**changes))


def test_servos_get_the_angles_of_rods_of_the_same_geometry() -> None:
    settings = read_linkage(table())
    assert isinstance(settings, DifferentialSettings)
    for inputs in np.random.default_rng(6).uniform(-15, 15, (10, 2)):
        found, outside = make_rods(settings).angles(inputs)
        assert not outside
        np.testing.assert_allclose(found, differential().angles(inputs)[0])
