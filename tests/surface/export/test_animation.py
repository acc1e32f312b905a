"""Motion as weights of shapes and rotations of the head."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.base.errors import ExportError
from surface.export.animation import Animation, _quaternion
from surface.head.model.parameters import EYE_RAD, NAMES, SHAPES, read_pose, rotation

AT = {name: i for i, name in enumerate(NAMES)}


def animation(*rows: dict[str, float]) -> Animation:
    values = np.zeros((len(rows), len(NAMES)))
    for row, given in zip(values, rows, strict=True):
        for name, value in given.items():
            row[AT[name]] = value
    return Animation("a", np.arange(len(rows)) / 10.0, values)


def weights(**given: float) -> dict[str, float]:
    (row,) = animation(given).weights()
    return {name: round(float(value), 6) for name, value in zip(SHAPES, row, strict=True) if abs(value) > 1e-9}


@pytest.mark.parametrize(
    ("times", "values", "why"),
    [
        ([], np.zeros((0, len(NAMES))), "times that rise"),
        ([0.0, 0.0], np.zeros((2, len(NAMES))), "times that rise"),
        ([-0.1, 0.0], np.zeros((2, len(NAMES))), "times that rise"),
        ([0.0], np.zeros((2, len(NAMES))), "times that rise"),
        ([0.0], np.zeros((1, len(NAMES) - 1)), "times that rise"),
        ([[0.0]], np.zeros((1, len(NAMES))), "times that rise"),
        ([0.0], np.full((1, len(NAMES)), np.nan), "no numbers"),
    ],
)
def test_what_is_no_motion_is_refused(times, values, why) -> None:
    with pytest.raises(ExportError, match=f"walk: .*{why}") as caught:
        Animation("walk", np.array(times, float), values)
    assert caught.value.hint == "check the take"


def test_shapes_are_as_the_head_combines_them() -> None:
    assert weights(jawOpen=0.5, mouthSmileLeft=0.25) == {"jawOpen": 0.5, "mouthSmileLeft": 0.25}
    values = animation({"jawOpen": 0.8, "mouthClose": 0.6}).values[0]
    look = [i for i, name in enumerate(SHAPES) if not name.startswith("eyeLook")]
    wanted = np.clip(read_pose(values).shapes, 0, 1)
    np.testing.assert_allclose(animation({"jawOpen": 0.8, "mouthClose": 0.6}).weights()[0][look], wanted[look])


@pytest.mark.parametrize("side", ["Left", "Right"])
def test_shapes_that_turn_an_eye_come_out_as_they_were_given(side: str) -> None:
    for direction in ("Down", "Up", "Out", "In"):
        found = weights(**{f"eyeLook{direction}{side}": 0.5})
        assert {n: v for n, v in found.items() if n.startswith("eyeLook")} == {f"eyeLook{direction}{side}": 0.5}


def test_angles_of_an_eye_become_shapes() -> None:
    (row,) = animation({"leftEyeYaw": 0.4, "rightEyeYaw": 0.4, "leftEyePitch": -0.3}).values
    gaze = np.array(read_pose(row).gaze) / EYE_RAD
    found = weights(leftEyeYaw=0.4, rightEyeYaw=0.4, leftEyePitch=-0.3)
    assert gaze[0, 0] * gaze[1, 0] > 0  # both to the subject's left: out for the left eye, in for the right
    assert found["eyeLookOutLeft"] == pytest.approx(gaze[0, 0], abs=1e-6)
    assert found["eyeLookInRight"] == pytest.approx(gaze[1, 0], abs=1e-6)
    assert found["eyeLookUpLeft"] == pytest.approx(-gaze[0, 1], abs=1e-6)
    assert "eyeLookInLeft" not in found and "eyeLookDownLeft" not in found


def test_rotations_are_those_of_the_head_and_keep_their_sign() -> None:
    assert animation({"jawOpen": 1.0}, {}).head_quaternions() is None
    rows = [{"headYaw": y, "headPitch": p, "headRoll": r} for y, p, r in [(0, 0, 0), (0.5, -0.25, 0.1), (-1, 1, -1)]]
    made = animation(*rows)  # type: ignore[arg-type]
    found = made.head_quaternions()
    assert found is not None
    for quaternion, values in zip(found, made.values, strict=True):
        wanted = rotation(*read_pose(values).head)
        np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), wanted, atol=1e-9)
    assert ((found[1:] * found[:-1]).sum(axis=1) > 0).all()
    np.testing.assert_allclose(found[0], [0, 0, 0, 1])


def test_a_quaternion_of_any_rotation_below_half_a_turn() -> None:
    turns = Rotation.from_rotvec(np.random.default_rng(2).uniform(-1.7, 1.7, (50, 3)))
    for turn in turns:
        wanted = turn.as_quat(canonical=True)
        np.testing.assert_allclose(_quaternion(turn.as_matrix()), wanted, atol=1e-9)
