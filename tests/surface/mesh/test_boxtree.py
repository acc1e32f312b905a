"""surface.mesh.boxtree: every box is that of the triangles under it, at rest and after the mesh has moved."""

from __future__ import annotations

import numpy as np
import pytest

from surface.mesh.boxtree import LEAF, BoxTree, _curve


def check(tree: BoxTree, vertices: np.ndarray) -> None:
    corners = vertices[tree.triangles]
    for node in range(1, 2 * tree.leaves):
        first, last = node, node
        while first < tree.leaves:
            first, last = 2 * first, 2 * last + 1
        under = corners[(first - tree.leaves) * LEAF : (last - tree.leaves + 1) * LEAF].reshape(-1, 3)
        np.testing.assert_array_equal(tree.low[node], under.min(axis=0, initial=np.inf))
        np.testing.assert_array_equal(tree.high[node], under.max(axis=0, initial=-np.inf))


@pytest.mark.parametrize("count", [1, 4, 5, 8, 9, 33, 64, 150])
def test_every_box_is_that_of_the_triangles_under_it(count: int) -> None:
    rng = np.random.default_rng(count)
    vertices, triangles = rng.normal(size=(60, 3)), rng.integers(0, 60, (count, 3))
    tree = BoxTree(vertices, triangles)
    assert sorted(tree.order) == list(range(count)) and (tree.triangles == triangles[tree.order]).all()
    check(tree, vertices)
    moved = vertices + rng.normal(size=(60, 3))
    tree.move(moved)
    check(tree, moved)


def test_triangles_that_lie_together_share_leaves() -> None:
    """On a line, the curve keeps their order."""
    x = np.random.default_rng(2).permutation(64)
    vertices = np.column_stack([np.repeat(x, 3) + np.tile([0.0, 0.3, 0.6], 64), np.zeros(192), np.zeros(192)])
    tree = BoxTree(vertices, np.arange(192).reshape(-1, 3))
    assert (x[tree.order] == np.arange(64)).all()


def test_the_curve_takes_one_bit_of_x_y_and_z_after_the_other_from_a_cube_of_1024() -> None:
    at = np.array([[0.0, 0, 0], [1023, 1023, 1023], [1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0], [5, 3, 6], [1.9, 0, 0]])
    keys = _curve(np.add(at, [7.0, -8.0, 9.0]))
    wanted = [0, 2**30 - 1, 1, 2, 4, 8, int("101110011", 2), 1]  # of 5, 3, 6: 101, 011 and 110, z first in each
    assert keys.tolist() == wanted
    flat = _curve(np.column_stack([np.linspace(0, 1, 3), np.zeros(3), np.zeros(3)]))
    assert flat.tolist() == [0, sum(1 << 3 * bit for bit in range(9)), sum(1 << 3 * bit for bit in range(10))]
    assert _curve(np.ones((2, 3))).tolist() == [0, 0]


@pytest.mark.parametrize(("count", "leaves"), [(1, 1), (4, 1), (5, 2), (8, 2), (9, 4), (16, 4), (17, 8)])
def test_leaves_hold_four_triangles_and_are_a_power_of_two(count: int, leaves: int) -> None:
    tree = BoxTree(np.random.default_rng(1).normal(size=(9, 3)), np.tile(np.arange(3), (count, 1)))
    assert tree.leaves == leaves and tree.low.shape == (2 * leaves, 3)
