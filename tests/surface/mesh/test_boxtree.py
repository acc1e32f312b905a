"""surface.mesh.boxtree: every box is that of the triangles under it, at rest and after the mesh has moved."""

from __future__ import annotations

import numpy as np
import pytest

from surface.mesh.boxtree import LEAF, BoxTree


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
