"""controller.links.ros2.faces: a face as angles, frames, intensities and names, against scipy's rotations."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags", reason="pip install 'omote[ros2]'")

from controller.base.parameters import PARAMETERS as P
from controller.links.ros2.definitions import UNITS
from controller.links.ros2.faces import (
    EXPRESSIONS,
    ActionUnits,
    HeadJoints,
    named_values,
    ros_expression,
)
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import save_data
from tests.surface.small_head import small_head

JAW = P.index("jawOpen")
NAMES = ["headYaw", "headPitch", "headRoll", "jawOpen", "leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch"]
FULL_DEG = [60.0, 40.0, 30.0, math.degrees(0.4), 35.0, 30.0, 35.0, 30.0]


@pytest.fixture(scope="module")
def joints(tmp_path_factory: pytest.TempPathFactory) -> HeadJoints:
    """Of the small head: neck at (0, -50, 0), jaw at the origin that opens by 0.4 rad, eyes at (+-30, 30, 0) mm."""
    folder = tmp_path_factory.mktemp("head")
    save_data(folder, small_head())
    return HeadJoints(P, folder)


def face(**values: float) -> np.ndarray:
    found = P.neutral()
    for name, value in values.items():
        found[P.index(name)] = value
    return found


def test_damaged_intensities_count_as_nothing() -> None:
    units, given = ActionUnits(P), np.full(UNITS, np.nan)
    given[26], given[12] = np.inf, -5.0
    face = units.face(given)
    assert np.isfinite(face).all() and face[JAW] == 0.5 and face[P.index("mouthSmileLeft")] == 0.0
    assert units.read(face)[26] > 0.9


def test_angles_of_joints_are_those_of_full_scale(root: Path) -> None:
    joints = HeadJoints(P, root / "configs" / "heads" / "ict")
    yaw, jaw = joints.names.index("headYaw"), joints.names.index("jawOpen")
    ones = joints.angles(np.ones(len(P)))
    assert np.degrees(ones[yaw]) == pytest.approx(60.0) and 20.0 < np.degrees(ones[jaw]) < 30.0
    assert joints.values(0.3 * ones) == pytest.approx(0.3)
    assert joints.values(9.0 * ones) == pytest.approx(1.0) and joints.values(-9.0 * ones)[jaw] == 0.0


def test_the_jaw_goes_to_neither_side_where_no_side_is_said() -> None:
    units, given = ActionUnits(P), np.zeros(UNITS)
    given[30] = 1.0
    assert not units.face(given).any()


def test_joints_are_those_of_the_head_in_full_angles(joints: HeadJoints) -> None:
    assert joints.names == NAMES and joints.indices.tolist() == P.indices(NAMES).tolist()
    np.testing.assert_allclose(np.degrees(joints.angles(np.ones(len(P)))), FULL_DEG, atol=1e-4)
    half = joints.angles(0.5 * np.ones(len(P)))
    np.testing.assert_allclose(joints.values(half), 0.5)
    beyond = joints.values(np.radians([90.0, -90.0, np.nan, -5.0, 0.0, 0.0, 36.0, -31.0]))
    assert beyond[:2].tolist() == [1.0, -1.0] and np.isnan(beyond[2])
    assert beyond[3:].tolist() == [0.0, 0.0, 0.0, 1.0, -1.0]


def test_frames_chain_to_where_the_eyes_look(joints: HeadJoints) -> None:
    """REP 103: x forward, y left, z up, metres; yaw is positive to the left, pitch downwards, roll raises the left."""
    values = face(headYaw=0.5, headPitch=0.25, headRoll=-0.5, leftEyeYaw=0.6, leftEyePitch=-0.4)
    places = {"base_link": (np.zeros(3), Rotation.identity())}
    for frame in joints.frames(values):
        at, turn = places[frame.parent]
        places[frame.name] = at + turn.apply(frame.position_m), turn * Rotation.from_quat(frame.rotation)
    pivot, eye = np.array([0.0, 0.0, -0.05]), np.array([0.0, 0.03, 0.03])  # of the neck and the left eye
    head = Rotation.from_euler("ZYX", [30.0, 10.0, -15.0], degrees=True)
    looks = head * Rotation.from_euler("ZY", [21.0, -12.0], degrees=True)
    at, turn = places["leftEyePitch"]
    np.testing.assert_allclose(at, pivot + head.apply(eye - pivot), atol=1e-9)
    np.testing.assert_allclose(turn.as_matrix(), looks.as_matrix(), atol=1e-7)
    np.testing.assert_allclose(places["rightEyeYaw"][0], pivot + head.apply(eye * [1, -1, 1] - pivot), atol=1e-9)
    assert {frame.name: frame.parent for frame in joints.frames(values)}["jawOpen"] == "headRoll"


def test_names_mean_joints_in_rad_or_parameters_in_their_values(joints: HeadJoints) -> None:
    names = ["headYaw", "tongueOut", "wheel", "jawOpen", "mouthPucker", "cheekPuff", "leftEyeYaw"]
    positions = [math.radians(30.0), 0.4, 1.0, 0.2, 7.0, math.nan, math.inf]
    values, mask, unknown = named_values(P, joints, names, positions)
    assert unknown == ["wheel"]
    assert set(np.flatnonzero(mask)) == set(P.indices(["headYaw", "tongueOut", "jawOpen", "mouthPucker"]))
    wanted = face(headYaw=0.5, tongueOut=0.4, jawOpen=0.5, mouthPucker=1.0)
    np.testing.assert_allclose(values, wanted, atol=1e-7)


def test_without_a_head_every_name_is_a_parameter_and_missing_positions_are_left() -> None:
    values, mask, unknown = named_values(P, None, ["headYaw", "jawOpen", "mouthPucker"], [0.5, -3.0])
    assert unknown == [] and set(np.flatnonzero(mask)) == set(P.indices(["headYaw", "jawOpen"]))
    assert values[P.index("headYaw")] == 0.5 and values[JAW] == 0.0


def test_units_of_both_sides_are_read_as_the_greater_one() -> None:
    units, given = ActionUnits(P), np.zeros(UNITS)
    given[12], given[26] = 0.75, 0.5
    shown = units.face(given)
    assert shown[P.index("mouthSmileLeft")] == shown[P.index("mouthSmileRight")] > 0.4
    read = units.read(shown)
    assert read[12] == pytest.approx(0.75, abs=0.08) and read[26] == pytest.approx(0.5, abs=0.08)
    shown[P.index("mouthSmileRight")] = 0.0  # one side alone
    assert units.read(shown)[12] == pytest.approx(0.75, abs=0.15)
    assert units.read(P.neutral()).max() < 0.02 and (read >= 0.0).all() and (read <= 1.0).all()
    assert not units.moves[P.index("tongueOut")] or units.face(np.ones(UNITS)).max() <= 1.0
    assert units.moves[JAW] and units.face(np.full(UNITS, 9.0)).max() <= 1.0


def test_expressions_of_both_sides_have_names() -> None:
    known = Vocabulary.load(P)
    assert set(EXPRESSIONS.values()) <= set(known.names)
    for theirs, ours in EXPRESSIONS.items():
        assert ros_expression(ours) == theirs
    assert ros_expression("contempt") == "contempt"
    assert ros_expression("anger", {"cross": "anger"}) == "cross"
