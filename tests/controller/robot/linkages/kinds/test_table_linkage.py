"""A measured table against scipy's interpolation, and what is said of a wrong one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from controller.base.config import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.linkages.kinds.table_linkage import GridTable
from controller.robot.linkages.linked_channels import LinkedChannels
from controller.robot.robot import load_robot
from tests.controller.robot.necks import ROBOT, differential, face, robot_file


def test_a_table_is_interpolated_and_kept_inside(tmp_path: Path) -> None:
    rods, pitch, roll = differential(), np.array([-20.0, -5.0, 0.0, 12.0, 20.0]), np.array([-15.0, 0.0, 15.0])
    grid = np.array([[rods.angles(np.array([p, r]))[0] for r in roll] for p in pitch])
    rows = [f"{r},{grid[i, j, 1]},{p},{grid[i, j, 0]}" for i, p in enumerate(pitch) for j, r in enumerate(roll)]
    (tmp_path / "neck.csv").write_text("roll,right,pitch,left\n" + "\n".join(reversed(rows)) + "\n")
    text = '[[linkages]]\nname = "neck"\nkind = "table"\nchannels = ["left", "right"]\nfile = "neck.csv"\n'
    text += "inputs.pitch = { headPitch = 40 }\ninputs.roll = { headRoll = 30 }\n"
    robot = load_robot(robot_file(tmp_path, ROBOT + text), P)
    linked = LinkedChannels.of(robot.linkages[0], ["left", "right"], P)
    oracle = RegularGridInterpolator((pitch, roll), grid)
    for a, b in np.random.default_rng(4).uniform(-0.5, 0.5, (20, 2)):
        assert linked(face(headPitch=a, headRoll=b)) == pytest.approx(oracle([[40 * a, 30 * b]])[0])
    assert linked.times == 0
    assert linked(face(headPitch=1.0)) == pytest.approx(grid[-1, 1])
    assert (linked.outside, linked.times) == (True, 1)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("pitch,left,right\n0,1,2\n", "there is no column 'roll'"),
        ("pitch,roll,left,right\n0,0,1,2\n", "pitch: needs two values or more"),
        ("pitch,roll,left,right\n0,0,1,2\n1,1,1,2\n", "there is no row for pitch = 0, roll = 1, and 1 more"),
        ("pitch,roll,left,right\n0,0,1,2\n0,0,1,2\n1,1,2,3\n", "pitch = 0, roll = 0 stands there twice"),
        ("# by hand\n\npitch,roll,left,right\n0,0,1,x\n", "line 4: a number is missing"),
    ],
)
def test_a_wrong_table_says_what_is_wrong(tmp_path: Path, content: str, fault: str) -> None:
    (tmp_path / "neck.csv").write_text(content)
    text = '[[linkages]]\nname = "neck"\nkind = "table"\nchannels = ["left", "right"]\nfile = "neck.csv"\n'
    with pytest.raises(ConfigError) as caught:
        load_robot(robot_file(tmp_path, ROBOT + text + "inputs = { pitch = 'headPitch', roll = 'headRoll' }\n"), P)
    assert fault in str(caught.value)


def test_few_rows_cannot_ask_for_a_large_grid(tmp_path: Path) -> None:
    """1900 rows along a diagonal span 6.9 billion combinations, for which there would be no room."""
    rows = [f"{k},{k},{k},0,0" for k in range(1900)]
    (tmp_path / "neck.csv").write_text("pitch,roll,yaw,left,right\n" + "\n".join(rows))
    text = '[[linkages]]\nname = "neck"\nkind = "table"\nchannels = ["left", "right"]\nfile = "neck.csv"\n'
    inputs = "inputs = { pitch = 'headPitch', roll = 'headRoll', yaw = 'headYaw' }\n"
    with pytest.raises(ConfigError, match="no row for pitch = 0, roll = 0, yaw = 1, and 6858998099 more"):
        load_robot(robot_file(tmp_path, ROBOT + text + inputs), P)


def test_points_of_the_grid_get_their_own_values_and_cells_between_them_straight_ones() -> None:
    grid = GridTable((np.array([0.0, 1.0, 5.0]),), np.array([[10.0, -1.0], [20.0, -2.0], [0.0, -6.0]]))
    for at, wanted in ((0.0, [10, -1]), (1.0, [20, -2]), (5.0, [0, -6]), (0.5, [15, -1.5]), (3.0, [10, -4])):
        found, outside = grid.angles(np.array([at]))
        assert not outside and found == pytest.approx(wanted)
    for at, wanted in ((-1e-9, [10, -1]), (5.001, [0, -6]), (1e9, [0, -6])):
        found, outside = grid.angles(np.array([at]))
        assert outside and found == pytest.approx(wanted)


def test_three_inputs_are_interpolated_as_scipy_does() -> None:
    rng = np.random.default_rng(8)
    axes = tuple(np.sort(rng.uniform(-10, 10, n)) for n in (4, 2, 3))
    values = rng.normal(size=(4, 2, 3, 3))
    grid, oracle = GridTable(axes, values), RegularGridInterpolator(axes, values)
    for inputs in rng.uniform([a[0] for a in axes], [a[-1] for a in axes], (30, 3)):
        found, outside = grid.angles(inputs)
        assert not outside and found == pytest.approx(oracle([inputs])[0])


def test_a_table_has_no_more_rows_than_a_measurement_has(tmp_path: Path) -> None:
    (tmp_path / "neck.csv").write_text("pitch,roll,left,right\n" + "0,0,0,0\n" * 20_001)
    text = '[[linkages]]\nname = "neck"\nkind = "table"\nchannels = ["left", "right"]\nfile = "neck.csv"\n'
    with pytest.raises(ConfigError, match="has 20002 rows; 20000 at most"):
        load_robot(robot_file(tmp_path, ROBOT + text + "inputs = { pitch = 'headPitch', roll = 'headRoll' }\n"), P)


def test_a_table_that_is_missing_or_empty_is_one_message(tmp_path: Path) -> None:
    text = '[[linkages]]\nname = "neck"\nkind = "table"\nchannels = ["left", "right"]\nfile = "neck.csv"\n'
    path = robot_file(tmp_path, ROBOT + text + "inputs = { pitch = 'headPitch' }\n")
    with pytest.raises(ConfigError, match=r"neck\.csv"):
        load_robot(path, P)
    (tmp_path / "neck.csv").write_text("")
    with pytest.raises(ConfigError, match="there is no column 'pitch'"):
        load_robot(path, P)
    (tmp_path / "neck.csv").write_text("# pitch measured\npitch,left,right\n1,2\n")
    with pytest.raises(ConfigError, match="line 3: a number is missing"):
        load_robot(path, P)
