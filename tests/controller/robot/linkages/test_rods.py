"""Rods against geometry that is computed another way: scipy's rotations and solver, and distances of rods."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from controller.robot.linkages.rods import POSE, Rods, turn
from tests.controller.robot.necks import AXIS, AXLE, HORN, PLATE, differential, stewart


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


def test_a_rod_in_one_plane_follows_the_law_of_cosines() -> None:
    """Horn and rod as the crank and the link of a planar linkage whose plate only moves up."""
    plate, axle = np.array([[10.0, 0.0, 0.0]] * 1), np.array([[0.0, -30.0, 0.0]])
    rods = Rods.of(("y",), plate, axle, np.array([[10.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 5.0]]))
    assert rods.rod_mm == pytest.approx([30.0]) and rods.side.tolist() == [-1.0]
    for up in (-8.0, -3.0, 0.0, 4.0, 8.5):
        (angle,), outside = rods.angles(np.array([up]))
        distance = np.hypot(10.0, 30.0 + up)
        between = np.arccos((distance**2 + 10.0**2 - 30.0**2) / (2.0 * 10.0 * distance))
        assert not outside and angle == pytest.approx(np.degrees(np.arctan2(30.0 + up, 10.0) - between))


def test_a_horn_on_the_other_side_of_its_rod_takes_the_other_solution() -> None:
    plate, horn = np.array([[10.0, 0.0, 0.0]]), np.array([[10.0, 0.0, 0.0]])
    above = Rods.of(("y",), plate, np.array([[0.0, -30.0, 0.0]]), horn, np.array([[0.0, 0.0, 1.0]]))
    below = Rods.of(("y",), plate, np.array([[0.0, 30.0, 0.0]]), horn, np.array([[0.0, 0.0, 1.0]]))
    assert below.side.tolist() == [1.0]
    (up,), (down,) = above.angles(np.array([5.0]))[0], below.angles(np.array([-5.0]))[0]
    assert up == pytest.approx(-down) and up > 5.0


def test_horns_are_taken_across_their_axes_and_axes_of_any_length() -> None:
    slanted = Rods.of(("pitch", "roll"), PLATE, AXLE, HORN + 7.0 * AXIS, 3.0 * AXIS)
    straight = differential()
    np.testing.assert_allclose(slanted.horn, straight.horn)
    np.testing.assert_allclose(slanted.across, straight.across)
    np.testing.assert_allclose(slanted.rod_mm, straight.rod_mm)
    lengths = np.linalg.norm(straight.across, axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(straight.horn, axis=1))


def test_angles_are_between_a_half_turn_back_and_a_half_turn_on() -> None:
    """A crank that is dragged round by more than a quarter turn, its solution turning past half a turn."""
    plate, axle = np.array([[-10.0, 8.0, 0.0]]), np.array([[0.0, 0.0, 0.0]])
    rods = Rods.of(("x",), plate, axle, np.array([[5.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    found = []
    for x in np.linspace(-1.5, 0.0, 30):
        (angle,), outside = rods.angles(np.array([x]))
        assert not outside and -180.0 <= angle < 180.0
        found.append(angle)
    tips = ends_of_horns(rods, np.array([found[0]]))
    assert np.linalg.norm(plate - [1.5, 0.0, 0.0] - tips) == pytest.approx(rods.rod_mm[0])


def test_as_far_as_rods_reach_is_found_to_a_ten_millionth() -> None:
    plate, axle = np.array([[10.0, 0.0, 0.0]]), np.array([[0.0, -30.0, 0.0]])
    rods = Rods.of(("y",), plate, axle, np.array([[10.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]))
    highest = np.sqrt(40.0**2 - 10.0**2) - 30.0  # horn and rod in one line
    assert not rods.angles(np.array([highest - 1e-6]))[1]
    angles, outside = rods.angles(np.array([50.0]))
    assert outside and angles == pytest.approx([np.degrees(np.arctan2(30.0 + highest, 10.0))], abs=0.05)
    assert rods.angles(np.array([highest + 1e-6]))[1]


def test_a_horn_in_line_with_its_rod_at_rest_is_refused() -> None:
    """There the horn may turn either way for the same motion of the plate."""
    plate, axle, axis = np.array([[0.0, 0.0, 0.0]]), np.array([[0.0, -40.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    with pytest.raises(ValueError, match=r"do not (fit|determine) the plate"):
        Rods.of(("y",), plate, axle, np.array([[0.0, 10.0, 0.0]]), axis)


def test_every_input_of_a_pose_has_its_place() -> None:
    assert POSE == ("x", "y", "z", "yaw", "pitch", "roll")
    made = Rods.of(("roll", "pitch"), PLATE, AXLE, HORN, AXIS)
    assert made.inputs == (5, 4)
    np.testing.assert_allclose(made.angles(np.array([4.0, 9.0]))[0], differential().angles(np.array([9.0, 4.0]))[0])
