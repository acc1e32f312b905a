"""Loops over (u, v) from edges in space: chords, seams, poles, errors."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface
from surface.mesh.domain import Domain
from surface.readers import trimloops
from surface.readers.trimloops import TrimEdge, loop_over, polyline
from tests.surface.readers.test_inversion import cylinder

RECT = (0.0, 4.0, 0.0, 1.0)
POLE = TrimEdge(np.zeros((0, 3)))


def test_chords_of_a_curve_stray_less_than_asked() -> None:
    def point(t: float) -> np.ndarray:
        return np.array([np.cos(t), np.sin(t), t])

    line = polyline(point, 0.0, 6.0, 1e-3)
    assert np.array_equal(line[[0, -1]], [point(0.0), point(6.0)])
    radii = np.linalg.norm((line[1:, :2] + line[:-1, :2]) / 2, axis=1)
    assert 1 - 1e-3 < radii.min() < 1 - 1e-5


def test_a_straight_curve_has_eight_equal_chords_from_end_to_end() -> None:
    points = polyline(lambda t: np.array([t, 2.0, -t]), 3.0, 7.0, 1e-6)
    np.testing.assert_allclose(points, [[t, 2.0, -t] for t in np.linspace(3, 7, 9)])


def test_chords_are_halved_until_they_stray_less_and_not_further() -> None:
    """The sagitta of a chord that spans an angle is 1 - cos of half of it; of 8 chords of a half circle, 0.0192."""

    def arc(t: float) -> Any:
        return np.array([np.cos(t), np.sin(t), 0.0])

    for error, chords in ((0.02, 8), (0.019, 16), (0.0049, 16), (0.0048, 32)):
        points = polyline(arc, 0.0, np.pi, error)
        np.testing.assert_allclose(points, [arc(t) for t in np.linspace(0, np.pi, chords + 1)], atol=1e-12)


def sphere() -> DCPSurface:
    """The unit sphere: u around it, 0 to 4, from its seam at y = 0, x > 0; v from the south to the north pole, 0 to 1,
    as rational quarter circles have it."""
    angle, half = np.arange(9) * np.pi / 4, 0.5**0.5
    far = np.where(np.arange(9) % 2, 2**0.5, 1.0)
    weight_u, weight_v = np.where(np.arange(9) % 2, half, 1.0), np.array([1, half, 1, half, 1])
    radius, height = np.array([0, 1, 1, 1, 0.0]), np.array([-1, -1, 0, 1, 1.0])
    net = np.stack([np.column_stack([far * np.cos(angle) * r, far * np.sin(angle) * r, np.full(9, z)])
                    for r, z in zip(radius, height, strict=True)], axis=1)  # fmt: skip
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    return DCPSurface.from_nurbs(2, 2, knots, [0, 0, 0, 0.5, 0.5, 1, 1, 1], net, weight_u[:, None] * weight_v[None, :])


def along(surface: DCPSurface, at: Callable[[Any], Any], back: bool = False) -> TrimEdge:
    """The curve of (u, v) = at(t), t from 0 to 1, in space."""
    t = np.linspace(0, 1, 65)
    points = surface.evaluate(np.column_stack(np.broadcast_arrays(*at(t))))
    return TrimEdge(points[::-1] if back else points)


def loops_of_cylinder(trims: list[TrimEdge]) -> np.ndarray:
    return loop_over(cylinder(), RECT, trims, 6.0)


def test_the_wall_of_a_cylinder_is_its_whole_rectangle_wherever_the_loop_begins() -> None:
    low, high = along(cylinder(), lambda t: (4 * t, 0.0)), along(cylinder(), lambda t: (4 * t, 1.0), back=True)
    up, down = along(cylinder(), lambda t: (0.0, t)), along(cylinder(), lambda t: (0.0, t), back=True)
    trims = [low, up, high, down]
    for first in range(4):
        loop = loops_of_cylinder(trims[first:] + trims[:first])
        assert Domain(RECT, [loop]).area == pytest.approx(4.0, abs=1e-9)
        assert all((np.abs(loop - corner).max(axis=1) < 1e-9).any() for corner in itertools.product((0, 4), (0, 1)))


def test_a_cylinder_cut_askew_keeps_what_is_below_the_cut() -> None:
    cut = along(cylinder(), lambda t: (4 * (1 - t), 0.5 + 0.3 * np.cos(2 * np.pi * t)))
    up = along(cylinder(), lambda t: (0.0, 0.8 * t))
    down = TrimEdge(up.points[::-1])
    loop = loops_of_cylinder([along(cylinder(), lambda t: (4 * t, 0.0)), up, cut, down])
    domain = Domain(RECT, [loop])
    assert domain.area == pytest.approx(2.0, rel=1e-3)
    assert domain.inside([[0.1, 0.7], [3.9, 0.7], [2.0, 0.3], [2.0, 0.1]]).tolist() == [True, True, False, True]


def test_a_hole_stays_where_it_is() -> None:
    hole = along(cylinder(), lambda t: (1.7 + 0.3 * np.cos(2 * np.pi * t), 0.5 + 0.2 * np.sin(2 * np.pi * t)))
    loop = loops_of_cylinder([hole])
    np.testing.assert_allclose(loop.mean(axis=0), [1.7, 0.5], atol=1e-6)
    assert Domain(RECT, [loop]).area == pytest.approx(np.pi * 0.3 * 0.2, rel=2e-3)


def test_a_whole_sphere_runs_up_its_seam_and_down_again() -> None:
    up, down = along(sphere(), lambda t: (0.0, t)), along(sphere(), lambda t: (0.0, t), back=True)
    loop = loop_over(sphere(), RECT, [POLE, up, POLE, down], 2.0)
    assert Domain(RECT, [loop]).area == pytest.approx(4.0, abs=1e-9)


@pytest.mark.parametrize("north", [True, False])
def test_a_cap_of_a_sphere_is_the_side_its_loop_runs_around(north: bool) -> None:
    """The loop of a face has the face on its left."""
    v = 0.7
    circle = along(sphere(), lambda t: (4 * t, v), back=not north)
    part = along(sphere(), (lambda t: (0.0, v + (1 - v) * t)) if north else (lambda t: (0.0, v * t)))
    back = TrimEdge(part.points[::-1])
    trims = [circle, part, POLE, back] if north else [circle, back, POLE, part]
    domain = Domain(RECT, [loop_over(sphere(), RECT, trims, 2.0)])
    assert domain.area == pytest.approx(4 * (1 - v if north else v), rel=1e-6)
    assert domain.inside([[1.0, 0.9], [3.0, 0.2]]).tolist() == [north, not north]


def test_a_hole_across_the_seam_is_refused() -> None:
    hole = along(cylinder(), lambda t: (0.3 * np.cos(2 * np.pi * t) % 4, 0.5 + 0.2 * np.sin(2 * np.pi * t)))
    with pytest.raises(ValueError, match="crosses the seam"):
        loops_of_cylinder([hole])


def test_edges_that_leave_a_gap_are_refused() -> None:
    low, up = along(cylinder(), lambda t: (1 + t, 0.2)), along(cylinder(), lambda t: (2.0, 0.2 + 0.5 * t))
    with pytest.raises(ValueError, match="does not close"):
        loops_of_cylinder([low, up])


def test_an_edge_away_from_its_face_is_refused() -> None:
    square = along(cylinder(), lambda t: (1 + t, 0.2))
    with pytest.raises(ValueError, match=r"lies up to 0\.5"):
        loops_of_cylinder([TrimEdge(square.points * np.array([1.25, 1.25, 1.0]))])


def test_a_loop_of_poles_alone_has_no_edge() -> None:
    with pytest.raises(ValueError, match="no edge in space"):
        loops_of_cylinder([POLE])


def bilinear(corners: list[list[float]]) -> DCPSurface:
    """A patch over the unit square; ``corners`` at (0, 0), (0, 1), (1, 0) and (1, 1)."""
    knots = [0.0, 0.0, 1.0, 1.0]
    return DCPSurface.from_nurbs(1, 1, knots, knots, np.array(corners).reshape(2, 2, 3))


UNIT = (0.0, 1.0, 0.0, 1.0)


@pytest.mark.parametrize(("apart", "one"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_border_within_a_millionth_of_the_size_is_a_pole_and_two_so_near_are_a_seam(apart: float, one: bool) -> None:
    off = [apart * 10.0, 0.0, 0.0]
    for corners, pole, seam in (
        ([[0, 0, 0], off, [1, 0, 1], [1, 5, 1]], (0, 0.0), None),
        ([[1, 0, 1], [1, 5, 1], [0, 0, 0], off], (0, 1.0), None),
        ([[0, 0, 0], [1, 0, 1], off, [1, 5, 1]], (1, 0.0), None),
        ([[1, 0, 1], [0, 0, 0], [1, 5, 1], off], (1, 1.0), None),
        ([[0, 0, 0], [0, 3, 0], off, [apart * 10.0, 3, 0]], None, (True, False)),
        ([[0, 0, 0], off, [0, 3, 0], [apart * 10.0, 3, 0]], None, (False, True)),
    ):
        surface = bilinear(corners)  # type: ignore[arg-type]
        poles = trimloops._poles(surface, UNIT, 10.0)
        if pole is not None:
            assert poles == ([pole] if one else [])
        if seam is not None:
            assert trimloops._closes(surface, UNIT, 10.0) == (seam if one else (False, False))


def test_a_point_at_a_pole_takes_the_other_coordinate_of_the_nearest_along_the_edge() -> None:
    for axis in range(2):
        rect = (2.0, 4.0, 10.0, 14.0)
        low, extent = rect[2 * axis], rect[2 * axis + 1] - rect[2 * axis]
        uv = np.array([[low + 0.0009 * extent, 7.0], [low + 0.0011 * extent, 8.0], [low + 0.5, 9.0], [low, 5.0]])
        uv = uv if axis == 0 else uv[:, ::-1].copy()
        before = uv.copy()
        trimloops._leave_poles(uv, rect, [(axis, low)])
        assert uv[:, 1 - axis].tolist() == [8.0, 8.0, 9.0, 9.0]
        np.testing.assert_array_equal(uv[:, axis], before[:, axis])
    only = np.full((2, 2), [0.0, 3.0])
    trimloops._leave_poles(only, UNIT, [(0, 0.0)])  # no point off the pole tells more
    assert only[:, 1].tolist() == [3.0, 3.0]


def test_edges_along_a_seam_are_free_and_the_ends_of_others_go_to_their_side() -> None:
    rect = (0.0, 4.0, 0.0, 1.0)
    seam = np.array([[0.003, 0.1], [3.997, 0.5], [0.0, 0.9]])
    right = np.array([[0.001, 0.2], [3.0, 0.2], [2.5, 0.2]])
    left = np.array([[1.0, 0.2], [1.5, 0.2], [3.999, 0.2]])
    off = np.array([[0.005, 0.2], [3.995, 0.2]])
    parts = [seam.copy(), right.copy(), left.copy(), off.copy()]
    assert trimloops._seams(parts, rect, (True, False)) == [(0, 0)]
    np.testing.assert_array_equal(parts[0], seam)
    assert parts[1][:, 0].tolist() == [4.0, 3.0, 2.5] and parts[2][:, 0].tolist() == [1.0, 1.5, 0.0]
    np.testing.assert_array_equal(parts[3], off)
    again = [right.copy()]
    assert trimloops._seams(again, rect, (False, False)) == []
    np.testing.assert_array_equal(again[0], right)
    across = [np.array([[1.0, 0.9991], [2.0, 0.0005], [3.0, 0.5]])]
    assert trimloops._seams(across, rect, (False, True)) == [] and across[0][:, 1].tolist() == [0.9991, 1.0, 0.5]
    near = [np.array([[1.0, 0.9995], [2.0, 0.0005]])]
    assert trimloops._seams(near, rect, (True, True)) == [(0, 1)]


def test_whether_edges_follow_each_other_without_a_pole_between() -> None:
    curve = TrimEdge(np.zeros((2, 3)))
    for edges, wanted in (
        ([curve, curve, curve], [True, True, True]), ([curve, POLE, curve], [False, True]),
        ([POLE, curve, curve], [True, False]), ([curve, curve, POLE], [True, False]), ([curve], [True]),
        ([POLE, curve, POLE, curve], [False, False]),
    ):  # fmt: skip
        assert trimloops._follow_directly(edges).tolist() == wanted


@pytest.mark.parametrize(("gap", "closes"), [(0.019, True), (0.021, False)])
def test_ends_a_fiftieth_of_the_rectangle_apart_close(gap: float, closes: bool) -> None:
    rect = (0.0, 4.0, 0.0, 10.0)
    for off in ([4.0 * gap, 0.0], [0.0, 10.0 * gap]):
        sides = [[[1.0, 1.0], [2.0, 1.0]], [[2.0, 1.0], [2.0, 5.0]], [[2.0, 5.0], [1.0, 1.0]]]
        parts = [np.array(side) for side in sides]
        parts[1] += off
        joined = np.array([True, False, True])
        if closes:
            assert len(trimloops._chain(parts, [], rect, joined)) >= 4
        else:
            with pytest.raises(ValueError, match="does not close"):
                trimloops._chain(parts, [], rect, joined)
        parts[1] = parts[1] - off
        assert len(trimloops._chain(parts, [], rect, joined)) == 3


def test_an_edge_along_a_seam_lies_at_the_end_that_closes_the_loop_anticlockwise() -> None:
    rect = (0.0, 4.0, 0.0, 1.0)
    low, high = np.array([[0.0, 0.0], [4.0, 0.0]]), np.array([[4.0, 1.0], [0.0, 1.0]])
    up, down = np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([[0.0, 1.0], [0.0, 0.0]])
    loop = trimloops._chain([low, up, high, down], [(1, 0), (3, 0)], rect, np.ones(4, bool))
    assert sorted(loop.tolist()) == [[0, 0], [0, 1], [4, 0], [4, 1]]
    assert trimloops._area(loop) == pytest.approx(4.0) and trimloops._area(loop[::-1]) == pytest.approx(-4.0)
    free = trimloops._chain([up.copy(), down.copy()], [(0, 0), (1, 0)], rect, np.zeros(2, bool))
    assert trimloops._area(free) == pytest.approx(4.0)


def test_points_that_repeat_the_one_before_are_dropped() -> None:
    loop = np.array([[0.0, 0.0], [0.0, 0.0], [5.0, 0.0], [5.0, 4e-12], [5.0, 1e-11], [0.0, 3.0], [0.0, 0.0]])
    assert trimloops._drop_repeats(loop).tolist() == [[5.0, 0.0], [5.0, 1e-11], [0.0, 3.0], [0.0, 0.0]]
