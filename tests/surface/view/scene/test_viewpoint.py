"""surface.view.scene.viewpoint"""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.scene.camera import Camera
from surface.view.scene.framing import Framing
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


def test_a_notch_of_the_wheel_is_an_eighth_nearer() -> None:
    view = Viewpoint()
    for notches in (1.0, -2.0, 0.5):
        before = view.camera.distance
        view.zoom(notches)
        assert view.camera.distance == pytest.approx(before / 1.12**notches)


def test_a_hand_moves_what_is_in_focus_in_windows_of_any_height() -> None:
    for height in (360, 1):
        view = Viewpoint()
        before = view.camera
        view.shift(36, -18, height)
        span = 2.0 * before.distance * np.tan(np.radians(before.fov_deg / 2)) / height
        up = before.view().astype(float)[:2, :3]
        moved = np.subtract(view.camera.target, before.target)
        np.testing.assert_allclose(moved, span * (-36 * up[0] - 18 * up[1]), rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(np.subtract(view.camera.eye, before.eye), moved, atol=1e-9)
    view.shift(1, 1, 0)  # a window without height moves nothing into nowhere
    assert np.isfinite(view.camera.target).all()


def test_another_head_is_looked_at_from_the_front_and_by_its_own_presets() -> None:
    view, small = Viewpoint(), Framing((1.0, 2.0, 3.0), 0.5)
    view.turn(50, 0)
    view.reframe(small)
    assert view.camera == view.home == small.camera(Camera.front()) != Camera.front()
    assert view.press("4") and view.camera == small.camera(Camera.profile())
    assert view.press("0") and view.camera == view.home
    assert Viewpoint(framing=small).home == small.camera(Camera.front())
