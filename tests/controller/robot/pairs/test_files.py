"""controller.robot.pairs.files: which numbers a table may have, what is written for a fit, and what is reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.pairs.files import FittedChannel, _keep, _keys, read_pairs, report_rows
from controller.robot.pairs.fit import FittedServo, FittedTerm
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from tests.controller.robot.small_robot import robot_text

CHANNEL = """
[[channels]]
name = "jaw"
id = 1
profile = "servo"
mix = { jawOpen = 1 }
"""


@pytest.fixture
def robot(tmp_path: Path) -> RobotSettings:
    (tmp_path / "robot.toml").write_text(robot_text("one") + CHANNEL)
    return load_robot(tmp_path / "robot.toml", P)


@pytest.mark.parametrize(
    ("column", "number", "read"),
    [
        ("jawOpen", 1.05, 1.0),  # a twentieth of the range beyond it, which is clipped
        ("jawOpen", -0.05, 0.0),
        ("jawOpen", 1.051, None),
        ("jawOpen", -0.051, None),
        ("headYaw", 1.1, 1.0),  # its range is from -1 to 1
        ("headYaw", -1.1, -1.0),
        ("headYaw", 1.101, None),
        ("headYaw", -1.101, None),
        ("time", 1e9, 0.0),
    ],
)
def test_a_number_may_be_a_twentieth_beyond_its_range(
    robot: RobotSettings, tmp_path: Path, column: str, number: float, read: float | None
) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text(f"{column},servos:jaw\n" + "0,1\n" * 20 + f"{number},-39600\n0,1\n")  # a tenth of its range
    if read is None:
        with pytest.raises(ConfigError, match=rf"row 22: {column} is {number:g}, beyond -?\d to 1, its range"):
            read_pairs(path, robot, P)
    else:
        pairs = read_pairs(path, robot, P)
        assert len(pairs.values) == 22 and pairs.deg["jaw"][19:].tolist() == [1.0, -39600.0, 1.0]
        at = P.find(column)
        assert (0.0 if at is None else pairs.values[20, at]) == read
        assert np.array_equal(np.delete(pairs.values, [] if at is None else [at], 1)[20], np.delete(P.rest, at or []))


def test_a_name_that_stands_twice_is_named_for_each(robot: RobotSettings, tmp_path: Path) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text("jawOpen,jawOpen,servos:jaw\n" + "0,0,1\n" * 20)
    with pytest.raises(ConfigError, match=r"column 'jawOpen': stands there twice"):
        read_pairs(path, robot, P)


def fitted(robot: RobotSettings, terms: list[FittedTerm], rest_deg: float, **more: object) -> FittedChannel:
    given: dict[str, object] = {
        "terms": terms, "rest_deg": rest_deg, "span_deg": 30.04, "rms_deg": 0.256, "left_out_deg": 0.304,
        "alike": [], "why_not": "", **more,
    }  # fmt: skip
    return FittedChannel(robot.channels[0], FittedServo(**given), str(given["why_not"]))  # type: ignore[arg-type]


def test_a_line_is_written_as_its_weight_and_a_curve_by_its_corners(robot: RobotSettings) -> None:
    low, high = robot.channels[0].limit_deg
    line = FittedTerm(P.index("jawOpen"), np.array([0.25, 0.75]), np.array([1.0, 4.00004]))
    curve = FittedTerm(P.index("mouthClose"), np.array([0.0, 0.333333, 1.0]), np.array([0.0, 1.23456, 5.0]))
    assert _keys(fitted(robot, [line, curve], 3.00006), P) == {
        "mix": {"jawOpen": 6.0001, "mouthClose": {"at": [0.0, 0.33333, 1.0], "gives": [0.0, 1.2346, 5.0]}},
        "join": "sum",
        "map": {"at": [low - 3.0001, high - 3.0001], "deg": [low, high]},
        "trim_deg": 0.0,
    }


@pytest.mark.parametrize(
    ("rest_deg", "outside"), [(-45.0, False), (45.0, False), (-45.1, True), (45.1, True), (0.0, False)]
)
def test_a_report_says_what_is_to_be_known_of_a_channel(robot: RobotSettings, rest_deg: float, outside: bool) -> None:
    assert robot.channels[0].limit_deg == (-45, 45)
    line = FittedTerm(P.index("jawOpen"), np.array([0.0, 1.0]), np.array([0.0, 4.0]))
    curve = FittedTerm(P.index("mouthClose"), np.array([0.0, 0.5, 1.0]), np.zeros(3))
    alike = [(P.index("jawOpen"), P.index("mouthClose"))]
    kept = fitted(robot, [], rest_deg, why_not="it does not move")
    doubted = fitted(robot, [line, curve], rest_deg, alike=alike)
    first, second = report_rows([doubted, kept], P)
    said = [f"rests at {rest_deg:.1f}, beyond limit_deg"] * outside + ["jawOpen may as well be mouthClose"]
    assert first == ("jaw", "30.0", "0.26", "0.30", "jawOpen, mouthClose (curve)", "; ".join(said))
    assert second == ("jaw", "30.0", "0.26", "0.30", "", "stays as it is: it does not move")


def test_old_files_are_numbered_from_one_on(tmp_path: Path) -> None:
    for number in (1, 2, 3):
        kept = _keep(tmp_path / "robot.toml")
        assert kept == tmp_path / f"robot.before{number}.toml"
        kept.touch()
