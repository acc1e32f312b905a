"""Trimmed triangulations: the domain's area, no triangle without area, corners kept."""

from __future__ import annotations

import numpy as np
import pytest

from surface import Domain, Slit
from surface.mesh import trim
from surface.mesh.mesh import border_edges
from surface.mesh.trim import Flat
from tests.surface import shapes


def grid(n: int) -> Flat:
    """The unit square as n x n squares of two triangles."""
    i, j = (x.ravel() for x in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a = i * (n + 1) + j
    triangles = np.concatenate([np.stack([a, a + n + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + 1], axis=1)])
    u, v = (x.ravel() / n for x in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    return Flat(np.stack([u, v], axis=1), triangles, np.tile(np.arange(n * n), 2))


def areas(flat: Flat) -> np.ndarray:
    a, b, c = (flat.uv[flat.triangles[:, k]] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


DOMAINS = {
    "the whole square": [np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])],
    "lines of the grid": [np.array([[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]])],
    "a diamond": [np.array([[0.5, 0.11], [0.93, 0.5], [0.5, 0.97], [0.02, 0.5]])],
    "a ring": [shapes.circle(0.5, 0.5, 0.4), shapes.circle(0.5, 0.5, 0.2)],
    "an eye": [shapes.eye(0.5, 0.5, 0.4, 0.2)],
}


@pytest.mark.parametrize("name", DOMAINS)
@pytest.mark.parametrize("n", [8, 13, 32])
def test_area_is_kept_and_no_triangle_is_flat(name: str, n: int) -> None:
    domain = Domain((0, 1, 0, 1), loops=DOMAINS[name])
    flat = trim.trim(grid(n), domain, (1.0, 1.0))
    area = areas(flat)
    assert area.min() > 0
    assert area.sum() == pytest.approx(domain.area, rel=0.03 if n < 32 else 0.005)
    directed = flat.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert len(np.unique(flat.triangles)) == len(flat.uv)
    assert len(flat.owner) == len(flat.triangles)
    cell = (np.stack(np.divmod(flat.owner, n), axis=1) + 0.5) / n  # vertices move by less than a cell
    assert np.abs(flat.uv[flat.triangles].mean(axis=1) - cell).max() < 1.2 / n


def test_sharp_corners_become_vertices() -> None:
    corners = DOMAINS["a diamond"][0]
    flat = trim.trim(grid(16), Domain((0, 1, 0, 1), loops=[corners]), (1.0, 1.0))
    for corner in corners:
        assert (flat.uv == corner).all(axis=1).any()


def test_nothing_is_lost_beside_sharp_corners() -> None:
    rng = np.random.default_rng(1)
    for _ in range(40):
        low, high, t = rng.uniform(0.06, 0.25, 2), rng.uniform(0.7, 0.94, 2), rng.uniform(-0.05, 0.05, 4)
        square = [low, (high[0], low[1] + t[0]), (high[0] + t[1], high[1]), (low[0] + t[2], high[1] + t[3])]
        domain = Domain((0, 1, 0, 1), loops=[np.array(square)])
        area = areas(trim.trim(grid(9), domain, (1.0, 1.0)))
        assert area.min() > 0 and area.sum() == pytest.approx(domain.area, rel=1e-9)


@pytest.mark.parametrize("scale", [(1.0, 1.0), (1.0, 7.0)])
def test_the_border_has_a_vertex_at_every_mark(scale: tuple[float, float]) -> None:
    ring, marks = shapes.circle(0.5, 0.5, 0.4), shapes.circle(0.5, 0.5, 0.4)[3::17]
    flat = trim.trim(grid(9), Domain((0, 1, 0, 1), loops=[ring], marks=marks), scale)
    directed = {(a, b) for t in flat.triangles.tolist() for a, b in zip(t, [*t[1:], t[0]], strict=True)}
    border = flat.uv[sorted({a for a, b in directed if (b, a) not in directed})]
    assert np.linalg.norm(marks[:, None] - border, axis=2).min(axis=1).max() < 1e-12
    assert (areas(flat) > 0).all()


def test_a_mark_on_the_rectangle_is_reached_along_it() -> None:
    square, mark = DOMAINS["the whole square"][0], np.array([[0.51, 1.0]])
    bare = trim.trim(grid(8), Domain((0, 1, 0, 1), loops=[square]), (1.0, 1.0))
    flat = trim.trim(grid(8), Domain((0, 1, 0, 1), loops=[square], marks=mark), (1.0, 1.0))
    assert (flat.uv == mark).all(axis=1).any() and not (bare.uv == mark).all(axis=1).any()
    assert areas(flat).sum() == pytest.approx(areas(bare).sum()) and (areas(flat) > 0).all()
    assert len(flat.uv) == len(bare.uv)


def test_nothing_inside_leaves_nothing() -> None:
    away = Domain((0, 1, 0, 1), loops=[shapes.circle(4, 4, 0.5)])
    assert len(trim.trim(grid(4), away, (1.0, 1.0)).triangles) == 0


def test_a_triangle_without_area_holds_no_point() -> None:
    flat = Flat(np.array([[0.0, 0], [1, 0], [2, 0], [0, 1]]), np.array([[0, 1, 2], [0, 1, 3]]), np.zeros(2, np.int64))
    shares = trim._barycentric(flat, np.array([0.25, 0.25]))
    assert np.isneginf(shares[0]).all()
    assert np.allclose(shares[1], [0.5, 0.25, 0.25])


def test_an_edge_without_length_becomes_one_vertex() -> None:
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [1, 0]])
    flat = trim._merge_coincident(Flat(uv, np.array([[0, 1, 3], [1, 4, 3], [4, 2, 3]]), np.arange(3)))
    assert flat.triangles.tolist() == [[0, 1, 3], [1, 2, 3]]
    assert flat.owner.tolist() == [0, 2]


def test_a_flat_triangle_at_the_border_is_dropped() -> None:
    uv = np.array([[0.0, 0], [1, 0], [2, 0], [1, 1]])
    flat = trim._drop_flat_border(Flat(uv, np.array([[0, 2, 3], [0, 1, 2]]), np.arange(2)))
    assert flat.triangles.tolist() == [[0, 2, 3]]


def clipped(ring: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """A convex polygon's part where ``normal @ p <= offset`` (Sutherland and Hodgman)."""
    out = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        da, db = normal @ a - offset, normal @ b - offset
        if da <= 0:
            out.append(a)
        if (da < 0) != (db < 0) and da != db:
            out.append(a + da / (da - db) * (b - a))
    return np.array(out)


def ring_area(ring: np.ndarray) -> float:
    x, y = ring.T
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


@pytest.mark.parametrize("n", [5, 8])
def test_a_loop_across_the_rectangle_leaves_exactly_what_lies_on_its_side(n: int) -> None:
    """Half planes, as large quadrilaterals, cut the square; vertices on its border slide along that."""
    rng, square = np.random.default_rng(n), DOMAINS["the whole square"][0]
    for _ in range(40):
        angle = rng.uniform(0, 2 * np.pi)
        normal = np.array([np.cos(angle), np.sin(angle)])
        offset = normal @ rng.uniform(0.15, 0.85, 2)
        along, foot = np.array([-normal[1], normal[0]]), offset * normal
        loop = np.array(
            [foot + 9 * along, foot - 9 * along, foot - 9 * along - 9 * normal, foot + 9 * along - 9 * normal]
        )
        scale = (1.0, float(rng.choice([1.0, 0.3, 4.0])))
        flat = trim.trim(grid(n), Domain((0, 1, 0, 1), loops=[loop]), scale)
        part = clipped(square, normal, offset)
        assert areas(flat).min() > 0
        assert areas(flat).sum() == pytest.approx(ring_area(part), rel=1e-9)
        directed = flat.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        back = {(b, a) for a, b in directed.tolist()}
        for a, b in directed.tolist():
            if (a, b) not in back:  # a border edge: on the line, or on one side of the square
                on_line = np.abs(flat.uv[[a, b]] @ normal - offset).max() < 1e-9
                assert on_line or ((flat.uv[a] == flat.uv[b]) & np.isin(flat.uv[a], (0, 1))).any()
        assert ((flat.uv >= 0) & (flat.uv <= 1)).all()
        assert set(flat.owner.tolist()) <= set(range(n * n))


def test_triangles_stay_in_the_leaf_that_they_came_from() -> None:
    """A straight cut leaves every triangle where it was, up to vertices that are moved by part of a cell."""
    flat = trim.trim(grid(8), Domain((0, 1, 0, 1), loops=[shapes.circle(0.5, 0.5, 0.37)]), (1.0, 1.0))
    middle = flat.uv[flat.triangles].mean(axis=1)
    i, j = np.divmod(flat.owner, 8)
    cell = np.column_stack([i + 0.5, j + 0.5]) / 8
    assert np.abs(middle - cell).max() < 1.5 / 8
    assert np.median(np.abs(middle - cell).max(axis=1)) < 0.5 / 8


@pytest.mark.parametrize("scale", [(1.0, 1.0), (1.0, 5.0)])
def test_marks_anywhere_become_vertices_and_nothing_folds(scale: tuple[float, float]) -> None:
    rng, around = np.random.default_rng(4), np.array([[-1.0, -1], [2, -1], [2, 2], [-1, 2]])
    for _ in range(60):
        marks = rng.uniform(0.02, 0.98, (3, 2))
        domain = Domain((0, 1, 0, 1), loops=[around], marks=marks)
        flat = trim.trim(grid(5), domain, scale)
        assert areas(flat).min() >= 0 and areas(flat).sum() == pytest.approx(1.0, rel=1e-9)
        for mark in marks:
            assert (np.abs(flat.uv - mark).max(axis=1) < 0.1 / 5).any()


def test_a_point_moves_the_free_vertex_next_to_it_or_splits_its_triangle() -> None:
    """By its greatest barycentric share: above 0.7 the vertex moves, below 0.9 the triangle is split."""
    free, none = np.full(9, -1), np.zeros(9, bool)
    for share, line, fixed, moves, splits in (
        (0.71, -1, False, True, False),
        (0.69, -1, False, False, True),
        (0.71, 2, False, False, True),  # on the rectangle's border
        (0.71, -1, True, False, True),  # already put somewhere
        (0.89, 2, False, False, True),
        (0.91, 2, False, False, False),  # so near that a split would leave a sliver
        (0.91, -1, False, True, False),
    ):
        start = grid(2)
        corners = start.uv[start.triangles[0]]
        point = share * corners[0] + (1 - share) * 0.5 * (corners[1] + corners[2])
        lines, held = free.copy(), none.copy()
        lines[start.triangles[0, 0]], held[start.triangles[0, 0]] = line, fixed
        flat, lines, held = trim._place_vertex(start, point, lines, held)
        if moves:
            assert len(flat.uv) == 9 and np.allclose(flat.uv[start.triangles[0, 0]], point)
            assert held[start.triangles[0, 0]]
        elif splits:
            assert len(flat.uv) == 10 and np.allclose(flat.uv[9], point) and lines[9] == -1 and held[9]
            assert areas(flat).sum() == pytest.approx(1.0) and len(flat.triangles) in (10, 11)
        else:
            assert len(flat.uv) == 9 and not np.allclose(flat.uv[start.triangles[0, 0]], point)
    outside = trim._place_vertex(grid(2), np.array([1.2, 0.5]), free, none)[0]
    assert len(outside.uv) == 9


def test_a_split_near_an_edge_takes_both_its_triangles() -> None:
    start = grid(2)
    diagonal = start.uv[start.triangles[0]][[0, 2]].mean(axis=0)  # between the two triangles of a square
    for towards in (0.0, 0.14 * 3, 0.16 * 3):
        corners = start.uv[start.triangles[0]]
        point = diagonal + towards * (corners.mean(axis=0) - diagonal)
        share = trim._barycentric(grid(2), point)[0]
        flat = trim._insert(grid(2), point, 0, share)
        near = share.min() < 0.15
        assert len(flat.triangles) == 10
        directed = flat.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        assert len(np.unique(directed, axis=0)) == len(directed)
        used = (flat.triangles == 9).any(axis=1).sum()
        assert used == (4 if near else 3)
        assert areas(flat).min() >= 0 and areas(flat).sum() == pytest.approx(1.0)
        assert set(flat.owner.tolist()) == set(range(4))


def test_vertices_know_the_line_that_they_may_slide_along() -> None:
    uv = np.array([[0.0, 0.5], [1.0, 0.5], [0.5, 0.0], [0.5, 1.0], [0.0, 0.0], [1.0, 1.0], [0.3, 0.3],
                   [0.25, 0.75], [0.75, 0.75], [0.6, 0.75], [0.6, 0.6]])  # fmt: skip
    domain = Domain((0, 1, 0, 1), slits=[Slit("u", 0.75, 0.25, 0.75), Slit("v", 0.6, 0.2, 0.9)])
    assert trim._sliding_lines(uv, domain).tolist() == [0, 1, 2, 3, -2, -2, -1, -2, -2, -2, 5]
    assert trim.slit_masks(uv, domain).tolist() == [0, 0, 0, 0, 0, 0, 0, 1, 1, 3, 2]


def test_vertices_that_none_uses_are_dropped() -> None:
    flat = trim.compact(Flat(np.arange(10.0).reshape(5, 2), np.array([[4, 1, 2]]), np.array([7])))
    assert flat.uv.tolist() == [[2, 3], [4, 5], [8, 9]] and flat.triangles.tolist() == [[2, 0, 1]]
    assert flat.owner.tolist() == [7]


def test_a_triangle_that_turns_no_way_is_kept_inside_the_mesh() -> None:
    """Without area, but with neighbours on two sides: to drop it would tear them apart."""
    uv = np.array([[0.0, 0], [1, 0], [2, 0], [1, 1], [1, -1]])
    triangles = np.array([[0, 2, 3], [0, 1, 2], [1, 0, 4], [2, 1, 4]])
    flat = trim._drop_flat_border(Flat(uv, triangles, np.arange(4)))
    assert flat.triangles.tolist() == triangles.tolist()
    chain = np.array([[0, 2, 3], [0, 1, 2]])
    assert trim._drop_flat_border(Flat(uv, chain, np.arange(2))).owner.tolist() == [0]


@pytest.mark.parametrize("across", [0.633, 0.62, 0.5001, 0.7])
def test_the_border_runs_through_marks_on_straight_sides(across: float) -> None:
    for at in np.linspace(0.13, 0.87, 13):
        ring, marks = [[0.1, 0.1], [across, 0.1], [across, 0.9], [0.1, 0.9]], np.array([[across, at], [0.1, 1.0 - at]])
        flat = trim.trim(grid(8), Domain((0, 1, 0, 1), loops=[ring], marks=marks), (1.0, 1.0))
        border = flat.uv[np.unique(border_edges(flat.triangles))]
        assert (border[:, None] == marks).all(axis=2).any(axis=0).all()
        assert areas(flat).sum() == pytest.approx(0.8 * (across - 0.1))


def test_the_first_flat_triangle_with_the_vertex_on_its_longest_edge_is_found() -> None:
    uv = np.array([[0.0, 0], [1, 0], [2, 0], [1, 1], [1, -1], [1.0, 5.0]])
    sharp, turned = [0, 1, 3], [2, 0, 1]  # one with area; one that has the vertex as its last corner
    upright = [3, 1, 4]
    for triangles, wanted in (
        ([sharp, turned, upright], 1), ([sharp, upright, turned], 1), ([sharp, upright], 1), ([sharp], None),
        ([[1, 3, 5], sharp], None),  # without area, but the vertex is an end
        ([[0, 2, 4], sharp], None),
    ):  # fmt: skip
        flat = Flat(uv, np.array(triangles), np.arange(len(triangles)))
        assert trim._find_flat(flat, 1) == wanted


@pytest.mark.parametrize(("off", "found"), [(1.9e-9, 0), (2.1e-9, None)])
def test_a_triangle_is_flat_below_a_thousand_millionth_of_its_squared_sides(off: float, found: int | None) -> None:
    uv = np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, off]])  # the cross product is off, the squared sides are 2
    assert trim._find_flat(Flat(uv, np.array([[0, 1, 2]]), np.arange(1)), 1) == found


def test_the_triangle_across_an_edge_runs_along_it_the_other_way() -> None:
    triangles = np.array([[0, 1, 2], [4, 5, 3], [2, 1, 3], [0, 2, 3]])
    wanted = {(1, 2): 2, (2, 1): 0, (3, 0): None, (2, 0): 3, (1, 0): 0, (3, 4): None, (4, 3): 1, (5, 4): 1}
    assert {edge: trim._find_across(triangles, *edge) for edge in wanted} == wanted
    assert trim._find_across(np.vstack([triangles, triangles]), 1, 2) == 2  # of two the first
