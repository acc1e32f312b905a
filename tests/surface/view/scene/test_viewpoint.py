"""surface.view.scene.viewpoint"""

from __future__ import annotations

import pytest

from surface.view.scene.camera import Camera
from surface.view.scene.viewpoint import KEYS, Viewpoint


def test_dragging_right_shows_the_subjects_right_side() -> None:
    view = Viewpoint()
    view.turn(100, 0)
    assert view.camera.yaw_deg == pytest.approx(-35)
    view.turn(0, 40)
    assert view.camera.pitch_deg == pytest.approx(Camera.front().pitch_deg + 14, abs=1e-3)


def test_shifting_moves_the_picture_with_the_hand() -> None:
    view = Viewpoint()
    before = view.camera
    view.shift(72, 0, 720)
    clip = view.camera.matrix(1.0).astype(float) @ [*before.target, 1.0]
    assert clip[0] / clip[3] == pytest.approx(2 * 72 / 720, rel=1e-3)
    view.shift(0, 72, 720)
    clip = view.camera.matrix(1.0).astype(float) @ [*before.target, 1.0]
    assert clip[1] / clip[3] == pytest.approx(-2 * 72 / 720, rel=1e-2)


def test_wheel_and_reset() -> None:
    view = Viewpoint(Camera.three_quarter())
    view.zoom(3)
    assert view.camera.distance < Camera.three_quarter().distance
    view.zoom(-3)
    assert view.camera.distance == pytest.approx(Camera.three_quarter().distance)
    view.turn(10, 10)
    view.press("0")
    assert view.camera == Camera.three_quarter()


def test_keys() -> None:
    view = Viewpoint(Camera.three_quarter())
    assert view.press("1")
    assert view.camera == Camera.front()
    assert view.press("0")
    assert view.camera == Camera.three_quarter()
    assert not view.press("9")
    assert list(KEYS) == ["1", "2", "3", "4", "5"]
