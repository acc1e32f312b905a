"""Edge flips reach the Delaunay triangulation of a convex set and keep what must stay."""

from __future__ import annotations

import numpy as np

from surface.mesh import flips


def grid(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float), indexing="ij")
    points = np.stack([x, y], axis=-1)
    points[1:-1, 1:-1] += rng.uniform(-0.35, 0.35, (n - 2, n - 2, 2))
    at = np.arange(n * n).reshape(n, n)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    return points.reshape(-1, 2), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    p = points[triangles]
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def test_no_edge_is_left_to_flip_and_the_area_stays() -> None:
    points, triangles = grid(9, 0)
    before = areas(points, triangles).sum()
    flips.improve(points, triangles, np.zeros(len(points), dtype=np.int64), rounds=50)
    assert areas(points, triangles).min() > 0
    assert np.isclose(areas(points, triangles).sum(), before)
    again = triangles.copy()
    flips.improve(points, again, np.zeros(len(points), dtype=np.int64), rounds=1)
    assert np.array_equal(again, triangles)


def test_kept_edges_stay() -> None:
    points = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 0.5], [2.0, -0.5]])
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    kept, free = np.array([1, 1, 0, 0]), np.zeros(4, dtype=np.int64)
    same = triangles.copy()
    flips.improve(points, same, kept)
    assert np.array_equal(same, triangles)
    flips.improve(points, triangles, free)
    assert {2, 3} <= set(triangles[0]) and {2, 3} <= set(triangles[1])


def test_edges_have_whole_keys_by_both_ends_in_either_order() -> None:
    keys, width = flips.edge_keys(np.array([[0, 1, 5], [5, 1, 3]]))
    assert width == 6 and keys.dtype.kind == "i"
    assert keys.tolist() == [1, 11, 5, 11, 9, 23]
    assert flips.edge_keys(np.zeros((0, 3), np.int64))[1] == 1
