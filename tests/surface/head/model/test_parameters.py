"""What parameter values ask of the head."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.head.model import parameters
from surface.head.model.parameters import (
    EYE_RAD,
    HEAD_RAD,
    LID_SHARE,
    NAMES,
    SHAPES,
    TONGUE_JAW,
    head_angles,
    lid_down,
    read_pose,
    rotation,
    rotation_vector,
    smoothstep,
)


def pose(**given: float):
    return read_pose(np.array([given.get(n, 0.0) for n in NAMES]))


def shape(p, name: str) -> float:
    return float(p.shapes[SHAPES.index(name)])


def test_names_and_order_are_those_of_the_vocabulary(root):
    table = tomllib.loads((root / "configs/vocabularies/arkit.toml").read_text())
    assert len(NAMES) == len(set(NAMES)) == 59 and len(SHAPES) == 52
    assert tuple(table["parameters"]) == NAMES


def test_values_are_clipped():
    p = pose(jawOpen=7.0, mouthPucker=-1.0, headYaw=-9.0)
    assert p.jaw == 1.0 and shape(p, "mouthPucker") == 0.0 and p.head[0] == -HEAD_RAD[0]


def test_what_is_not_a_number_is_named():
    with pytest.raises(ValueError, match="mouthPucker is not a number"):
        pose(mouthPucker=np.nan)
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        read_pose(np.zeros(3))


def test_gaze_from_angles_moves_the_lids():
    p = pose(leftEyeYaw=0.5, leftEyePitch=1.0, rightEyeYaw=0.5)
    np.testing.assert_allclose(p.gaze, [[0.5 * EYE_RAD[0], EYE_RAD[1]], [0.5 * EYE_RAD[0], 0]])
    assert (shape(p, "eyeLookOutLeft"), shape(p, "eyeLookInLeft"), shape(p, "eyeLookDownLeft")) == (0.5, 0.0, 1.0)
    assert (shape(p, "eyeLookOutRight"), shape(p, "eyeLookInRight")) == (0.0, 0.5)


def test_gaze_from_shapes_turns_the_eyes():
    p = pose(eyeLookOutLeft=0.4, eyeLookInRight=0.4, eyeLookUpLeft=1.0)
    np.testing.assert_allclose(p.gaze[:, 0], 0.4 * EYE_RAD[0])
    assert p.gaze[0, 1] == -EYE_RAD[1]


def test_both_ways_add_up_and_are_clipped():
    p = pose(leftEyeYaw=0.7, eyeLookOutLeft=0.7)
    assert p.gaze[0, 0] == EYE_RAD[0] and shape(p, "eyeLookOutLeft") == 1.0


def test_a_closed_lid_is_closed_wherever_the_eye_looks():
    p = pose(eyeBlinkLeft=1.0, leftEyePitch=1.0, eyeWideLeft=1.0)
    assert shape(p, "eyeBlinkLeft") == 1.0
    assert shape(p, "eyeLookDownLeft") == shape(p, "eyeWideLeft") == 0.0


def test_lips_close_over_an_open_jaw_only():
    assert shape(pose(mouthClose=1.0), "mouthClose") == 0.0
    p = pose(mouthClose=0.8, jawOpen=0.4)
    assert shape(p, "mouthClose") == 0.4 and p.closed == 1.0
    assert pose(mouthClose=0.1, jawOpen=0.4).closed == pytest.approx(0.25)


def test_the_tongue_opens_the_jaw():
    assert pose(tongueOut=1.0).jaw == TONGUE_JAW
    assert pose(tongueOut=1.0, jawOpen=0.9).jaw == 0.9


@pytest.mark.parametrize(
    ("angles", "point", "goes"),
    [((0.3, 0, 0), [0, 0, 1], [1, 0]), ((0, 0.3, 0), [0, 0, 1], [-1, 1]), ((0, 0, 0.3), [1, 0, 0], [1, 1])],
)
def test_signs_of_yaw_pitch_and_roll(angles, point, goes):
    sign, axis = goes
    assert sign * (rotation(*angles) @ point)[axis] > 0.29


def test_rotation_vector_is_the_rotations_axis_and_angle():
    turn = rotation(0.5, -0.3, 0.2)
    v = rotation_vector(turn)
    angle = np.linalg.norm(v)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]) / angle
    np.testing.assert_allclose(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k, turn, atol=1e-12)
    assert not rotation_vector(np.eye(3)).any()


def test_a_whole_turn_of_the_head_and_of_the_eyes_is_as_many_degrees_as_documented():
    np.testing.assert_allclose(np.degrees(HEAD_RAD), [60.0, 40.0, 30.0])
    np.testing.assert_allclose(np.degrees(EYE_RAD), [35.0, 30.0])


def test_a_lid_goes_as_far_as_the_greater_of_blink_and_look_down():
    amounts = np.linspace(0.0, 1.0, 41)
    for look in amounts:
        left = np.array([lid_down(look, blink) for blink in amounts])
        lids = amounts + LID_SHARE * left  # in blinks
        assert left[0] == look and left[-1] == 0.0  # exact at 0 and 1
        greater = np.maximum(amounts, LID_SHARE * look)
        assert (lids >= greater - 1e-12).all() and (lids - greater).max() < 0.0626
        assert (np.diff(lids) >= -1e-12).all()  # a growing blink never lifts the lid


def test_a_rotation_rolls_first_then_pitches_then_yaws():
    def about(axis: int, angle: float) -> np.ndarray:
        turn, (i, j) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
        turn[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
        return turn

    for yaw, pitch, roll in ((0.5, -0.3, 0.2), (-1.2, 0.9, 2.0)):
        np.testing.assert_allclose(rotation(yaw, pitch, roll), about(1, yaw) @ about(0, pitch) @ about(2, roll))
    vector = np.array([0.3, -0.2, 0.1])
    turn = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(rotation_vector(turn), vector)
    np.testing.assert_allclose(rotation_vector(Rotation.from_rotvec(8 * vector).as_matrix()), 8 * vector)


def test_a_step_is_smooth_between_its_ends():
    found = smoothstep(np.array([1.0, 2.0, 2.5, 3.0, 3.5, 4.0, 9.0]), 2.0, 4.0)
    np.testing.assert_allclose(found, [0.0, 0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0])
    np.testing.assert_allclose(smoothstep(np.array([0.25])), [0.15625])


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_a_blink_takes_back_what_opens_the_eye(side):
    openers = [n for n in SHAPES if n.startswith("eye") and n.endswith(side) and ("Wide" in n or "LookUp" in n)]
    assert openers
    p = pose(**dict.fromkeys(openers, 0.8), **{f"eyeBlink{side}": 0.25})
    assert [shape(p, n) for n in openers] == pytest.approx([0.6] * len(openers))
    other = "Right" if side == "Left" else "Left"
    p = pose(**dict.fromkeys(openers, 0.8), **{f"eyeBlink{other}": 0.25})
    assert [shape(p, n) for n in openers] == pytest.approx([0.8] * len(openers))


def test_head_angles_are_clipped_and_in_radians():
    values = np.array([{"headYaw": 0.5, "headPitch": -3.0, "headRoll": 1.5}.get(n, 0.0) for n in NAMES])
    np.testing.assert_allclose(head_angles(values), [0.5 * HEAD_RAD[0], -HEAD_RAD[1], HEAD_RAD[2]])


@pytest.mark.parametrize("tongue", [0.0, 0.1, 0.3, 0.7, 1.0])
def test_the_tongue_keeps_the_lips_off_it(tongue):
    needed = 0.33 * min(1.0, 1.7 * tongue)
    given = 1.0 - 0.75 * min(1.0, tongue / 0.5)
    below = [SHAPES[i] for i in parameters._BELOW]
    p = pose(tongueOut=tongue, jawOpen=0.05, mouthClose=1.0, **dict.fromkeys(below, 0.5))
    assert p.jaw == pytest.approx(max(0.05, needed))
    assert [shape(p, n) for n in below] == pytest.approx([0.5 * given] * len(below))
    assert shape(p, "mouthClose") == pytest.approx(max(0.05, needed) - needed)
