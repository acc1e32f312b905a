"""Grips seen from a face: turns of their knots, the knots that a ray meets, and what grips of a vertex lie where."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from relief import cube_tsm

from surface.readers import tlayout
from surface.readers.common import Location
from surface.readers.tlayout import Complex, Copy, Layout, Ray, directions, nearest, overlap
from surface.readers.tsmfile import parse
from tests.surface.readers.test_tsm import Writer, cells

KNOTS = Copy(3, (0.0, 1.0, 2.0, 4.0, 5.0), (-2.0, -1.0, 0.0, 3.0, 7.0))


@pytest.mark.parametrize("quarter", range(4))
def test_turned_knots_are_those_of_the_turned_corners(quarter: int) -> None:
    """The corner of any two knots, turned as a complex number, lies at two knots of the copy."""
    moved = KNOTS.moved(10.0, -20.0, quarter)
    wanted = {(u + 1j * v) * 1j**quarter + (10 - 20j) for u in KNOTS.knots_u for v in KNOTS.knots_v}
    assert {complex(u, v) for u in moved.knots_u for v in moved.knots_v} == wanted
    assert list(moved.knots_u) == sorted(moved.knots_u)
    assert moved.rect == (min(moved.knots_u), max(moved.knots_u), min(moved.knots_v), max(moved.knots_v))


def test_copies_that_differ_by_rounding_have_one_key() -> None:
    other = Copy(3, tuple(x + 1e-12 for x in KNOTS.knots_u), KNOTS.knots_v)
    assert other.key(1e-9) == KNOTS.key(1e-9)
    assert Copy(4, KNOTS.knots_u, KNOTS.knots_v).key(1e-9) != KNOTS.key(1e-9)
    assert KNOTS.moved(1e-3, 0.0, 0).key(1e-9) != KNOTS.key(1e-9)


def test_grips_of_a_corner_lie_at_two_sides() -> None:
    """Counts stand in the order north, west, south, east: two grips at one side, and two between it and the next."""
    assert directions([1, 1, 0, 0]) == [(1,), (1, 2), (2,)]
    assert directions([0, 0, 0, 1]) == [(0,)]
    assert directions([0, 0, 0, 0]) == []


@pytest.mark.parametrize(("x", "wanted"), [(-9.0, 0), (0.4, 0), (0.5, 0), (0.6, 1), (1.0, 1), (2.2, 3), (99.0, 4)])
def test_the_nearest_knot_is_the_first_of_equal_ones(x: float, wanted: int) -> None:
    row = [0.0, 1.0, 1.0, 2.0, 5.0]
    assert nearest(row, x) == wanted
    assert abs(row[wanted] - x) == min(abs(k - x) for k in row)


def test_rectangles_that_share_a_border_do_not_overlap() -> None:
    assert not overlap((0, 1, 0, 1), (1, 2, 0, 1), 1e-9)
    assert not overlap((0, 1, 0, 1), (0, 1, -3, 0), 1e-9)
    assert overlap((0, 1, 0, 1), (0.5, 2, 0.5, 2), 1e-9)
    assert overlap((0, 3, 0, 3), (1, 2, 1, 2), 1e-9)


def lines(*rows: tuple[float, int]) -> np.ndarray:
    return np.array([[at, 0.0, 1.0, outside] for at, outside in rows])


def test_a_ray_has_four_knots_at_each_outline_and_each_inner_edge_once() -> None:
    ray = Ray(lines((2.0, 0), (0.0, 1), (1.0, 0), (1.0, 0), (3.0, 2)), 1e-9)
    assert ray.row(1.5) == ([0.0] * 4 + [1.0, 2.0] + [3.0] * 4, 0.0, 3.0)


def test_a_ray_stays_on_its_side_of_a_hole() -> None:
    ray = Ray(lines((0.0, 1), (1.0, 0), (2.0, 2), (5.0, 1), (6.0, 0), (7.0, 2)), 1e-9)
    assert ray.row(0.5) == ([0.0] * 4 + [1.0] + [2.0] * 4, 0.0, 2.0)
    assert ray.row(6.5) == ([5.0] * 4 + [6.0] + [7.0] * 4, 5.0, 7.0)


def test_a_ray_that_ends_without_outline_goes_on_in_equal_steps() -> None:
    row, low, high = Ray(lines((1.0, 0), (2.0, 0), (4.0, 0)), 1e-9).row(2.0)
    assert row == [-2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    assert (low, high) == (-np.inf, np.inf)


def test_a_layout_is_flat_around_each_face_and_lays_nothing_twice() -> None:
    mesh = Complex(parse(Location(Path("cube.tsm")), cube_tsm()))
    for face in (0, 7, 20):
        layout = Layout(mesh, face)
        rects = list(layout.rects.values())
        assert layout.rects[face][::2] == (0.0, 0.0)
        assert not any(overlap(a, b, mesh.near) for k, a in enumerate(rects) for b in rects[:k])
        areas = [(b - a) * (d - c) for a, b, c, d in rects]
        sizes = [np.prod([side[0] for side in mesh._sides(mesh.loops[f])]) for f in layout.rects]
        assert areas == pytest.approx(sizes)


def windows(knots: list[float]) -> list[tuple[float, ...]]:
    """Five knots of every B-spline of degree 3 that ends at both ends of a row of knots."""
    row = [knots[0]] * 3 + knots + [knots[-1]] * 3
    return [tuple(row[k : k + 5]) for k in range(len(row) - 4)]


def test_grips_that_act_in_a_face_are_the_b_splines_of_the_net() -> None:
    us, vs = [0.0, 0.5, 1.25, 3.0, 4.0], [0.0, 1.0, 3.0, 3.5]
    faces = cells(us, vs)
    mesh = Complex(parse(Location(Path("net.tsm")), Writer(faces).text()))
    for face, (a, b, c, d) in enumerate(faces):
        copies = Layout(mesh, face).copies(face)
        found = sorted((copy.knots_u, copy.knots_v) for copy in (copy.moved(a, c, 0) for copy in copies))
        along_u = [knots for knots in windows(us) if knots[0] < b and knots[-1] > a]
        along_v = [knots for knots in windows(vs) if knots[0] < d and knots[-1] > c]
        assert len(copies) == 16 and found == sorted((u, v) for u in along_u for v in along_v)


@pytest.mark.parametrize(
    ("counts", "wanted"),
    [
        ([2, 0, 0, 0], [(1,), (1,)]), ([0, 1, 0, 0], [(2,)]), ([0, 0, 1, 0], [(3,)]),
        ([0, 0, 2, 1], [(3,), (3,), (3, 0), (3, 0), (0,)]), ([1, 0, 0, 2], [(1,), (0,), (0,), (0, 1), (0, 1)]),
    ],
)  # fmt: skip
def test_grips_are_counted_side_by_side_in_the_order_of_the_file(counts: list[int], wanted: list[tuple]) -> None:
    assert directions(counts) == wanted


def test_rectangles_overlap_by_more_than_what_is_near() -> None:
    one = (0.0, 1.0, 0.0, 1.0)
    for share, over in ((0.5, False), (2.0, True)):
        off = share * 0.01
        for other in ((1 - off, 2, 0, 1), (-1, off, 0, 1), (0, 1, 1 - off, 2), (0, 1, -1, off)):
            assert overlap(one, other, 0.01) == over and overlap(other, one, 0.01) == over


def test_values_that_are_near_each_other_are_one() -> None:
    assert tlayout._merge_values([0.0, 0.4, 1.5, 1.6, 2.7], 1.0) == [0.0, 1.5, 2.7]
    assert tlayout._merge_values([0.0, 1.0], 1.0) == [0.0] and tlayout._merge_values([], 1.0) == []


def test_a_layout_that_ends_goes_on_by_its_last_interval_on_either_side() -> None:
    inf = np.inf
    assert tlayout._extend([1.0, 2.0, 5.0], 2.0, 0.0, 9.0) == [1.0, 2.0, 5.0]
    assert tlayout._extend([1.0, 2.0, 5.0], 2.0, -inf, inf) == [-2.0, -1.0, 0.0, 1.0, 2.0, 5.0, 8.0, 11.0, 14.0]
    assert tlayout._extend([1.0, 2.0, 5.0], 2.0, -2.0, inf) == [1.0, 2.0, 5.0, 8.0, 11.0, 14.0]
    assert tlayout._extend([1.0, 2.0, 5.0], 2.0, -inf, 9.0) == [-2.0, -1.0, 0.0, 1.0, 2.0, 5.0]
    assert tlayout._extend([], 4.0, -inf, 6.0) == [-2.0, 0.0, 2.0]  # from x back, as far as x is from the end
    assert tlayout._extend([], 4.0, 1.0, inf) == [7.0, 10.0, 13.0]
    assert tlayout._extend([], 4.0, -inf, inf) == [1.0, 2.0, 3.0, 5.0, 6.0, 7.0]


def test_a_ray_takes_places_within_what_is_near_for_one() -> None:
    ray = Ray(lines((0.0, 1), (1.0, 0), (1.05, 0), (2.0, 2)), 0.1)
    whole = ([0.0] * 4 + [1.0] + [2.0] * 4, 0.0, 2.0)
    for x in (-0.05, 0.0, 0.5, 2.0, 2.05):
        assert ray.row(x) == whole
    assert ray.row(-0.2)[1:] == (-np.inf, 2.0) and ray.row(2.2)[1:] == (0.0, np.inf)


def test_a_whole_turn_of_knots_is_none_and_they_are_moved_last() -> None:
    assert KNOTS.moved(1.0, 2.0, 4) == KNOTS.moved(1.0, 2.0, 0)
    assert KNOTS.moved(0.0, 0.0, 1).knots_u == (-7.0, -3.0, 0.0, 1.0, 2.0)
    assert KNOTS.moved(0.5, 0.0, 1).knots_u[0] == -6.5 and KNOTS.moved(0.0, 0.5, 1).knots_v[0] == 0.5
    assert KNOTS.rect == (0.0, 5.0, -2.0, 7.0)
