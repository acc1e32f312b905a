"""Lines on the skin of flat sheets, where every place is known."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import Floats
from controller.face.skin_lines import SPACING, even_line, knots_around, mirror_uv, uv_under
from surface.dcp import DCPSurface

WIDE, HIGH = 100.0, 80.0


def plane(places: Floats, bend: float = 0.0) -> Floats:
    """(n, 3) mm for (u, v)."""
    u, v = places.T
    x = WIDE * (u - 0.5)
    return np.column_stack([x, HIGH * (v - 0.5), 5.0 + bend * x * x])


def sheet(bend: float = 0.0) -> DCPSurface:
    """A sheet of 100 by 80 mm, bent along x by a parabola."""
    knots = np.array([0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0])
    own = np.array([knots[k + 1 : k + 3].mean() for k in range(4)])
    grid = np.stack(np.meshgrid(own, own, indexing="ij"), axis=-1)
    points = plane(grid.reshape(-1, 2)).reshape(4, 4, 3)
    x = WIDE * (knots - 0.5)
    points[..., 2] += bend * (x[1:5] * x[2:6])[:, None]  # the blossom of x * x
    return DCPSurface.from_nurbs(2, 2, knots, knots, points, np.ones((4, 4)))


def test_the_sheet_is_the_one_that_is_meant() -> None:
    uv = np.random.default_rng(0).uniform(0, 1, (50, 2))
    np.testing.assert_allclose(sheet(0.01).evaluate(uv), plane(uv, 0.01), atol=1e-9)


def test_the_foremost_triangle_under_a_pixel_gives_its_place() -> None:
    near, far = np.array([[0.0, 0, 2], [100, 0, 4], [0, 100, 2]]), np.array([[0.0, 0, 3], [100, 0, 3], [0, 100, 3]])
    edge = np.array([[0.0, 200, 0], [50, 200, 0], [100, 200, 0]])  # seen from its edge
    shown = np.vstack([far, near, edge])
    triangles = np.array([[6, 7, 8], [0, 1, 2], [3, 5, 4]])
    uv = np.vstack([far[:, :2] / 100, 5.0 + near[:, :2] / 100, [[0, 0]] * 3])
    pixels = np.array([[10.0, 30.0], [80.0, 10.0], [0.0, 0.0], [60.0, 60.0], [-1.0, 5.0], [50.0, 200.0]])
    found = uv_under(pixels, shown, triangles, uv)
    np.testing.assert_allclose(found[0], [5.1, 5.3])  # the near one: its depth is 2.2, the other's 3
    np.testing.assert_allclose(found[1], [0.8, 0.1])  # 3.6 there
    np.testing.assert_allclose(found[2], [5.0, 5.0])
    assert np.isnan(found[3:]).all()


@pytest.mark.parametrize("width", [2.0, 3.0, 8.0])
def test_places_of_a_line_lie_evenly_as_far_apart_as_a_furrow_needs(width: float) -> None:
    picks = np.column_stack([np.linspace(0.2, 0.7, 40), np.full(40, 0.4)])
    found = even_line(sheet(), picks, width)
    at = plane(found)
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    np.testing.assert_allclose(at[[0, -1], 0], [-30.0, 20.0])
    np.testing.assert_allclose(steps, steps[0])
    assert len(found) == np.ceil(50.0 / (SPACING * width)) + 1 and steps[0] <= SPACING * width + 1e-9
    np.testing.assert_allclose(found[:, 1], 0.4)


def test_a_line_is_measured_on_the_bent_skin() -> None:
    bent = sheet(0.02)
    picks = np.column_stack([np.linspace(0.2, 0.8, 200), np.full(200, 0.5)])
    at = plane(even_line(bent, picks, 3.0), 0.02)
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    assert np.ptp(steps) < 0.02 * steps.mean()


def test_a_line_is_as_long_as_its_ways_along_u_and_v() -> None:
    picks = np.column_stack([np.linspace(0.2, 0.5, 40), np.linspace(0.2, 0.7, 40)])  # 30 by 40 mm
    assert len(even_line(sheet(), picks, 2.5)) == np.ceil(50.0 / 1.5) + 1


@pytest.mark.parametrize(("length", "count"), [(2.9, 0), (3.1, 4), (6.0, 5)])
def test_a_line_shorter_than_a_furrow_is_wide_is_none_and_others_have_four_places(length: float, count: int) -> None:
    picks = np.column_stack([np.linspace(0.5, 0.5 + length / WIDE, 9), np.full(9, 0.5)])
    found = even_line(sheet(), picks, 3.0)
    assert found.shape == (count, 2)


def test_picks_beside_the_skin_do_not_count_and_one_is_no_line() -> None:
    line = np.column_stack([np.linspace(0.3, 0.6, 31), np.full(31, 0.5)])
    holed = np.insert(line, [0, 7, 31], np.nan, axis=0)
    np.testing.assert_allclose(even_line(sheet(), holed, 3.0), even_line(sheet(), line, 3.0))
    assert even_line(sheet(), np.array([[0.5, 0.5], [np.nan, 0.2]]), 3.0).shape == (0, 2)
    assert even_line(sheet(), np.array([[0.5, 0.5], [0.6, 0.5]]), 3.0).shape == (5 + 2, 2)  # two are


@pytest.mark.parametrize(("gap_mm", "whole"), [(11.0, True), (13.0, False)])
def test_of_a_line_that_jumps_the_longest_piece_counts(gap_mm: float, whole: bool) -> None:
    one, two = np.linspace(0.1, 0.3, 11), 0.3 + gap_mm / WIDE + np.linspace(0.0, 0.3, 16)
    picks = np.column_stack([np.concatenate([one, two]), np.full(27, 0.5)])
    found = even_line(sheet(), picks, 3.0)[:, 0]
    np.testing.assert_allclose(found[[0, -1]], [0.1 if whole else two[0], two[-1]])


def test_trembling_is_smoothed_and_the_ends_stay() -> None:
    u = np.linspace(0.2, 0.7, 51)
    tremble = 0.5 + 0.01 * (-1.0) ** np.arange(51)
    found = even_line(sheet(), np.column_stack([u, tremble]), 3.0)
    np.testing.assert_allclose(found[[0, -1]], [[0.2, 0.51], [0.7, 0.51]])
    assert np.abs(found[4:-4, 1] - 0.5).max() <= 0.2 * 0.01 + 1e-9  # of five picks in turn one is left
    assert np.abs(found[4:-4, 1] - 0.5).max() > 0.0


def test_the_mirrored_place_is_that_on_the_other_side() -> None:
    bent = sheet(0.01)
    mesh_uv = np.stack(np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9), indexing="ij"), axis=-1).reshape(-1, 2)
    uv = np.array([[0.13, 0.22], [0.5, 0.7], [0.91, 0.05]])
    found = mirror_uv(bent, uv, plane(mesh_uv, 0.01), mesh_uv)
    np.testing.assert_allclose(found, np.column_stack([1.0 - uv[:, 0], uv[:, 1]]), atol=1e-9)
    np.testing.assert_array_equal(mesh_uv[:9, 0], 0.0)  # the mesh stays


def test_a_place_without_a_mirror_image_has_the_nearest_one_on_the_skin() -> None:
    """Of a sheet whose right half is cut off, the image of a place far to the left is at the edge."""
    half = DCPSurface.from_nurbs(
        1, 1, [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0],
        np.array([[[-50.0, -40.0, 5.0], [-50.0, 40.0, 5.0]], [[10.0, -40.0, 5.0], [10.0, 40.0, 5.0]]]), np.ones((2, 2)),
    )  # fmt: skip
    mesh_uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5], [1.0, 0.5]])
    found = mirror_uv(half, np.array([[0.1, 0.5]]), half.evaluate(mesh_uv), mesh_uv)
    np.testing.assert_allclose(half.evaluate(found), [[10.0, 0.0, 5.0]], atol=1e-9)


def test_knots_round_a_place_reach_as_far_in_mm_along_both_ways() -> None:
    (u,), (v,) = knots_around(sheet(), [0.4, 0.3], 8.0)
    np.testing.assert_allclose(WIDE * (u - 0.4), [-8.0, -4.0, 0.0, 4.0, 8.0], atol=1e-9)
    np.testing.assert_allclose(HIGH * (v - 0.3), [-8.0, -4.0, 0.0, 4.0, 8.0], atol=1e-9)
