"""Openings between lids, their edges, and eyeballs fitted behind them."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from eye_face import ABOVE, CENTRES, HALF_HEIGHT, HALF_WIDTH, RADIUS, face

from surface.fit.eyes import openings as module
from surface.fit.eyes.openings import (
    Opening,
    ball_behind,
    find_openings,
    lid_positions,
    set_back,
    usual_radius,
)


@pytest.fixture(scope="module")
def plain():
    return face()


def find(mesh, middle=0.0, near=None):
    return find_openings(mesh, np.ones(len(mesh.faces), bool), middle, near)


def test_both_openings_are_found_the_left_one_first(plain) -> None:
    found = find(plain)
    assert [o.side for o in found] == ["Left", "Right"]
    for opening, centre in zip(found, CENTRES, strict=True):
        np.testing.assert_allclose(opening.middle[:2], centre[:2], atol=1.5)
        np.testing.assert_allclose(opening.size, [2 * HALF_WIDTH, 2 * HALF_HEIGHT], rtol=0.2)
        assert len(opening.edge) == len(set(opening.edge.tolist())) >= 12
        away = np.linalg.norm(plain.vertices[opening.edge] - centre, axis=1)
        np.testing.assert_allclose(np.sort(away)[:-4], RADIUS + ABOVE, atol=1.0)  # not in the corners


def test_what_is_far_from_what_blinks_or_not_mirrored_is_no_opening(plain) -> None:
    apart = 64.0
    lids = np.array([o.middle for o in find(plain)])
    assert find(plain, near=lids) and find(plain, near=lids + np.array([0, 0.4 * apart, 0]))
    assert not find(plain, near=lids + np.array([0, 0.5 * apart, 0]))
    assert not find(plain, near=lids + np.array([[0, 0, 0], [0, 0.5 * apart, 0]]))
    assert not find(plain, middle=60.0) and not find(plain, middle=-33.0)
    assert not find(face(lids=False))
    one = np.ones(len(plain.faces), bool)
    assert not find_openings(plain, one & False, 0.0, None)


@pytest.mark.parametrize(("factor", "found"), [(1.0, True), (0.3, False), (2.0, True), (2.7, False)])
def test_openings_that_are_very_narrow_or_wide_are_none(plain, factor: float, found: bool) -> None:
    """By their width in distances between both."""
    x = plain.vertices[:, 0]
    side = 32.0 * np.sign(x)
    near = np.abs(x - side) < 15
    if factor > 1:
        squeezed = replace(plain, vertices=np.column_stack([x - side + side / factor, plain.vertices[:, 1:]]))
    else:
        squeezed = replace(
            plain, vertices=np.column_stack([np.where(near, side + factor * (x - side), x), plain.vertices[:, 1:]])
        )
    assert bool(find(squeezed)) == found


def test_holes_seen_from_their_edge_are_none(plain) -> None:
    turned = replace(plain, vertices=plain.vertices[:, [0, 2, 1]])
    assert not find(turned)
    a = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    ring = np.column_stack([np.cos(a), np.sin(a), 0 * a])
    for degrees, seen in ((0, True), (70, True), (75, False), (180, True)):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        assert module._faces_front(9 + ring @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])) == seen
    assert not module._faces_front(np.zeros((8, 3)))


def test_the_edge_of_a_lid_is_before_the_hole_where_a_lining_leads_back() -> None:
    """Rings around a hole: the second is nearest to the middle, the hole lies behind it and further out."""
    count = 24
    a = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rings = [(7.0, -2.0), (5.0, 0.0), (9.0, 1.0), (14.0, 0.0)]
    points = np.vstack([np.column_stack([r * np.cos(a), r * np.sin(a), z + 0 * a]) for r, z in rings])
    at = np.arange(4 * count).reshape(4, count)
    nxt = np.roll(at, -1, axis=1)
    faces = np.stack([at[:-1], at[1:], nxt[1:], nxt[:-1]], axis=-1).reshape(-1, 4)
    mesh = replace(face(shapes=False), vertices=points, faces=faces, deltas=np.zeros((0, len(points), 3)))
    skin = np.ones(len(faces), bool)
    np.testing.assert_array_equal(module._edge(mesh, skin, at[0]), at[1])
    np.testing.assert_array_equal(module._edge(mesh, skin, at[1]), at[1])  # without a lining it is the hole


def lined_hole(lining: int, count: int, hole: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points, triangles, the hole and the edge of a round opening: from a hole of its own number of vertices so many
    rings of ``count`` lead forward and inward to the edge, and two more outward."""
    lead = [(6.6 - 1.6 * t, -1.6 + 1.6 * t) for t in np.linspace(0.0, 1.0, lining + 1)]
    rings = [(r, z, hole if k == 0 else count) for k, (r, z) in enumerate([*lead, (9.0, 1.0), (14.0, 0.0)])]
    points, angles = [], []
    for r, z, n in rings:
        a = np.linspace(0, 2 * np.pi, n, endpoint=False) + 0.003
        points.append(np.column_stack([r * np.cos(a), r * np.sin(a), z + 0 * a]))
        angles.append(a)
    starts = np.cumsum([0, *(len(p) for p in points)])
    faces = []
    for k, (a, b) in enumerate(pairwise(angles)):
        low, high, i, j = starts[k], starts[k + 1], 0, 0
        while i < len(a) or j < len(b):
            inner = j == len(b) or (i < len(a) and a[i] <= b[j])
            near, far = low + i % len(a), high + j % len(b)
            faces.append([near, low + (i + 1) % len(a), far, -1] if inner else [near, high + (j + 1) % len(b), far, -1])
            i, j = i + inner, j + (not inner)
    edge = np.arange(starts[lining], starts[lining + 1])
    return np.vstack(points), np.array(faces), np.arange(hole), edge


@pytest.mark.parametrize(("lining", "count", "hole"), [(2, 40, 40), (9, 40, 40), (3, 40, 131), (9, 61, 140)])
def test_edges_are_found_on_fine_meshes_and_about_holes_finer_than_the_skin(lining: int, count: int, hole: int) -> None:
    points, faces, rim, edge = lined_hole(lining, count, hole)
    mesh = replace(face(shapes=False), vertices=points, faces=faces, deltas=np.zeros((0, len(points), 3)))
    found = module._edge(mesh, np.ones(len(faces), bool), rim)
    beside = np.abs(points[found, 0]) < (1.0 - 2.0 * module.CORNER_WIDTH) * 6.6
    assert np.isin(found[beside], edge).all() and beside.sum() > 0.6 * len(edge) * min(1.0, 4 * hole / count)


def test_lids_are_where_shapes_slide_them(plain) -> None:
    left = find(plain)[0]
    rest, blink = plain.vertices[left.edge], plain.deltas[0][left.edge]
    moved = np.linalg.norm(blink, axis=1) > 0.1 * np.linalg.norm(blink, axis=1).max()
    np.testing.assert_allclose(lid_positions(plain, left), np.vstack([rest, (rest + blink)[moved]]))
    assert 0 < moved.sum() <= len(moved)
    bare = replace(plain, names=(), deltas=plain.deltas[:0])
    np.testing.assert_array_equal(lid_positions(bare, left), rest)
    still = replace(plain, deltas=0 * plain.deltas)
    np.testing.assert_array_equal(lid_positions(still, left), rest)
    named = replace(plain, names=("eyeWideLeft", "eyeSquintRight", "jawOpen"))
    assert len(lid_positions(named, left)) == len(rest) + moved.sum()


@pytest.mark.parametrize(("size", "apart", "radius"), [((20, 8), 64, 12.16), ((40, 8), 64, 16.0), ((20, 26), 64, 18.2)])
def test_a_usual_radius_is_a_persons_or_fills_the_opening(size, apart, radius) -> None:
    assert usual_radius(Opening("Left", np.zeros(0, int), np.zeros(3), np.array(size, float)), apart) == pytest.approx(
        radius
    )


def test_an_eyeball_is_fitted_behind_lids_that_slide_over_it(plain) -> None:
    for opening, centre in zip(find(plain), CENTRES, strict=True):
        ball = ball_behind(plain, opening, None, 64.0)
        np.testing.assert_allclose(ball.centre, centre, atol=2.0)
        assert ball.radius == pytest.approx(RADIUS, rel=0.08)
        heights = np.linalg.norm(plain.vertices[opening.edge] - ball.centre, axis=1) - ball.radius
        assert np.quantile(heights, 0.15) > 0 and abs(np.median(heights) - 0.6) < 0.8


def test_a_flat_eye_tells_where_its_eyeball_is(plain) -> None:
    left = find(plain)[0]
    free = ball_behind(plain, left, None, 64.0).centre
    aside = ball_behind(plain, left, left.middle + np.array([4.0, 0, 0]), 64.0).centre
    assert free[0] < aside[0] < free[0] + 4.0
    large = ball_behind(plain, left, None, 90.0)
    assert large.radius > ball_behind(plain, left, None, 64.0).radius + 0.5


def test_a_centre_is_set_back_until_nine_tenths_of_an_edge_lie_outside() -> None:
    a = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    centre, radius, lift = np.array([1.0, 2, 3]), 10.0, module.LID_MM[0]
    edge = centre + np.column_stack([6 * np.cos(a), 6 * np.sin(a), 0 * a + 8.0 + lift])  # on the sphere
    np.testing.assert_allclose(set_back(centre, radius, edge), centre, atol=1e-9)
    inside = edge - [0, 0, 2.0]
    np.testing.assert_allclose(set_back(centre, radius, inside), centre - [0, 0, 2.0], atol=1e-9)
    np.testing.assert_allclose(set_back(centre, radius, edge + np.array([0, 0, 2.0])), centre, atol=1e-9)
    few = edge.copy()
    few[:4, 2] -= 2.0
    np.testing.assert_allclose(set_back(centre, radius, few), centre, atol=1e-9)
    np.testing.assert_allclose(set_back(centre, radius, edge * [3, 3, 1]), centre)  # beside it
    np.testing.assert_allclose(set_back(centre, radius, edge - [0, 0, 6.0]), centre)  # too far back to tell


@pytest.mark.parametrize(("wide", "near"), [(3, 0.4), (61, 12.0)])
def test_edges_are_looked_for_in_five_rings_about_a_hole_and_further_out_on_fine_meshes(wide: int, near: float) -> None:
    points, faces = grid(101, 61)
    hole = np.flatnonzero((points[:, 1] == 30) & (np.abs(points[:, 0] - 50) <= wide // 2))
    away = np.abs(points[:, None, :2] - points[None, hole, :2])
    rings, distance = away.sum(axis=2).min(axis=1), np.hypot(*np.moveaxis(away, 2, 0)).min(axis=1)
    mesh: Any = SimpleNamespace(vertices=points, faces=faces)
    found = module._around(mesh, np.ones(len(faces), bool), hole)
    np.testing.assert_array_equal(found, (rings <= 5) | (distance < near))


def grid(wide: int, high: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) a millimetre apart, and the squares (f, 4) between them."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(wide), np.arange(high)))
    first = np.flatnonzero((x < wide - 1) & (y < high - 1))
    faces = first[:, None] + [0, 1, wide + 1, wide]
    return np.column_stack([x, y, np.zeros(len(x))]).astype(float), faces
