"""Connected components against those that scipy finds."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from surface.check.cells import joined_nearer
from surface.check.components import joined


def same_parts(one: np.ndarray, two: np.ndarray) -> bool:
    """Whether two lists of labels part their nodes alike."""
    pairs = len(np.unique(np.stack([one, two]), axis=1).T)
    return pairs == len(np.unique(one)) == len(np.unique(two))


def by_scipy(count: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def test_what_is_joined_is_one_component() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        count, pairs = int(rng.integers(1, 60)), int(rng.integers(0, 60))
        a, b = rng.integers(0, count, (2, pairs))
        found = joined(count, a, b)
        assert same_parts(found, by_scipy(count, a, b))
        assert (found <= np.arange(count)).all()  # each is called by its first node


def test_points_near_each_other_are_one_component() -> None:
    for seed in range(10):
        points = np.random.default_rng(seed).uniform(0, 10, (80, 3))
        pairs = cKDTree(points).query_pairs(1.5, output_type="ndarray").astype(np.int64)
        assert same_parts(joined_nearer(points, np.arange(80), 1.5), by_scipy(80, *pairs.T))
    every = np.arange(5)
    line = np.arange(5.0)[:, None] * np.array([1.0, 0.0, 0.0])
    assert len(set(joined_nearer(line, every, 1.0 + 1e-9))) == 1 and len(set(joined_nearer(line, every, 0.99))) == 5
    assert len(joined_nearer(np.zeros((0, 3)), every[:0], 1.0)) == 0
