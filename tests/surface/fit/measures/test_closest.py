"""Distances from a mesh, beside trimesh's."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.measures.closest import ClosestTree


def grid(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy sheet of 40 x 40 mm: vertices and triangles."""
    x, y = np.meshgrid(np.linspace(0, 40, 17), np.linspace(0, 40, 17), indexing="ij")
    at = np.stack([x, y, 4 * np.sin(0.3 * x) + rng.normal(0, 0.5, x.shape)], axis=-1).reshape(-1, 3)
    ids = np.arange(17 * 17).reshape(17, 17)
    a, b, c, d = (v.ravel() for v in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    return at, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_distances_are_those_of_another_library() -> None:
    trimesh = pytest.importorskip("trimesh", reason="the oracle: pip install trimesh")
    from trimesh.triangles import closest_point

    rng = np.random.default_rng(3)
    at, triangles = grid(rng)
    tree, near = ClosestTree(at, triangles), np.zeros(200, np.int64)
    for shift in (0.0, 6.0):  # the second from the nearest triangles of the first
        moved = at + np.array([0.0, shift, 0.3 * shift])
        tree.move(moved)
        points = rng.uniform(-10, 50, (200, 3)) * [1, 1, 0.3]
        corners = trimesh.Trimesh(moved, triangles, process=False).triangles
        every = [
            np.linalg.norm(closest_point(corners, np.tile(p, (len(corners), 1))) - p, axis=1).min() for p in points
        ]
        np.testing.assert_allclose(tree.distances(points, near), every, atol=1e-9)


def test_points_on_the_mesh_have_none_and_slivers_do_no_harm() -> None:
    rng = np.random.default_rng(4)
    at, triangles = grid(rng)
    triangles = np.concatenate([triangles, [[0, 0, 5], [3, 3, 3]]])
    tree = ClosestTree(at, triangles)
    centres = at[triangles].mean(axis=1)
    assert tree.distances(centres[:-2], np.zeros(len(centres) - 2, np.int64)).max() < 1e-9
    one = ClosestTree(at, triangles[:1])
    assert one.distances(at[triangles[0]], np.zeros(3, np.int64)).max() < 1e-9
