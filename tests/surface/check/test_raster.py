"""Pictures without OpenGL against rays that are cut with every triangle, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check.raster import NOTHING, View, enclosed, view_rotation

CORNER = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 9.0], [0.0, 4.0, 13.0]], np.float32)  # z = 1 + 2 x + 3 y
ONE = np.array([[0, 1, 2]], np.int32)


def by_rays(view: View, points: np.ndarray, triangles: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """(h, w) row of the nearest triangle at each pixel, -1 for none: one system of equations for each ray."""
    out = np.full(shape, -1)
    for j, i in np.ndindex(shape):
        best = -np.inf
        for row, corner in enumerate(points[triangles]):
            at = [view.x[0] + i * view.step, view.y[0] + j * view.step, 1.0]
            share = np.linalg.solve(np.vstack([corner[:, :2].T, np.ones(3)]), at)
            depth = float(share @ corner[:, 2])
            if share.min() >= 0 and depth > best:
                best, out[j, i] = depth, row
    return out


def test_a_triangle_covers_its_pixels_edges_included_and_has_the_depth_of_its_plane() -> None:
    picture = View((-1.0, 6.0), (-2.0, 5.0), 1.0).draw([(CORNER, ONE)])
    y, x = np.mgrid[-2:6, -1:7]
    inside = (x >= 0) & (y >= 0) & (x + y <= 4)
    assert ((picture.parts == 0) == inside).all() and ((picture.rows == 0) == inside).all()
    assert (picture.parts[~inside] == NOTHING).all() and (picture.rows[~inside] == NOTHING).all()
    np.testing.assert_allclose(picture.depth, np.where(inside, 1 + 2 * x + 3 * y, -np.inf))


def test_a_triangle_reaches_the_last_row_and_column_of_the_picture_and_not_beyond() -> None:
    big = np.array([[-9.0, -9, 0], [30, -9, 0], [-9, 30, 0]], np.float32)
    assert (View((0.0, 2.0), (0.0, 3.0), 1.0).draw([(big, ONE)]).parts == 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_triangle_is_seen_at_every_pixel(seed: int) -> None:
    random = np.random.default_rng(seed)
    points, triangles = random.uniform(-3.0, 9.0, (15, 3)).astype(np.float32), random.permutation(15).reshape(5, 3)
    view = View((0.25, 5.0), (1.25, 6.5), 0.5)
    picture = view.draw([(points, triangles.astype(np.int32))])
    assert picture.rows.shape == (11, 10)
    np.testing.assert_array_equal(picture.rows, by_rays(view, points, triangles, (11, 10)))


def test_the_first_of_two_equal_triangles_stays_and_one_of_no_area_is_not_drawn() -> None:
    twice = np.array([[0, 1, 1], [0, 1, 2], [2, 1, 0]], np.int32)
    view = View((0.0, 4.0), (0.0, 4.0), 1.0)
    assert set(view.draw([(CORNER, twice)]).rows.ravel().tolist()) == {NOTHING, 1}
    small = view.draw([(CORNER * np.float32(1e-4) + np.float32(1.0), ONE)])  # small ones are
    assert small.rows[1, 1] == 0


def test_a_part_left_out_keeps_its_number() -> None:
    behind = CORNER - np.array([0, 0, 5], np.float32)
    picture = View((0.0, 4.0), (0.0, 4.0), 1.0).draw([(behind, ONE), None, (CORNER, ONE)])
    assert set(picture.parts.ravel().tolist()) == {NOTHING, 2}


def test_a_picture_has_the_pixels_of_its_rectangle_and_two_at_least() -> None:
    assert View((0.0, 3.0), (1.0, 2.5), 0.5).draw([]).depth.shape == (4, 7)
    assert View((1.0, 1.0), (2.0, 2.0), 0.5).draw([]).depth.shape == (2, 2)
    assert View((2.0, 9.0), (-1.0, 9.0), 0.5).draw([]).at(3, 4) == (4.0, 0.5)


@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (38, 0), (-90, 0), (30, 50), (180, -20)])
def test_a_turn_is_the_rotation_of_a_viewer_on_a_sphere(yaw: float, pitch: float) -> None:
    turn, (a, b) = view_rotation(yaw, pitch), np.radians([yaw, pitch])
    viewer = [np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)]
    right = [np.cos(a), 0.0, -np.sin(a)]
    np.testing.assert_allclose(turn, [right, np.cross(viewer, right), viewer], atol=1e-12)


def test_a_view_is_drawn_after_its_turn() -> None:
    side = np.array([[7.0, -0.5, 0.5], [7, -0.5, -5], [7, 5, 0.5]], np.float32)  # seen from greater x
    picture = View((0.0, 4.0), (0.0, 4.0), 1.0, view_rotation(90.0)).draw([(side, ONE)])
    assert (picture.parts == 0).sum() == 15 and np.allclose(picture.depth[picture.parts == 0], 7.0)


def test_enclosed_pixels_have_solid_ones_on_both_sides_in_their_column() -> None:
    solid = np.random.default_rng(5).random((9, 40)) < 0.25
    wanted = np.array(
        [[not solid[j, i] and solid[:j, i].any() and solid[j + 1 :, i].any() for i in range(40)] for j in range(9)]
    )
    np.testing.assert_array_equal(enclosed(~solid, solid), wanted)
