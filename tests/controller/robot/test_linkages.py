"""Linkages against geometry that is computed another way: scipy's rotations and solver, and distances of rods."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from controller.base.config import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.channels import build_table
from controller.robot.following import Mirror
from controller.robot.linkages.kind import LINKAGES, read_linkage
from controller.robot.linkages.linked_channels import LinkedChannels
from controller.robot.linkages.rods import Rods, turn
from controller.robot.robot import load_robot
from controller.robot.safety import GoalFilter

PLATE = np.array([[28.0, 0.0, -30.0], [-28.0, 0.0, -30.0]])
AXLE = np.array([[28.0, -70.0, -12.0], [-28.0, -70.0, -12.0]])
HORN = np.array([[0.0, 0.0, -18.0], [0.0, 0.0, -18.0]])
AXIS = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
NECK = f"""
[[linkages]]
name = "neck"
kind = "differential"
channels = ["left", "right"]
inputs.pitch = {{ headPitch = 40 }}
inputs.roll = "30 * headRoll"
plate = {PLATE.tolist()}
axle = {AXLE.tolist()}
horn = {HORN.tolist()}
axis = {AXIS.tolist()}
"""
ROBOT = """
name = "necks"
buses = [{ name = "neck", kind = "simulated", transport = "memory" }]
[profiles.servo]
bus = "neck"
model = "xl330-m288"
map = { at = [-90, 90], deg = [-90, 90] }
limit_deg = [-90, 90]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
[[channels]]
name = "left"
id = 1
profile = "servo"
[[channels]]
name = "right"
id = 2
profile = "servo"
"""


def face(**values: float) -> np.ndarray:
    vector = P.neutral()
    for name, value in values.items():
        vector[P.index(name)] = value
    return vector


def robot_file(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return path


def differential() -> Rods:
    return Rods.of(("pitch", "roll"), PLATE, AXLE, HORN, AXIS)


def stewart() -> Rods:
    """Six rods in pairs around a plate 60 mm above its servos, which lie in three pairs."""
    at = np.radians([50.0, 70.0, 170.0, 190.0, 290.0, 310.0])
    base = np.radians([10.0, 110.0, 130.0, 230.0, 250.0, 350.0])
    plate = np.stack([40 * np.cos(at), 0 * at, 40 * np.sin(at)], axis=1)
    axle = np.stack([50 * np.cos(base), 0 * base - 70.0, 50 * np.sin(base)], axis=1)
    axis = np.stack([np.cos(base), 0 * base, np.sin(base)], axis=1)
    side = np.array([1.0, -1.0] * 3)[:, None]
    horn = 18 * side * np.cross(axis, [0.0, 1.0, 0.0])
    return Rods.of(("x", "y", "z", "yaw", "pitch", "roll"), plate, axle, horn, axis)


def ends_of_horns(rods: Rods, angles_deg: np.ndarray) -> np.ndarray:
    """(n, 3) by scipy: each horn turned about its axis, which is across both of its arms."""
    axis = np.cross(rods.horn, rods.across)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turned = Rotation.from_rotvec(axis * np.radians(angles_deg)[:, None]).apply(rods.horn)
    return np.asarray(rods.axle + turned)


def pose_of(rods: Rods, angles_deg: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Forward kinematics by scipy's solver: the pose in which every rod has its length."""
    tips = ends_of_horns(rods, angles_deg)

    def misfit(inputs: np.ndarray) -> np.ndarray:
        pose = np.zeros(6)
        pose[list(rods.inputs)] = inputs
        plate = Rotation.from_euler("YXZ", pose[3:], degrees=True).apply(rods.plate) + pose[:3]
        return np.asarray(np.linalg.norm(plate - tips, axis=1) - rods.rod_mm)

    return np.asarray(fsolve(misfit, start, xtol=1e-12))


def test_turns_are_those_of_scipy() -> None:
    for yaw, pitch, roll in np.random.default_rng(1).uniform(-80, 80, (20, 3)):
        assert turn(yaw, pitch, roll) == pytest.approx(
            Rotation.from_euler("YXZ", [yaw, pitch, roll], degrees=True).as_matrix()
        )


@pytest.mark.parametrize("rods", [differential(), stewart()], ids=["differential", "stewart"])
def test_forward_kinematics_by_another_solver_gives_the_pose_again(rods: Rods) -> None:
    most = np.array([3.0, 3.0, 3.0, 6.0, 6.0, 6.0] if len(rods.inputs) == 6 else [18.0, 15.0])
    for inputs in np.random.default_rng(2).uniform(-most, most, (40, len(most))):
        angles, outside = rods.angles(inputs)
        assert not outside
        assert pose_of(rods, angles, inputs + 0.1) == pytest.approx(inputs, abs=1e-5)


def test_two_servos_alike_pitch_and_against_each_other_roll() -> None:
    rods = differential()
    (left, right), _ = rods.angles(np.array([20.0, 0.0]))
    assert left == pytest.approx(right)
    assert abs(left) > 10.0
    (left, right), _ = rods.angles(np.array([0.0, 12.0]))
    assert left * right < 0.0
    assert rods.angles(np.zeros(2))[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_what_lies_out_of_reach_is_clamped_on_the_way_there_and_said() -> None:
    rods = differential()
    angles, outside = rods.angles(np.array([85.0, 60.0]))
    assert outside
    pose = pose_of(rods, angles, np.array([20.0, 14.0]))
    assert pose[1] / pose[0] == pytest.approx(60.0 / 85.0, abs=1e-3)
    before, _ = rods.angles(0.999 * pose)
    assert np.abs(angles - before).max() < 8.0  # no leap at the end of the reach


def test_rods_that_leave_the_plate_free_are_refused() -> None:
    with pytest.raises(ValueError, match="do not determine the plate"):
        Rods.of(("pitch", "yaw"), PLATE * [0, 1, 1], AXLE * [0, 1, 1], HORN, AXIS)
    with pytest.raises(ValueError, match="must not lie along axis"):
        Rods.of(("pitch", "roll"), PLATE, AXLE, AXIS, AXIS)


@pytest.mark.parametrize("outer", ["yaw", "pitch"])
def test_a_gimbal_looks_where_the_eye_shall_look(outer: str) -> None:
    table = {"name": "eye", "kind": "gimbal", "channels": ["a", "b"], "outer": outer,
             "inputs": {"pitch": {"leftEyePitch": 30}, "yaw": {"leftEyeYaw": 35}}}  # fmt: skip
    linked = LinkedChannels.of(read_linkage(table), ["a", "b"], P)
    order = "YX" if outer == "yaw" else "XY"
    for yaw, pitch in np.random.default_rng(3).uniform(-1, 1, (20, 2)):
        servo_yaw, servo_pitch = linked(face(leftEyeYaw=yaw, leftEyePitch=pitch))
        angles = [servo_yaw, servo_pitch] if outer == "yaw" else [servo_pitch, servo_yaw]
        seen = Rotation.from_euler(order, angles, degrees=True).apply([0.0, 0.0, 1.0])
        wanted = Rotation.from_euler("YX", [35 * yaw, 30 * pitch], degrees=True).apply([0.0, 0.0, 1.0])
        assert seen == pytest.approx(wanted)


def test_a_table_is_interpolated_and_kept_inside(tmp_path: Path) -> None:
    from scipy.interpolate import RegularGridInterpolator

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


def test_a_channel_follows_one_thing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="or a linkage that names it"):
        load_robot(robot_file(tmp_path, ROBOT), P)
    with pytest.raises(ConfigError, match="has a mix, formula or anchor of its own"):
        load_robot(robot_file(tmp_path, ROBOT.replace("id = 1", 'id = 1\nformula = "jawOpen"') + NECK), P)


def test_kinds_register_themselves() -> None:
    assert LINKAGES.kinds() == ["differential", "gimbal", "stewart", "table"]
    kinds: list[Any] = LINKAGES.all()
    assert [each.kind for each in kinds] == LINKAGES.kinds()
