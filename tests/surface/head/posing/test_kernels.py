"""surface.head.posing.kernels, against the same arithmetic in numpy or scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.head.posing.kernels import (
    add_moves,
    keep_on_eyeball,
    mix_rows,
    move_rigid,
    nearest_on_line,
    place_vertices,
    stitch_border,
    swing_jaw,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def test_tiles_of_moves_are_added_by_the_amounts_of_their_groups(rng: np.random.Generator) -> None:
    """Ten points in two tiles: the first group moves both, the second none, the third the latter tile."""
    rows, points = rng.normal(size=(3, 8, 3)).astype(np.float32), rng.normal(size=(10, 3))
    order, start, tile = rng.permutation(10), np.array([0, 2, 2, 3]), np.array([0, 1, 1], np.int32)
    tiles = np.zeros((2, 8, 3))
    tiles += -2.0 * rows[:2]
    tiles[1] += 0.5 * rows[2]
    rest, want = points.copy(), points.copy()
    want[order] += tiles.reshape(-1, 3)[:10]
    sums, out = np.full(48, 9.0, np.float32), np.full((10, 3), np.nan)
    add_moves(np.array([-2.0, 1.0, 0.5]), start, tile, rows.ravel(), order, sums, points, out)
    np.testing.assert_allclose(out, want, atol=1e-6)
    np.testing.assert_array_equal(points, rest)


def test_rows_are_mixed_and_kept_above_the_least(rng: np.random.Generator) -> None:
    rows, rest, out = rng.normal(size=(3, 6)).astype(np.float32), rng.normal(size=6), np.full(6, 9.0)
    amounts = np.array([1.0, 0.0, -0.5])
    least = np.array([-9.0, -9.0, -9.0, 5.0, -9.0, 5.0])
    mix_rows(amounts, rows, rest, least, out)
    np.testing.assert_allclose(out, np.maximum(rest + amounts @ rows, least))
    assert out[3] == out[5] == 5.0


def test_an_affine_motion_keeps_normals_square_to_the_surface(rng: np.random.Generator) -> None:
    """Normals go by the inverse's transpose; 19 rows are two tiles and a part of one."""
    rest, normals = (rng.normal(size=(19, 3)).astype(np.float32) for _ in range(2))
    linear, shift = (np.eye(3) + 0.3 * rng.normal(size=(3, 3))).astype(np.float32), np.float32([1.0, -2.0, 3.0])
    out, out_normals = np.zeros_like(rest), np.zeros_like(rest)
    move_rigid(rest, normals, linear, shift, out, out_normals)
    np.testing.assert_allclose(out, rest @ linear.T + shift, atol=1e-5)
    want = np.sign(np.linalg.det(linear)) * normals @ np.linalg.inv(linear)
    np.testing.assert_allclose(out_normals, want / np.linalg.norm(want, axis=1)[:, None], atol=1e-5)


def test_points_swing_by_their_share_and_take_the_straight_way_where_undone(rng: np.random.Generator) -> None:
    rest, points = rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
    turn, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    full_turn, full_shift, amount = rng.normal(size=(3, 3)), rng.normal(size=3), 0.4
    share, undo = np.array([1.0, 0.5, 0.0, 1.0]), np.array([0.0, 0.25, 1.0, 1.0])
    arc = rest @ turn.T + shift - rest
    line = rest @ full_turn.T + full_shift - amount * rest
    want = points + share[:, None] * (arc + undo[:, None] * (line - arc))
    swing_jaw(rest, share, turn, shift, full_turn, full_shift, amount, undo, points)
    np.testing.assert_allclose(points, want, atol=1e-12)


def test_lids_go_to_their_distance_from_the_eye_by_their_hold(rng: np.random.Generator) -> None:
    points = rng.normal(size=(5, 3)) + 10.0
    eye, before = np.array([[1.0, 2.0, 3.0]] * 3), points.copy()
    points[4] = before[4] = eye[2]  # in the very middle: it has no direction to go to
    ids, hold, radius = np.array([0, 3, 4]), np.array([1.0, 0.5, 1.0]), np.array([12.0, 20.0, 5.0])
    keep_on_eyeball(ids, eye, hold, radius, points)
    length = np.linalg.norm(before[ids] - eye, axis=1)
    after = np.linalg.norm(points[ids] - eye, axis=1)
    assert after[0] == pytest.approx(12.0) and after[1] == pytest.approx(0.5 * (length[1] + 20.0))
    way = (before[ids[:2]] - eye[:2]) / length[:2, None]
    np.testing.assert_allclose((points[ids[:2]] - eye[:2]) / after[:2, None], way, atol=1e-12)
    np.testing.assert_array_equal(points[[1, 2, 4]], before[[1, 2, 4]])


def test_the_nearest_place_of_a_polyline_open_and_closed() -> None:
    line = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]])
    uv = np.array([[1.0, 2.0], [5.0, -1.0], [4.5, 3.0], [-3.0, -4.0], [1.0, 1.0]])
    distance, at = np.empty(5), np.empty(5)
    nearest_on_line(uv, line, False, distance, at)
    np.testing.assert_allclose(distance, [2.0, np.sqrt(2.0), 0.5, 5.0, 1.0])
    np.testing.assert_allclose(at, [0.25, 1.0, 1.75, 0.0, 0.25])
    nearest_on_line(uv, line, True, distance, at)  # back from (4, 4) to (0, 0)
    np.testing.assert_allclose(distance, [np.sqrt(0.5), np.sqrt(2.0), 0.5, 5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(at[[0, 4]], [2.625, 2.75])
    nearest_on_line(uv[:1], line[:1], False, distance[:1], at[:1])
    assert distance[0] == pytest.approx(np.sqrt(5.0)) and at[0] == 0.0


def test_a_border_is_put_between_vertices_with_unit_normals() -> None:
    vertices = np.array([[0, 0, 0], [4, 0, 8], [1, 1, 1]], np.float32)
    normals = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0]], np.float32)
    to, to_normals = np.full((3, 3), 7.0, np.float32), np.full((3, 3), 7.0, np.float32)
    ids, low, high = np.array([0, 2]), np.array([0, 0]), np.array([1, 2])
    share, inward = np.array([0.25, 0.5], np.float32), np.zeros(2, np.float32)
    stitch_border(vertices, normals, to, to_normals, ids, low, high, share, inward)
    np.testing.assert_allclose(to, [[1, 0, 2], [7, 7, 7], [0.5, 0.5, 0.5]])
    np.testing.assert_allclose(to_normals[0], np.array([3.0, 1.0, 0.0]) / np.sqrt(10.0), atol=1e-6)
    np.testing.assert_array_equal(to_normals[2], 0.0)  # opposite ones cancel


@pytest.mark.parametrize("far", [0.5, -0.5])
def test_a_border_may_go_beside_the_way_between_two_vertices_in_the_surface(far: float) -> None:
    vertices = np.array([[0, 0, 0], [4, 0, 0]], np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (2, 1))
    to, to_normals = np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32)
    rows = [np.array([k]) for k in (0, 0, 1)]
    stitch_border(vertices, normals, to, to_normals, *rows, np.float32([0.25]), np.float32([far]))
    np.testing.assert_allclose(to, [[1, far, 0]], atol=1e-6)
    np.testing.assert_array_equal(to_normals, [[0, 0, 1]])


@pytest.mark.parametrize("angle", [0.0, 0.7, 3.0])
def test_vertices_are_sums_of_points_turned_by_their_share(rng: np.random.Generator, angle: float) -> None:
    points, weights = rng.normal(size=(6, 4)).astype(np.float32), rng.normal(size=7)
    start, ids = np.array([0, 3, 3, 7]), np.array([0, 5, 2, 1, 1, 4, 3])
    share, pivot = np.array([1.0, 0.5, 0.25], np.float32), np.array([1.0, -2.0, 3.0])
    turn, out = angle * np.array([0.48, -0.8, 0.36]), np.full((3, 3), 9.0)
    place_vertices(start, ids, weights, points, share, turn, pivot, out)
    sums = [(weights[a:b, None] * points[ids[a:b], :3]).sum(axis=0) for a, b in ((0, 3), (3, 3), (3, 7))]
    want = Rotation.from_rotvec(share[:, None] * turn).apply(np.array(sums) - pivot) + pivot
    np.testing.assert_allclose(out, want, atol=1e-6)
