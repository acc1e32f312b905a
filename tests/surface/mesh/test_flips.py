"""Edge flips reach the Delaunay triangulation of a convex set and keep what must stay."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

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


def test_a_convex_set_gets_the_triangles_of_delaunay_however_it_lies_in_space() -> None:
    for seed in range(3):
        points, triangles = grid(8, seed)
        wanted = {frozenset(t) for t in Delaunay(points).simplices.tolist()}
        turn = Rotation.from_rotvec([0.7, -1.1, 0.4 + seed]).as_matrix()
        for place in (points, np.column_stack([points, 0 * points[:, 0]]) @ turn.T + [30.0, -20.0, 10.0]):
            found = triangles.copy()
            flips.improve(place, found, np.zeros(len(points), dtype=np.int64), rounds=50)
            # a border that is straight lets scipy add triangles without area
            thin = [t for t in wanted if abs(areas(points, np.array([sorted(t)]))[0]) < 1e-9]
            assert {frozenset(t) for t in found.tolist()} == wanted - set(thin)


def flat_angle(p: np.ndarray, apex: int, a: int, b: int) -> float:
    u, v = p[a] - p[apex], p[b] - p[apex]
    return float(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)))


def turned(p: np.ndarray, *corners: int) -> np.ndarray:
    i, j, k = corners
    return np.cross(p[j] - p[i], p[k] - p[i])


def test_a_pair_is_flipped_where_angles_are_wide_and_no_new_triangle_turns_away() -> None:
    """Random creased pairs around the edge 0-1 with the tips 2 and 3."""
    rng = np.random.default_rng(12)
    flipped = away = 0
    for _ in range(400):
        p = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]]) + rng.normal(scale=0.1, size=(4, 3))
        p[2] += [rng.uniform(-1.2, 1.2), rng.uniform(0.05, 1.2), 0]
        p[3] += np.array([rng.uniform(-1.2, 1.2), *rng.uniform(-0.7, 0.7, 2)])
        p = p @ Rotation.random(random_state=rng.integers(1000)).as_matrix().T + 5.0
        triangles = np.array([[1, 2, 0], [3, 1, 0]])
        flips.improve(p, triangles, np.zeros(4, dtype=np.int64), rounds=1)
        wide = flat_angle(p, 2, 0, 1) + flat_angle(p, 3, 0, 1) > np.pi
        mean = turned(p, 0, 1, 2) + turned(p, 1, 0, 3)
        fits = turned(p, 0, 3, 2) @ mean > 0 and turned(p, 3, 1, 2) @ mean > 0
        if wide and fits:
            assert {frozenset(t) for t in triangles.tolist()} == {frozenset((0, 3, 2)), frozenset((3, 1, 2))}
            for t in triangles:
                assert turned(p, *t) @ mean > 0
            flipped += 1
        else:
            assert triangles.tolist() == [[1, 2, 0], [3, 1, 0]]
            away += wide
    assert flipped > 40 and away > 10


def test_edges_are_kept_whose_ends_share_a_line() -> None:
    points = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 0.5], [2.0, -0.5]])
    for a, b, stays in ((1, 1, True), (2, 2, True), (3, 2, True), (1, 2, False), (4, 3, False), (0, 1, False)):
        triangles = np.array([[0, 1, 2], [1, 0, 3]])
        flips.improve(points, triangles, np.array([a, b, 0, 0]))
        assert (triangles.tolist() == [[0, 1, 2], [1, 0, 3]]) == stays


def test_two_triangles_over_the_same_corners_are_left() -> None:
    points = np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 0.5]])
    pair = np.array([[0, 1, 2], [1, 0, 2]])
    flips.improve(points, pair, np.zeros(3, dtype=np.int64))
    assert pair.tolist() == [[0, 1, 2], [1, 0, 2]]


def test_a_square_is_left_as_it_is() -> None:
    """Both diagonals are as good: a flip would be undone by the next pass."""
    points, triangles = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1, 2], [0, 2, 3]])
    flips.improve(points, triangles, np.zeros(4, dtype=np.int64), rounds=1)
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_six_passes_are_made_at_most() -> None:
    n, x = 30, np.arange(30.0)  # two rows of points in two wide fans, which many passes turn into a strip
    points = np.vstack([np.column_stack([x, 0 * x]), np.column_stack([x + 0.3, 0 * x + 1.0])])
    lower = np.column_stack([np.arange(n - 1), np.arange(1, n), np.full(n - 1, n)])
    fans = np.vstack([lower, np.column_stack([np.full(n - 1, n - 1), lower[:, 1] + n, lower[:, 0] + n])])
    free = np.zeros(2 * n, dtype=np.int64)
    after = [fans.copy()]
    for _ in range(7):
        after.append(after[-1].copy())
        flips.improve(points, after[-1], free, rounds=1)
    flips.improve(points, fans, free)
    assert np.array_equal(fans, after[6])
    assert not np.array_equal(after[6], after[7]) and not np.array_equal(after[5], after[6])
    none = np.zeros((0, 3), np.int64)
    flips.improve(points, none, free)  # nothing to flip
    assert flips.edge_pairs(none).shape == (0, 2)


def test_pairs_are_the_triangles_on_either_side_of_an_edge() -> None:
    _, triangles = grid(4, 0)
    pairs = {tuple(sorted(pair)) for pair in flips.edge_pairs(triangles).tolist()}
    wanted = {(s, t) for s in range(len(triangles)) for t in range(s + 1, len(triangles))
              if len(set(triangles[s].tolist()) & set(triangles[t].tolist())) == 2}  # fmt: skip
    assert pairs == wanted
