"""Loops over (u, v) from edges in space: chords, seams, poles, errors."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface
from surface.mesh.domain import Domain
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
