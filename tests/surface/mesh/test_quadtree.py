"""Balanced trees whose triangles tile the domain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface.mesh import quadtree
from surface.mesh.quadtree import Lattice, Leaves


def random_tree(seed: int, joined: tuple[bool, bool] = (False, False)) -> tuple[Lattice, Leaves, list[np.ndarray]]:
    rng = np.random.default_rng(seed)
    lattice = Lattice(np.array([0.0, 0.3, 0.7, 1.0]), np.array([0.0, 0.1, 0.6, 1.0]), 6, joined)
    return lattice, *quadtree.grow(lattice, lambda level, cells: rng.uniform(size=len(cells)) < 0.9 * 0.75**level)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_leaves_tile_and_neighbours_differ_by_one_level(seed: int) -> None:
    lattice, leaves, _ = random_tree(seed)
    side = 3 << lattice.depth
    level = np.full((side, side), -1)
    for depth, (i, j) in zip(leaves.level, leaves.cell, strict=True):
        n = 1 << (lattice.depth - depth)
        block = level[i * n : (i + 1) * n, j * n : (j + 1) * n]
        assert (block == -1).all()
        block[:] = depth
    assert (level >= 0).all()
    assert max(np.abs(np.diff(level, axis=0)).max(), np.abs(np.diff(level, axis=1)).max()) <= 1


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_triangles_share_every_inner_edge_and_keep_an_angle(seed: int) -> None:
    lattice, leaves, inner = random_tree(seed)
    keys, owner = quadtree.triangulate(lattice, leaves, inner)
    x, y = lattice.point(keys)
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    assert area.min() > 0
    assert area.sum() == 2 * (3 << lattice.depth) ** 2
    assert len(np.unique(owner)) == len(leaves.level)
    directed = keys[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    back = {(b, a) for a, b in directed.tolist()}
    end = 3 << lattice.depth
    for a, b in directed.tolist():
        if (a, b) not in back:
            (xa, xb), (ya, yb) = lattice.point(np.array([a, b]))
            assert (xa == xb and xa in (0, end)) or (ya == yb and ya in (0, end))
    corner = np.stack([x, y], axis=-1).astype(float)
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    assert (area / sides.max(axis=1) ** 2).min() > 0.39  # at worst half a square from a half edge: 26.6 degrees


def test_lattice_lines_are_exact() -> None:
    lattice = Lattice(np.array([0.1, 0.3, 0.7]), np.array([-1.0, 1 / 3]), 5)
    uv = lattice.uv(np.array([0, 32, 64]), np.array([0, 32, 16]))
    assert uv[:, 0].tolist() == [0.1, 0.3, 0.7]
    assert uv[:2, 1].tolist() == [-1.0, 1 / 3]
    x, y = np.array([5, 64]), np.array([7, 32])
    assert np.array_equal(lattice.point(lattice.key(x, y)), (x, y))


def test_joined_sides_are_neighbours() -> None:
    lattice, leaves, _ = random_tree(3, joined=(True, False))
    side = 3 << lattice.depth
    level = np.zeros((side, side), dtype=int)
    for depth, (i, j) in zip(leaves.level, leaves.cell, strict=True):
        n = 1 << (lattice.depth - depth)
        level[i * n : (i + 1) * n, j * n : (j + 1) * n] = depth
    assert np.abs(level[0] - level[-1]).max() <= 1


def test_codes_are_those_of_cells_in_the_domain_or_around_a_joined_end() -> None:
    lines_u, lines_v = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 2.0])
    cells = np.array([[0, 0], [5, 0], [0, 1], [5, 3], [-1, 2], [6, 2], [2, -1], [2, 4], [-1, -1], [6, 4]])
    for joined, wanted in (
        ((False, False), [0, 5, 6, 23, -1, -1, -1, -1, -1, -1]),
        ((True, False), [0, 5, 6, 23, 17, 12, -1, -1, -1, -1]),
        ((False, True), [0, 5, 6, 23, -1, -1, 20, 2, -1, -1]),
        ((True, True), [0, 5, 6, 23, 17, 12, 20, 2, 23, 0]),
    ):
        lattice = Lattice(lines_u, lines_v, 4, joined)
        assert quadtree.codes(lattice, 1, cells).tolist() == wanted
        assert quadtree._decode(lattice, 1, np.array(wanted[:4])).tolist() == cells[:4].tolist()


def test_membership_in_sorted_numbers() -> None:
    held = np.array([2, 5, 9])
    assert quadtree.contains(held, np.arange(-1, 11)).tolist() == [k in (2, 5, 9) for k in range(-1, 11)]
    assert quadtree.contains(held[:0], np.arange(3)).tolist() == [False] * 3


def test_joined_borders_get_the_same_vertices_on_both_ends() -> None:
    for seed in range(4):
        lattice, leaves, inner = random_tree(seed, joined=(True, True))
        x, y = lattice.point(quadtree.triangulate(lattice, leaves, inner)[0])
        end = 3 << lattice.depth
        assert set(y[x == 0].tolist()) == set(y[x == end].tolist())
        assert set(x[y == 0].tolist()) == set(x[y == end].tolist())


def test_triangles_belong_to_the_leaf_that_they_lie_in() -> None:
    lattice, leaves, inner = random_tree(11)
    keys, owner = quadtree.triangulate(lattice, leaves, inner)
    x, y = lattice.point(keys)
    size = 1 << (lattice.depth - leaves.level[owner])
    low = leaves.cell[owner] * size[:, None]
    for at, k in ((x, 0), (y, 1)):
        assert (at >= low[:, k, None]).all() and (at <= (low[:, k] + size)[:, None]).all()
    whole = np.bincount(owner, (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))
    np.testing.assert_array_equal(whole, 2 * (1 << (lattice.depth - leaves.level)) ** 2)


def test_diagonals_of_squares_alternate() -> None:
    """So that no direction is preferred: the diagonals of all squares of a plain grid meet in every other corner."""
    lattice = Lattice(np.linspace(0, 1, 5), np.linspace(0, 1, 4), 1)
    leaves, inner = quadtree.grow(lattice, lambda _, cells: np.zeros(len(cells), dtype=bool))
    keys, _ = quadtree.triangulate(lattice, leaves, inner)
    edges = np.sort(keys[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    x, y = lattice.point(np.unique(edges, axis=0))
    slanted = (x[:, 0] != x[:, 1]) & (y[:, 0] != y[:, 1])
    assert slanted.sum() == 12
    assert ((x[slanted] // 2 + y[slanted] // 2) % 2 == 0).all()


def test_levels_are_asked_from_the_coarsest_down_and_reported() -> None:
    lattice = Lattice(np.array([0.0, 1.0]), np.array([0.0, 1.0, 2.0]), 3)
    asked, reported = [], []

    def first(level: int, cells: np.ndarray) -> np.ndarray:
        asked.append((level, len(cells)))
        return (cells == 0).all(axis=1)

    leaves, inner = quadtree.grow(lattice, first, lambda stage, share: reported.append((stage, share)))
    assert asked == [(0, 2), (1, 4), (2, 4)]
    assert reported == [("quad tree", 0.125), ("quad tree", 0.25), ("quad tree", 0.5)]
    assert [codes.tolist() for codes in inner] == [[0], [0], [0]]  # neighbours of the smallest are one level larger
    assert sorted(leaves.level.tolist()) == [0] + 3 * [1] + 3 * [2] + 4 * [3]
    none, _ = quadtree.grow(lattice, lambda _, cells: np.zeros(len(cells), dtype=bool))
    assert none.level.tolist() == [0, 0]


def test_parts_of_a_root_are_equal() -> None:
    lattice = Lattice(np.array([0.0, 0.4, 1.0]), np.array([2.0, 4.0]), 2)
    uv = lattice.uv(np.arange(9), np.array([0, 1, 2, 3, 4, 0, 1, 2, 3]))
    np.testing.assert_allclose(uv[:, 0], [0, 0.1, 0.2, 0.3, 0.4, 0.55, 0.7, 0.85, 1.0])
    np.testing.assert_allclose(uv[:, 1], [2, 2.5, 3, 3.5, 4, 2, 2.5, 3, 3.5])
    assert lattice.shape == (2, 1) and lattice.roots.tolist() == [[0, 0], [1, 0]]
    keys = lattice.key(*(a.ravel() for a in np.meshgrid(np.arange(9), np.arange(5))))
    assert len(set(keys.tolist())) == 45 and not any(Lattice(lattice.lines_u, lattice.lines_v, 2).joined)
