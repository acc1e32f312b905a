"""Balanced trees whose triangles tile the domain."""

from __future__ import annotations

import numpy as np
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
