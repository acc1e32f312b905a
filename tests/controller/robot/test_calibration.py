"""controller.robot.calibration: a robot is carried onto what was captured, or the file is refused whole."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.calibration import (
    CapturedAngles,
    calibrated,
    calibration_path,
    fit_to_captured,
    rest_deg,
    save_calibration,
)
from controller.robot.channels import build_table
from controller.robot.robot import load_robot

HEAD = find_config("robots", "head24")


def jaw_deg(robot, value: float) -> float:
    values = PARAMETERS.neutral()
    values[PARAMETERS.index("jawOpen")] = value
    table = build_table(robot.channels, PARAMETERS)
    return float(np.degrees(table.angles(values)[0][table.names.index("jawOpen")]))


def test_neutral_and_ends_become_those_captured(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    save_calibration(path, "desk", "head24", {"jawOpen": CapturedAngles(min_deg=-4, neutral_deg=3, max_deg=19)})
    robot = calibrated(load_robot(HEAD, PARAMETERS), path)
    assert jaw_deg(robot, 0.0) == pytest.approx(3.0)
    assert jaw_deg(robot, 1.0) == pytest.approx(19.0)
    jaw = next(channel for channel in robot.channels if channel.name == "jawOpen")
    assert jaw.limit_deg == (-4, 19)
    others = [(a, b) for a, b in zip(robot.channels, load_robot(HEAD, PARAMETERS).channels, strict=True)]
    assert all(a == b for a, b in others if a.name != "jawOpen")


@pytest.mark.parametrize(
    ("at", "deg", "gives"),
    [
        ([0, 1], [0, 20], [2, 9]),
        ([0, 1], [0, -20], [2, -5]),
        ([-1, 0, 1], [-30, 0, 30], [-5, 2, 9]),
        ([-1, 1], [30, -30], [9, 2, -5]),
        ([-2, -1, 2], [-30, -20, 30], [-5, -2.375, 2, 9]),
        ([-1, 0, 0.5, 1], [-30, 0, 3, 30], [-5, 2, 2.7, 9]),
        ([0.5, 1], [10, 20], [2, 9]),
    ],
)
def test_points_are_stretched_on_either_side_of_rest(at: list[float], deg: list[float], gives: list[float]) -> None:
    robot = load_robot(HEAD, PARAMETERS)
    points = robot.channels[0].map.model_copy(update={"at": at, "deg": deg})
    channel = robot.channels[0].model_copy(update={"map": points, "trim_deg": 4.0})
    out = fit_to_captured(channel, CapturedAngles(min_deg=-5, neutral_deg=2, max_deg=9))
    assert out.map.deg == pytest.approx(gives)
    assert out.trim_deg == 0.0
    assert rest_deg(out) == pytest.approx(2.0)


@pytest.mark.parametrize("curve", ["straight", "smooth"])
def test_the_neutral_angle_is_kept_where_no_point_is_at_rest(curve: str) -> None:
    """Of eyes, whose points are their ends alone, with a servo horn that is mounted askew."""
    robot = load_robot(HEAD, PARAMETERS)
    for at, deg in (([-1, 1], [-30, 30]), ([-1, -0.5, 1], [-30, -25, 30])):
        points = robot.channels[0].map.model_copy(update={"at": at, "deg": deg, "curve": curve})
        channel = robot.channels[0].model_copy(update={"map": points})
        out = fit_to_captured(channel, CapturedAngles(min_deg=-30, neutral_deg=8, max_deg=30))
        assert rest_deg(out) == pytest.approx(8.0, abs=1e-3)
        assert (out.map.deg[0], out.map.deg[-1]) == (-30, 30)


def test_a_robot_file_names_its_calibration(tmp_path: Path) -> None:
    robot = tmp_path / "mine.toml"
    text = HEAD.read_text().replace('name = "head24"', 'name = "head24"\ncalibration = "desk"', 1)
    robot.write_text(text)
    with pytest.raises(ConfigError, match=r"mine\.desk\.calibration\.toml"):
        load_robot(robot, PARAMETERS)
    path = calibration_path("desk", robot)
    save_calibration(path, "desk", "head24", {"jawOpen": CapturedAngles(min_deg=-4, neutral_deg=3, max_deg=19)})
    assert jaw_deg(load_robot(robot, PARAMETERS), 0.0) == pytest.approx(3.0)


def test_faults_are_told_together_with_the_nearest_name(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    save_calibration(path, "desk", "other", {"jawOpne": CapturedAngles(min_deg=-4, neutral_deg=3, max_deg=19)})
    with pytest.raises(ConfigError, match="2 faults") as caught:
        calibrated(load_robot(HEAD, PARAMETERS), path)
    assert "'jawOpen'" in str(caught.value)
    assert "'other'" in str(caught.value)


@pytest.mark.parametrize("angles", [(3, 2, 9), (2, 9, 3), (1, 1, 1)])
def test_angles_out_of_order_are_refused(angles: tuple[float, float, float], tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    low, rest, high = angles
    path.write_text(
        f'name = "a"\nrobot = "head24"\n[channels.jawOpen]\nmin_deg = {low}\nneutral_deg = {rest}\nmax_deg = {high}\n'
    )
    with pytest.raises(ConfigError, match=r"channels\.jawOpen"):
        calibrated(load_robot(HEAD, PARAMETERS), path)


def test_a_file_without_a_version_is_read_as_one_with(tmp_path: Path) -> None:
    new, old = tmp_path / "new.toml", tmp_path / "old.toml"
    save_calibration(new, "desk", "head24", {"jawOpen": CapturedAngles(min_deg=-4, neutral_deg=3, max_deg=19)})
    first, rest = new.read_text().split("\n", 1)
    assert first == "format = 1"
    old.write_text(rest)
    robot = load_robot(HEAD, PARAMETERS)
    assert calibrated(robot, old) == calibrated(robot, new) != robot


def test_a_newer_file_is_refused_for_that_alone(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text('format = 2\nwhatever = "is new"\n')
    with pytest.raises(ConfigError, match="newer omote") as caught:
        calibrated(load_robot(HEAD, PARAMETERS), path)
    assert "1 fault" in str(caught.value)


def test_a_calibration_of_no_channel_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text('name = "desk"\nrobot = "head24"\n[channels]\n')
    with pytest.raises(ConfigError, match="channels: "):
        calibrated(load_robot(HEAD, PARAMETERS), path)


def test_the_neutral_angle_may_be_an_end() -> None:
    for angles in ((-4, -4, 9), (-4, 9, 9)):
        low, rest, high = angles
        found = CapturedAngles(min_deg=low, neutral_deg=rest, max_deg=high)
        assert (found.min_deg, found.neutral_deg, found.max_deg) == angles


def test_the_angle_at_rest_is_that_of_zero_or_of_the_nearest_end() -> None:
    channel = load_robot(HEAD, PARAMETERS).channels[0]
    for at, deg, wanted in (([-1, 1], [10, 30], 20.0), ([0.5, 1], [4, 8], 4.0), ([-2, -1], [4, 8], 8.0)):
        points = channel.map.model_copy(update={"at": at, "deg": deg})
        assert rest_deg(channel.model_copy(update={"map": points, "trim_deg": 5.0})) == pytest.approx(wanted)


def test_a_calibration_is_written_as_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    save_calibration(
        path, 'my "desk"', "head24", {"jawOpen": CapturedAngles(min_deg=-4, neutral_deg=1.23456, max_deg=19)}
    )
    assert tomllib.loads(path.read_text()) == {
        "format": 1,
        "name": 'my "desk"',
        "robot": "head24",
        "channels": {"jawOpen": {"min_deg": -4.0, "neutral_deg": 1.23, "max_deg": 19.0}},
    }
    assert calibration_path("desk", Path("/a/mine.toml")) == Path("/a/mine.desk.calibration.toml")
    assert calibration_path("other.toml", Path("/a/mine.toml")) == Path("/a/other.toml")


def test_faults_of_a_calibration_begin_with_the_robot(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    save_calibration(path, "desk", "other", {"jawOpne": CapturedAngles(min_deg=-4, neutral_deg=3, max_deg=19)})
    with pytest.raises(ConfigError) as caught:
        calibrated(load_robot(HEAD, PARAMETERS), path)
    lines = str(caught.value).splitlines()
    assert lines[1].startswith("  robot: is a calibration of 'other'") and lines[2].startswith("  channels.jawOpne: ")
