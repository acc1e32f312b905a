"""Nearest edges of borders against every pair of edges, ways along them against scipy's shortest paths."""

from __future__ import annotations

import tracemalloc
from itertools import combinations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from surface.check.network import Network


def walked(middle: np.ndarray, ends: np.ndarray) -> float:
    """Distance of a point from an edge (2, 3), by a fine walk along it."""
    along = np.linspace(0.0, 1.0, 4001)[:, None]
    return float(np.linalg.norm(ends[0] + along * (ends[1] - ends[0]) - middle, axis=1).min())


def ways(ids: np.ndarray, length: np.ndarray) -> np.ndarray:
    """(v, v) shortest ways between vertices along the edges, by scipy."""
    graph = np.full((ids.max() + 1,) * 2, np.inf)
    for (a, b), mm in zip(ids, length, strict=True):
        graph[a, b] = graph[b, a] = min(graph[a, b], mm)
    row, column = np.nonzero(np.isfinite(graph))
    return np.asarray(dijkstra(coo_array((graph[row, column], (row, column)), graph.shape)))


@pytest.mark.parametrize("along", [0.0, 1.5, 4.0])
@pytest.mark.parametrize("reach", [0.8, 3.0])
def test_the_nearest_edge_that_is_not_beside(reach: float, along: float) -> None:
    random = np.random.default_rng(4)
    points = random.uniform(0.0, 4.0, (40, 3))
    ids = np.array([random.choice(40, 2, replace=False) for _ in range(34)])
    at = points[ids]
    at[3, 1] = at[3, 0]  # an edge of no length
    length = random.uniform(0.1, 2.0, 34)
    way, rows = ways(ids, length), random.permutation(34)[:30]
    distance, other = Network(ids, length).nearest(at, rows, reach, along)
    left_out = 0
    for q, i in enumerate(rows):
        beside = np.array([set(e) & set(ids[i]) != set() or way[np.ix_(ids[i], e)].min() < along for e in ids])
        left_out += beside.sum()
        away = [np.inf if beside[j] else walked(at[i].mean(axis=0), at[j]) for j in range(34)]
        best = int(np.argmin(away))
        if away[best] < reach:
            assert other[q] == best and distance[q] == pytest.approx(away[best], abs=2e-3)
        else:
            assert other[q] == -1 and distance[q] == np.inf
    assert left_out > (100 if along else 30) and (other >= 0).any()


def test_of_edges_in_the_same_distance_the_first_counts() -> None:
    at = np.array([[[0.0, 0, 0], [2, 0, 0]], *([[[1.0, 1, 0], [1, 2, 0]]] * 40)])
    ids = np.arange(82).reshape(-1, 2)
    assert Network(ids, np.ones(41)).nearest(at, np.array([0]), 3.0, 0.0)[1].tolist() == [1]


@pytest.mark.parametrize("far", [[15.0, 0, 0], [0, 15.0, 0], [0, 0, -15.0]])
def test_a_long_edge_is_found_from_its_far_end(far: list[float]) -> None:
    """From more than ten times the reach away from its first end, and where it passes."""
    other = np.roll(far, 1) / 30.0
    at = np.array([[[0.0, 0, 0], far], [far + other, far + other], [0.5 * np.array(far) + other] * 2])
    network = Network(np.arange(6).reshape(-1, 2), np.ones(3))
    distance, found = network.nearest(at, np.array([1, 2]), 1.0, 0.0)
    assert found.tolist() == [0, 0] and distance.tolist() == [pytest.approx(0.5)] * 2


def test_neighbours_are_edges_with_little_border_between() -> None:
    ids = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [7, 8]])
    network = Network(ids, np.array([5.0, 0.4, 0.4, 0.5, 5.0, 0.1]))
    for i, beside in enumerate([[2, 3], [3, 4], [0, 4], [0, 1], [1, 2], []]):
        own = {i, *beside, *(j for j in range(6) if set(ids[j]) & set(ids[i]))}
        for j in range(6):
            at = np.arange(36.0).reshape(6, 2, 3) * 100.0
            at[j] = at[i] + [0.0, 0.1, 0.0]
            found = network.nearest(at, np.array([i]), 1.0, 1.0)[1][0]
            assert found == (-1 if j in own else j)


def test_borders_of_many_short_edges_take_memory_for_their_edges_only() -> None:
    """Ways are not enumerated, of which a tangle has thousands of millions, nor pairs of edges, of which a line of
    12,000 edges in less than a millimetre has 144 million."""
    tangle = np.array(list(combinations(range(9), 2)))
    at = np.random.default_rng(1).uniform(0.0, 0.1, (9, 3))[tangle]
    assert (Network(tangle, np.full(len(tangle), 0.01)).nearest(at, np.arange(36), 0.4, 1.2)[1] == -1).all()
    x = np.linspace(0.0, 0.9, 12_001)
    line = np.column_stack([np.arange(12_000), np.arange(1, 12_001)])
    at = np.zeros((12_000, 2, 3))
    at[:, 0, 0], at[:, 1, 0] = x[:-1], x[1:]
    tracemalloc.start()
    try:
        _, other = Network(line, np.full(12_000, 7.5e-5)).nearest(at, np.arange(0, 12_000, 400), 0.4, 1.2)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (other == -1).all() and most < 20e6


def test_without_edges_none_is_near() -> None:
    network = Network(np.zeros((0, 2), np.int64), np.zeros(0))
    distance, other = network.nearest(np.zeros((0, 2, 3)), np.zeros(0, np.int64), 1.0, 1.0)
    assert distance.shape == other.shape == (0,)
