"""surface.view.scene.camera"""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.scene.camera import PRESETS, Camera


def project(camera: Camera, point: tuple[float, float, float], aspect: float = 1.0) -> np.ndarray:
    clip = camera.matrix(aspect).astype(float) @ [*point, 1.0]
    return clip[:3] / clip[3]


@pytest.mark.parametrize("name", PRESETS)
def test_presets_put_their_target_in_the_middle(name: str) -> None:
    camera = PRESETS[name]()
    assert np.allclose(project(camera, camera.target)[:2], 0.0, atol=1e-5)
    assert camera.matrix(1.5).dtype == np.float32


@pytest.mark.parametrize(
    ("name", "yaw"), [("front", 0), ("three-quarter", 38), ("profile", 90), ("profile-right", -90)]
)
def test_presets_look_from_where_they_say(name: str, yaw: float) -> None:
    assert PRESETS[name]().yaw_deg == pytest.approx(yaw, abs=1e-6)


def test_front_shows_the_subjects_left_on_the_right_and_up_as_up() -> None:
    camera = Camera.front()
    x, y, _ = camera.target
    assert project(camera, (x + 50, y, 90))[0] > 0.1
    assert project(camera, (x, y + 50, 90))[1] > 0.1
    assert project(camera, (x, y, 120))[2] < project(camera, (x, y, 40))[2]


def test_view_is_a_rigid_motion() -> None:
    view = Camera.around(33, 21).view().astype(float)
    assert np.allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-6)
    assert np.linalg.det(view[:3, :3]) == pytest.approx(1.0, abs=1e-6)


def test_aspect_keeps_circles_round() -> None:
    camera = Camera.front()
    wide = project(camera, (50, camera.target[1], 40), aspect=2.0)[0] * 2.0
    assert wide == pytest.approx(project(camera, (50, camera.target[1], 40))[0], rel=1e-5)


def test_orbit_keeps_distance_and_stops_before_the_poles() -> None:
    camera = Camera.front().orbit(30, 500)
    assert camera.distance == pytest.approx(Camera.front().distance)
    assert camera.pitch_deg == pytest.approx(85)
    assert camera.yaw_deg == pytest.approx(30)


def test_zoom_moves_along_the_view_and_is_bounded() -> None:
    camera = Camera.three_quarter()
    assert camera.zoom(2.0).distance == pytest.approx(camera.distance / 2)
    assert camera.zoom(2.0).yaw_deg == pytest.approx(camera.yaw_deg)
    assert camera.zoom(1e9).distance == pytest.approx(120)
    assert camera.zoom(1e-9).distance == pytest.approx(3000)


def test_aimed_keeps_the_direction() -> None:
    camera = Camera.three_quarter().aimed((1.0, 2.0, 3.0))
    assert camera.target == (1.0, 2.0, 3.0)
    assert camera.yaw_deg == pytest.approx(38)


def test_an_unknown_side_is_named() -> None:
    with pytest.raises(ValueError, match="'middle'"):
        Camera.profile("middle")


def test_presets_are_portraits_that_draw_from_40_mm_to_4_m() -> None:
    for name, pitch, target in (
        ("front", 1, (0, -6, 40)),
        ("three-quarter", 3, (0, -6, 40)),
        ("profile", 1, (0, -6, 15)),
    ):
        camera = PRESETS[name]()
        assert (camera.near, camera.far, camera.fov_deg, camera.target) == (40.0, 4000.0, 20.5, target)
        assert camera.pitch_deg == pytest.approx(pitch) and camera.distance == pytest.approx(950.0)
    assert PRESETS["three-quarter-right"]() == Camera.around(-38.0, 3.0)
    assert Camera.around(10.0).pitch_deg == pytest.approx(0.0)


def test_what_is_nearest_and_furthest_ends_at_the_ends_of_depth() -> None:
    camera = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 90.0, near=2.0, far=50.0)
    for depth, wanted in ((2.0, -1.0), (50.0, 1.0)):
        assert project(camera, (0.0, 0.0, -depth)) == pytest.approx([0.0, 0.0, wanted], abs=1e-5)
    assert project(camera, (5.0, -3.0, -10.0), aspect=2.0)[:2] == pytest.approx([0.25, -0.3])


def test_from_straight_above_x_stays_to_the_right() -> None:
    view = Camera((0.0, 10.0, 0.0), (0.0, 0.0, 0.0)).view()
    assert view.tolist() == [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, -10], [0, 0, 0, 1]]
    with pytest.raises(ValueError, match="read-only"):
        Camera.front().matrix(1.0)[0, 0] = 1.0


def test_angles_and_distances_are_named_when_a_camera_is_made() -> None:
    with pytest.raises(TypeError):
        Camera.around(1.0, 2.0, 900.0)  # type: ignore[misc]
