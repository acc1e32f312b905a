"""Trimmed triangulations: the domain's area, no triangle without area, corners kept."""

from __future__ import annotations

import numpy as np
import pytest

from surface import Domain
from surface.mesh import trim
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
    shares = trim._weights_in(flat, np.array([0.25, 0.25]))
    assert np.isneginf(shares[0]).all()
    assert np.allclose(shares[1], [0.5, 0.25, 0.25])


def test_an_edge_without_length_becomes_one_vertex() -> None:
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [1, 0]])
    flat = trim._merged(Flat(uv, np.array([[0, 1, 3], [1, 4, 3], [4, 2, 3]]), np.arange(3)))
    assert flat.triangles.tolist() == [[0, 1, 3], [1, 2, 3]]
    assert flat.owner.tolist() == [0, 2]


def test_a_flat_triangle_at_the_border_is_dropped() -> None:
    uv = np.array([[0.0, 0], [1, 0], [2, 0], [1, 1]])
    flat = trim._without_flat(Flat(uv, np.array([[0, 2, 3], [0, 1, 2]]), np.arange(2)))
    assert flat.triangles.tolist() == [[0, 2, 3]]
