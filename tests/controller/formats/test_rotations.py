"""Rotations in Unity's axes, against matrices written out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.formats.rotations import Quaternion, from_unity, product, to_unity


def matrix(quaternion: Quaternion) -> np.ndarray:
    """(3, 3) what a quaternion does to a vector: v + 2 w (q x v) + 2 q x (q x v)."""
    *q, w = quaternion
    columns = [v + 2 * w * np.cross(q, v) + 2 * np.cross(q, np.cross(q, v)) for v in np.eye(3)]
    return np.stack(columns, axis=1)


def test_signs_are_those_that_a_viewer_sees() -> None:
    """Unity: x is the subject's right, y up, z forward, as the subject faces z."""
    forward, right = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    left_turn = matrix(to_unity(0.3, 0.0, 0.0)) @ forward
    assert left_turn[0] < -0.2 and abs(left_turn[1]) < 1e-12
    nod = matrix(to_unity(0.0, 0.3, 0.0)) @ forward
    assert nod[1] < -0.2 and abs(nod[0]) < 1e-12
    tilt = matrix(to_unity(0.0, 0.0, 0.3)) @ right
    assert tilt[1] < -0.2, "roll + raises the left side, so the right one goes down"


def test_rolls_come_first_and_yaws_last() -> None:
    yaw, pitch, roll = 0.5, -0.4, 0.3
    parts = (to_unity(yaw, 0, 0), to_unity(0, pitch, 0), to_unity(0, 0, roll))
    whole = matrix(parts[0]) @ matrix(parts[1]) @ matrix(parts[2])
    np.testing.assert_allclose(matrix(to_unity(yaw, pitch, roll)), whole, atol=1e-12)
    np.testing.assert_allclose(matrix(product(parts[0], product(parts[1], parts[2]))), whole, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_angles_come_back(seed: int) -> None:
    angles = np.random.default_rng(seed).uniform(-1.3, 1.3, 3)
    quaternion = to_unity(*angles)
    assert math.hypot(*quaternion) == pytest.approx(1.0)
    assert from_unity(quaternion) == pytest.approx(tuple(angles))
    assert from_unity(tuple(-3.0 * each for each in quaternion)) == pytest.approx(tuple(angles))  # type: ignore[arg-type]


@pytest.mark.parametrize("none", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 1.0)])
def test_what_is_no_rotation_is_refused(none: Quaternion) -> None:
    with pytest.raises(ValueError, match="a rotation that is zero or not finite"):
        from_unity(none)


def test_a_head_that_looks_straight_up_or_down_has_a_pitch_in_spite_of_rounding() -> None:
    """Rounded products of the quaternion are larger than 1 for a third of these."""
    half, beyond = math.sqrt(0.5), 0
    for sign in (1.0, -1.0):
        for turn in np.linspace(0.0, 3.0, 31):
            c, s = math.cos(turn), math.sin(turn)
            x, y, z, w = sign * half * c, half * s, -sign * half * s, half * c
            beyond += abs(2 * (w * x - y * z)) > 1.0
            assert from_unity((x, y, z, w))[1] == pytest.approx(sign * math.pi / 2)
    assert beyond > 5
