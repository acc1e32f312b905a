"""surface.mesh.collapse"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from surface.mesh.collapse import Collapse, _normals
from surface.mesh.mesh import border_edges


def sheet(side: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A flat square of side x side quads, 1 mm each, facing +z."""
    y, x = np.divmod(np.arange((side + 1) ** 2), side + 1)
    a = np.flatnonzero((x < side) & (y < side))
    b, c, d = a + 1, a + side + 1, a + side + 2
    triangles = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    return np.column_stack([x, y, 0 * x]).astype(float), triangles.astype(np.int32)


def test_a_plane_keeps_its_outline_alone() -> None:
    points, triangles = sheet(12)
    left = Collapse(points, triangles, np.zeros(len(points), bool)).run(1e-6)
    corner = points[left]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    assert len(left) < 12
    assert (area > 0).all()
    assert np.isclose(area.sum(), 144.0)


def test_what_bends_in_another_pose_stays() -> None:
    points, triangles = sheet(12)
    bent = points.copy()
    bent[:, 2] = np.where(points[:, 0] == 6, 3.0, 0.0)
    left = Collapse(np.hstack([points, bent]), triangles, np.zeros(len(points), bool)).run(1e-3)
    assert len(left) < 0.5 * len(triangles)
    crossing = (bent[left, 0].min(axis=1) < 6) & (bent[left, 0].max(axis=1) > 6)
    assert not crossing.any()


def test_locked_vertices_stay_and_so_does_their_border() -> None:
    points, triangles = sheet(8)
    border = np.unique(border_edges(triangles))
    locked = np.isin(np.arange(len(points)), border)
    left = Collapse(points, triangles, locked).run(1.0)
    assert set(np.unique(border_edges(left))) == set(border)
    assert len(left) < len(triangles)


def test_no_triangle_turns_over_where_every_collapse_is_free() -> None:
    points, triangles = sheet(12)
    inner = ((points[:, :2] > 0) & (points[:, :2] < 12)).all(axis=1)
    points[inner, :2] += np.random.default_rng(3).uniform(-0.3, 0.3, (inner.sum(), 2))
    left = Collapse(points, triangles, np.random.default_rng(4).random(len(points)) < 0.2).run(1e-6)
    area = 0.5 * np.cross(points[left[:, 1]] - points[left[:, 0]], points[left[:, 2]] - points[left[:, 0]])[:, 2]
    assert len(left) < 0.6 * len(triangles)
    assert (area > 0).all()


def bumpy(side: int, dimensions: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The sheet, far from the origin, with heights and further coordinates at random."""
    points, triangles = sheet(side)
    rng = np.random.default_rng(seed)
    points[:, :2] += rng.uniform(-0.2, 0.2, (len(points), 2))
    more = rng.normal(scale=0.3, size=(len(points), dimensions - 2))
    return np.hstack([points[:, :2], more]) + 20.0, triangles


def off_flat(place: NDArray[np.float64], corners: NDArray[np.float64]) -> float:
    """Distance of a place from the plane or line through corners, by least squares."""
    spanned = (corners[1:] - corners[0]).T
    best = np.linalg.lstsq(spanned, place - corners[0], rcond=None)[0]
    return float(np.linalg.norm(place - corners[0] - spanned @ best))


def area_of(corners: NDArray[np.float64]) -> float:
    p, q = corners[1] - corners[0], corners[2] - corners[0]
    return 0.5 * float(np.sqrt((p @ p) * (q @ q) - (p @ q) ** 2))


@pytest.mark.parametrize("dimensions", [3, 6])
def test_a_collapse_costs_the_mean_distance_from_what_both_ends_stood_for(dimensions: int) -> None:
    """Squares of distances from planes by area, and from the border's lines four times by the square of length."""
    points, triangles = bumpy(3, dimensions, 2)
    locked = np.arange(len(points)) == 5
    collapse = Collapse(points, triangles, locked)
    rim = border_edges(triangles)
    costs = {(gone, kept): cost for cost, gone, kept, *_ in collapse._heap}
    edges = {(a, b) for t in triangles.tolist() for a in t for b in t if a != b}
    assert set(costs) == {edge for edge in edges if edge[0] != 5}
    for (gone, kept), cost in costs.items():
        square = weight = 0.0
        for end in (gone, kept):
            for corners in points[triangles[(triangles == end).any(axis=1)]]:
                square += area_of(corners) * off_flat(points[kept], corners) ** 2
                weight += area_of(corners)
            for corners in points[rim[(rim == end).any(axis=1)]]:
                length = 4.0 * np.linalg.norm(corners[1] - corners[0]) ** 2
                square += length * off_flat(points[kept], corners) ** 2
                weight += length
        assert cost == pytest.approx(np.sqrt(square / weight), abs=1e-6), (gone, kept)


def euler(triangles: NDArray[np.int32]) -> int:
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return len(np.unique(triangles)) - len(edges) + len(triangles)


@pytest.mark.parametrize(("wide", "long"), [(1, 12), (2, 9), (6, 6)])
def test_a_disc_stays_a_disc_whose_border_was_its_border(wide: int, long: int) -> None:
    points, triangles = sheet(max(wide, long))
    kept = (points[triangles][:, :, 1].max(axis=1) <= wide) & (points[triangles][:, :, 0].max(axis=1) <= long)
    triangles = triangles[kept]
    border = set(np.unique(border_edges(triangles)).tolist())
    tips = np.isin(np.arange(len(points)), [0, long, wide * (max(wide, long) + 1)])  # else nothing would be left
    for locked in (tips, tips | (np.arange(len(points)) % 5 == 2)):
        left = Collapse(points, triangles, locked).run(1e9)
        assert 1 <= len(left) < len(triangles) and euler(left) == 1
        directed = left[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        assert len(np.unique(directed, axis=0)) == len(directed)
        assert set(np.unique(border_edges(left)).tolist()) <= border
        assert np.isin(np.intersect1d(np.flatnonzero(locked), triangles), left).all()


def test_a_ring_keeps_its_hole() -> None:
    points, triangles = sheet(9)
    middle = points[triangles].mean(axis=1)[:, :2]
    triangles = triangles[~((np.abs(middle - 4.5) < 1.5).all(axis=1))]
    left = Collapse(points, triangles, np.zeros(len(points), bool)).run(1e9)
    assert euler(left) == 0
    inner = np.intersect1d(np.unique(border_edges(left)), np.unique(border_edges(triangles)))
    assert len(inner) == len(np.unique(border_edges(left)))


@pytest.mark.parametrize(("cosine", "kept"), [(0.31, True), (0.29, False), (-0.9, False), (1.0, True)])
def test_a_triangle_may_turn_by_as_much_as_a_cosine_of_three_tenths(cosine: float, kept: bool) -> None:
    """Vertex 2 goes to vertex 3: the triangle 0 1 2 turns about its side 0 1, wherever it lies."""
    sine = np.sqrt(1 - cosine**2)
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 1.0, 0], [1, 3 * cosine, 3 * sine], [1, -1, 0]])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    collapse = Collapse(points @ turn.T + 7.0, np.array([[0, 1, 2], [1, 0, 4]]), np.zeros(5, bool))
    assert collapse._keeps_orientation({0}, 2, 3) == kept
    assert collapse._keeps_orientation(set(), 2, 3)


def test_a_triangle_without_area_is_not_made() -> None:
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [5, 0, 0]])
    collapse = Collapse(points, np.array([[0, 1, 2]]), np.zeros(4, bool))
    assert not collapse._keeps_orientation({0}, 2, 3)


def test_normals_are_cross_products() -> None:
    corners = np.random.default_rng(3).normal(size=(20, 3, 3)) + 50.0
    wanted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(_normals(corners), wanted, atol=1e-9)


def test_what_costs_as_much_as_the_error_stays_and_a_larger_error_goes_on() -> None:
    points, triangles = bumpy(7, 3, 5)
    collapse = Collapse(points, triangles, np.zeros(len(points), bool))
    least = collapse._heap[0][0]
    assert len(collapse.run(least)) == len(triangles)
    assert len(collapse.run(np.nextafter(least, 1.0))) < len(triangles)
    first = len(collapse.run(0.1))
    assert len(collapse.run(1.0)) < first
    again = Collapse(points, triangles, np.zeros(len(points), bool)).run(1.0)
    np.testing.assert_array_equal(again, collapse.run(1.0))
    assert Collapse(points, triangles, np.ones(len(points), bool)).run(1e9).shape == triangles.shape
