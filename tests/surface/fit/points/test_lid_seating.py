"""Warps before the fit: lids onto another eyeball, lips together."""

import numpy as np
import pytest
from face_measures import eye_height
from slit_sheet import slit_sheet

from surface.fit.points.lid_seating import Eyeball, close_lips, fit_sphere, seat_lids
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


FURTHER = Eyeball((30.0, 36.0, 88.0), 12.0)


def test_a_sphere_is_found_from_points_on_a_part_of_it():
    a, b = np.meshgrid(np.linspace(0.2, 1.0, 5), np.linspace(0.0, 2.0, 6))
    directions = np.stack([np.cos(b) * np.sin(a), np.sin(b) * np.sin(a), np.cos(a)], axis=-1).reshape(-1, 3)
    centre, radius = fit_sphere(np.array([31.0, -4.0, 70.0]) + 11.5 * directions)
    np.testing.assert_allclose(centre, [31.0, -4.0, 70.0], atol=1e-8)
    assert radius == pytest.approx(11.5)


def seated_at(points: np.ndarray, old: Eyeball, new: Eyeball) -> np.ndarray:
    return seat_lids(cloud(points, np.zeros_like(points)), old, new, np.arange(len(points))).vertices


@pytest.mark.parametrize(("height", "share"), [(5.25, 0.5), (7.125, 0.15625), (9.0, 0.0), (12.0, 0.0)])
def test_what_is_in_front_of_the_ball_follows_its_front_less_the_further_it_is(height: float, share: float) -> None:
    front = np.array([[30.0, 36.0, 95.0 + height]])  # the old ball's front is at 95, the new one's at 100
    moved = seated_at(front, OLD, FURTHER) - front
    np.testing.assert_allclose(moved, [[0.0, 0.0, 5.0 * share]], atol=0.03)


@pytest.mark.parametrize(("across", "share"), [(17.7, 0.5), (20.25, 0.15625), (22.8, 0.0), (40.0, 0.0)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_is_beside_the_ball_follows_it_less_the_further_it_is(across: float, share: float, side: float) -> None:
    rim_old, rim_new = (z + np.sqrt(r**2 - (0.93 * r) ** 2) for z, r in ((80.0, 15.0), (88.0, 12.0)))
    beside = np.array([[side * 30.0, 36.0 + across, rim_old - 1.0]])
    moved = seated_at(beside, OLD, FURTHER) - beside
    np.testing.assert_allclose(moved, [[0.0, 0.0, (rim_new - rim_old) * share]], atol=0.12 * share + 1e-9)


@pytest.mark.parametrize(("z", "share"), [(-3.0, 0.0), (0.0, 0.0), (1.25, 0.15625), (2.5, 0.5), (5.0, 1.0), (6.0, 1.0)])
def test_lids_begin_to_lie_on_the_ball_in_front_of_its_middle(z: float, share: float) -> None:
    sunk = np.array([[30.0, 36.0 + np.sqrt(11.0**2 - z**2), NEW.centre[2] + z]])  # 1 mm inside
    moved = seated_at(sunk, NEW, NEW) - sunk
    np.testing.assert_allclose(moved, 1.1 * share * (sunk - NEW.centre) / 11.0, atol=1e-6)


def beside(height: float) -> np.ndarray:
    """A place that is some mm above the new ball, off its cornea."""
    return NEW.centre + (NEW.radius + height) * np.array([0.0, 0.8, 0.6])


def test_skin_keeps_its_height_and_what_sinks_in_a_shape_is_laid_as_high_as_it_was() -> None:
    heights = (-0.5, 0.1, 0.7, 1.2, 1.5, 1.7, 3.0)
    points = np.array([beside(h) for h in heights])
    sinking = np.array([beside(-2.0)] * len(heights)) - points
    mesh = seat_lids(cloud(points, sinking), NEW, NEW, np.arange(len(heights)))
    np.testing.assert_allclose(above(mesh.vertices), [0.1, 0.1, 0.7, 1.2, 1.5, 1.7, 3.0], atol=1e-6)
    sunk = above(mesh.vertices + mesh.deltas[0])
    np.testing.assert_allclose(sunk, [0.1, 0.1, 0.7, 1.2, 1.2, 1.2, 1.2], atol=1e-6)


def test_what_is_up_to_loosely_on_the_ball_stays_as_near_and_the_rest_comes_off() -> None:
    points = np.array([beside(h) for h in (0.5, 1.55, 1.65)])
    mesh = seat_lids(cloud(points, np.array([beside(4.0)] * 3) - points), NEW, NEW, np.arange(3))
    np.testing.assert_allclose(above(mesh.vertices + mesh.deltas[0]), [0.5, 1.55, 4.0], atol=1e-6)
    free = seat_lids(cloud(points, np.array([beside(4.0)] * 3) - points), NEW, NEW, np.arange(3), cling=False)
    np.testing.assert_allclose(above(free.vertices + free.deltas[0]), 4.0, atol=1e-6)
    np.testing.assert_array_equal(free.vertices, mesh.vertices)


def test_only_chosen_vertices_and_moved_ones_are_touched() -> None:
    points = np.array([beside(-1.0)] * 3)
    delta = np.array([[0.0, 0.0, 0.0], [0.0, 5e-5, 0.0], [0.0, 0.0, 0.5]])
    mesh = seat_lids(cloud(points, delta), NEW, NEW, np.array([0, 1]))
    assert above(mesh.vertices)[:2] == pytest.approx([0.1, 0.1], abs=1e-6)
    np.testing.assert_array_equal(mesh.vertices[2], points[2])
    np.testing.assert_array_equal(mesh.deltas[0], delta)
    little = seat_lids(cloud(points, 10.0 * delta), NEW, NEW, np.array([1]))
    assert above(little.vertices + little.deltas[0])[1] == pytest.approx(0.1, abs=1e-6)


def test_each_eye_has_its_own_gaze() -> None:
    right = beside(0.5) * [-1.0, 1.0, 1.0]
    points = np.vstack([beside(0.5), right])
    up = np.array([0.0, 0.8, 0.6])
    gazes = np.array([[up, [0.0, 0.0, 1.0]]])
    mesh = seat_lids(cloud(points, np.full((2, 3), [0.01, 0.0, 0.0])), NEW, NEW, np.arange(2), gazes)
    moved = mesh.vertices + mesh.deltas[0]
    assert above(moved[:1], tuple(up))[0] == pytest.approx(0.5, abs=0.01), "on the cornea of the eye that looks up"
    assert above(moved[1:] * [-1.0, 1.0, 1.0])[0] == pytest.approx(0.5, abs=0.01)
    assert np.linalg.norm(moved[0] - NEW.centre) > np.linalg.norm(moved[1] * [-1, 1, 1] - NEW.centre) + 0.5


def test_no_share_of_a_closing_shape_is_no_change_and_half_is_half() -> None:
    mesh = slit_sheet()
    assert close_lips(mesh, 0.0, "jawOpen") is mesh
    half = close_lips(mesh, 0.5, "mouthSmile_L")
    np.testing.assert_allclose(half.vertices - mesh.vertices, 0.5 * mesh.deltas[1], atol=1e-12)
    np.testing.assert_allclose(half.deltas, mesh.deltas * np.array([1.0, 0.5])[:, None, None])


def test_the_front_of_a_ball_has_no_kink_where_it_is_held() -> None:
    """Where its steep part begins it is as high as 0.32 mm further in: sqrt(0.4) / 2 less than min(across, held)."""
    front_old = 80.0 + np.sqrt(15.0**2 - (0.93 * 15.0 - 0.316) ** 2)
    front_new = 88.0 + np.sqrt(12.0**2 - (0.93 * 12.0 - 0.035) ** 2)
    t = (0.93 * 15.0 - 1.05 * 12.0) / (0.85 * 12.0)
    point = np.array([[30.0, 36.0 + 0.93 * 15.0, 85.0]])
    moved = seated_at(point, OLD, FURTHER) - point
    assert moved[0] == pytest.approx([0.0, 0.0, (1 - t * t * (3 - 2 * t)) * (front_new - front_old)], abs=0.01)


def test_the_sides_part_in_the_middle() -> None:
    old, new = Eyeball((6.0, 36.0, 80.0), 15.0), Eyeball((6.0, 36.0, 83.0), 12.0)
    left = np.array([[0.5, 40.0, 93.0], [0.0, 38.0, 94.0]])
    right = seated_at(left * [-1.0, 1.0, 1.0], old, new) * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(right, seated_at(left, old, new))
