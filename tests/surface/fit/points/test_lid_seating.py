"""Warps before the fit: lids onto another eyeball, lips together."""

import numpy as np
from face_measures import eye_height
from slit_sheet import slit_sheet

from surface.fit.points.lid_seating import Eyeball, close_lips, draw_brows, seat_lids, strengthen
from surface.fit.source.mesh import FitMesh

OLD = Eyeball((30.0, 36.0, 80.0), 15.0)
NEW = Eyeball((30.0, 36.0, 83.5), 12.0)


def on_ball(ball: Eyeball, across: np.ndarray) -> np.ndarray:
    x = ball.centre[0] + across
    z = ball.centre[2] + np.sqrt(ball.radius**2 - across**2)
    return np.column_stack([x, np.full(len(x), ball.centre[1]), z])


def cloud(points: np.ndarray, delta: np.ndarray) -> FitMesh:
    none = np.zeros((0, 4), np.int64)
    return FitMesh(points, none, np.zeros((0, 2)), none, ("s",), delta[None])


def above(points: np.ndarray, gaze: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Height above the new eyeball, its cornea included."""
    local = points - NEW.centre
    length = np.linalg.norm(local, axis=1)
    return length - NEW.radius * eye_height(local / length[:, None], np.array(gaze))


def test_what_touched_the_old_ball_touches_the_new_one_and_its_cornea():
    across = np.linspace(-9, 9, 13)
    points = on_ball(OLD, across)
    seated = seat_lids(cloud(points, np.zeros_like(points)), OLD, NEW, np.arange(13)).vertices
    assert np.abs(above(seated)).max() < 0.25
    assert above(seated).min() > 0.09  # touches, and does not sink in
    assert np.linalg.norm(seated[6] - NEW.centre) > NEW.radius + 1.1  # over the cornea
    assert np.abs(seated[:, :2] - points[:, :2]).max() < 0.4


def test_shapes_slide_over_the_new_ball_too():
    start, end = on_ball(OLD, np.array([-6.0])), on_ball(OLD, np.array([5.0]))
    mesh = seat_lids(cloud(start, end - start), OLD, NEW, np.array([0]))
    assert abs(above(mesh.vertices + mesh.deltas[0])[0]) < 0.25


def test_what_lies_on_the_eyeball_comes_off_it_in_no_shape_and_what_stands_off_may():
    start = on_ball(OLD, np.array([-6.0]))
    near, far = (start + s * (start - OLD.centre) / OLD.radius for s in (0.5, 3.0))
    out = 2.0 * (start - OLD.centre) / OLD.radius
    mesh = seat_lids(cloud(np.vstack([near, far]), np.vstack([out, out])), OLD, NEW, np.arange(2))
    gone = above(mesh.vertices + mesh.deltas[0]) - above(mesh.vertices)
    assert abs(gone[0]) < 0.01 and gone[1] > 1.0


def test_lids_lie_on_the_cornea_where_a_shape_has_the_eye_look():
    start = on_ball(OLD, np.array([-6.0]))
    aside = np.array([-np.sin(0.5), 0.0, np.cos(0.5)])
    gazes = np.broadcast_to(aside, (1, 2, 3))
    mesh = seat_lids(cloud(start, np.full((1, 3), 1e-3)), OLD, NEW, np.array([0]), gazes)
    moved = mesh.vertices + mesh.deltas[0]
    assert abs(above(moved, tuple(aside))[0]) < 0.25
    assert above(moved)[0] > 0.8


def test_both_eyes_are_mirror_images_and_far_points_stay():
    points = np.vstack([on_ball(OLD, np.array([-4.0, 3.0])), [[0.0, 36.0, 110.0], [70.0, 36.0, 60.0]]])
    mirrored = points * [-1.0, 1.0, 1.0]
    a = seat_lids(cloud(points, np.zeros_like(points)), OLD, NEW, np.arange(4)).vertices
    b = seat_lids(cloud(mirrored, np.zeros_like(points)), OLD, NEW, np.arange(4)).vertices
    np.testing.assert_allclose(a * [-1.0, 1.0, 1.0], b)
    np.testing.assert_allclose(a[2:], points[2:])


def test_closing_lips_keeps_the_closed_pose():
    mesh = slit_sheet()
    closed = close_lips(mesh, 0.1, "jawOpen")
    np.testing.assert_allclose(closed.vertices + closed.deltas[0], mesh.vertices + mesh.deltas[0], atol=1e-12)
    assert close_lips(mesh, 0.1, "mouthClose") is mesh


def test_strengthening_touches_the_named_shapes_only():
    mesh = strengthen(slit_sheet(), "jaw", 1.5)
    np.testing.assert_allclose(mesh.deltas[0], 1.5 * slit_sheet().deltas[0])
    np.testing.assert_array_equal(mesh.deltas[1], slit_sheet().deltas[1])


def test_the_heads_of_the_brows_are_drawn_in_on_their_own_side():
    points = np.array([[13.0, 59.0, 105.0], [-13.0, 59.0, 105.0], [50.0, 59.0, 95.0]])
    mesh = FitMesh(points, np.zeros((0, 4), np.int64), np.zeros((0, 2)), np.zeros((0, 4), np.int64),
                   ("browDown_L", "browDown_R"), np.zeros((2, 3, 3)))  # fmt: skip
    left, right = draw_brows(mesh, "browDown", (13.0, 59.0), (11.0, 9.0), (-2.8, -1.8, 0.6)).deltas
    np.testing.assert_allclose(left[0], [-2.8, -1.8, 0.6])
    np.testing.assert_allclose(right[1], [2.8, -1.8, 0.6])
    assert np.abs(left[1:]).max() < 0.02
