"""Normal equations in compiled code: what dense algebra says, unsorted columns and empty rows too."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, random_array

from surface.fit.points.net import Net, coarse_places, net_at
from surface.fit.points.solve import basis, fairness, normal_equations, solve
from surface.fit.source.chart import Slopes


@pytest.mark.parametrize("m", [40, 5])
def test_normal_equations_are_those_of_dense_algebra(m):
    rng = np.random.default_rng(3)
    rows = random_array((m, 17), density=0.3, rng=rng).tocsr()
    rows.data -= 0.5
    dense, weight, targets = rows.toarray(), rng.random(m), rng.normal(size=(m, 4))
    for at, end in zip(rows.indptr, rows.indptr[1:], strict=False):  # as a product of matrices may leave them
        rows.indices[at:end], rows.data[at:end] = rows.indices[at:end][::-1].copy(), rows.data[at:end][::-1].copy()
    rows.has_sorted_indices = False
    matrix, right = normal_equations(rows, weight, targets)
    np.testing.assert_allclose(matrix, np.triu(dense.T @ np.diag(weight) @ dense), atol=1e-12)
    np.testing.assert_allclose(right, dense.T @ (weight[:, None] * targets), atol=1e-12)


UV = np.random.default_rng(8).random((400, 2))


@pytest.fixture(scope="module")
def net() -> Net:
    return net_at(coarse_places(UV, 0.25), 0.25, [], UV)


def test_a_surface_of_the_net_is_found_again(net):
    points = np.random.default_rng(9).normal(size=(len(net), 4))
    b = basis(net, UV)
    np.testing.assert_allclose(b.sum(axis=1), 1.0)
    x = solve(net, b, np.ones(len(UV)), b @ points, 1e-12)
    np.testing.assert_allclose(b @ x, b @ points, atol=1e-3)


def test_samples_count_by_their_weight(net):
    twice, weight = np.vstack([UV, UV]), np.concatenate([np.full(len(UV), 3.0), np.ones(len(UV))])
    targets = np.concatenate([np.zeros(len(UV)), np.full(len(UV), 8.0)])[:, None]
    b = basis(net, twice)
    np.testing.assert_allclose(b @ solve(net, b, weight, targets, 1e-9), 2.0, atol=1e-3)


def test_fairness_leaves_linear_surfaces_and_damps_others(net):
    flat = np.column_stack([np.ones(len(net)), basis(net, net.centres) @ np.ones(len(net))])
    np.testing.assert_allclose(fairness(net) @ flat, 0.0, atol=1e-12)
    wave = np.random.default_rng(2).normal(size=(len(UV), 1))
    b = basis(net, UV)
    rough, smooth = (solve(net, b, np.ones(len(UV)), wave, fair) for fair in (1e-9, 10.0))
    assert np.abs(fairness(net) @ smooth).max() < 0.2 * np.abs(fairness(net) @ rough).max()


def test_slopes_are_matched_besides_positions(net):
    b, at = basis(net, UV), np.array([[0.3, 0.4], [0.6, 0.7], [0.5, 0.2]])
    span, none = np.full((3, 2), [0.1, 0.2]), csr_matrix((3, 1))
    wanted = np.array([[5.0]] * 3), np.array([[-3.0]] * 3)
    slopes = Slopes(at, span, none, none, np.full(3, 1e5)), *wanted
    x = solve(net, b, np.ones(len(UV)), np.zeros((len(UV), 1)), 1e-9, slopes)
    step = 1e-5
    for axis, target in enumerate(wanted):
        d = step * np.eye(2)[axis]
        slope = (basis(net, at + d) - basis(net, at - d)) @ x / (2 * step) * span[0, axis]
        np.testing.assert_allclose(slope, target, rtol=0.02)


PER_FACE = np.where(np.arange(30) < 15, 0.0, 0.9)


@pytest.mark.parametrize(
    ("sloped", "bend", "turned"),
    [(False, 0.0, False), (True, 0.0, False), (True, 0.6, False), (True, 0.6, True), (True, PER_FACE, True)],
)
def test_the_solution_is_that_of_the_functional(net, sloped, bend, turned):
    """Dense algebra over the documented sum, with derivatives by central differences."""
    rng, fair = np.random.default_rng(5), 0.3
    uv = np.vstack([UV, rng.random((2000, 2)) * 0.98 + 0.01])
    weight, targets = rng.uniform(0.5, 3.0, len(uv)), rng.normal(size=(len(uv), 2))
    b, f = basis(net, uv), fairness(net).toarray()
    dense = b.toarray()
    strength = weight.sum() / len(net)
    normal = dense.T @ (weight[:, None] * dense) + fair * strength * f.T @ f
    right = dense.T @ (weight[:, None] * targets)
    slopes = turns = None
    if sloped:
        at, none = rng.random((30, 2)) * 0.9 + 0.05, csr_matrix((30, 1))
        span, heavy = rng.uniform(0.05, 0.2, (30, 2)), rng.uniform(50.0, 200.0, 30)
        wanted = rng.normal(size=(2, 30, 2))
        corners = at[:, None] + rng.uniform(-0.04, 0.04, (30, 4, 2))
        slopes = Slopes(at, span, none, none, heavy, corners), *wanted
        turns = (rng.normal(size=(120, 2)), rng.normal(size=(120, 2))) if turned else None
        for axis in range(2):
            d = 1e-5 * np.eye(2)[axis]

            def slope(at, d=d, axis=axis):
                return ((basis(net, at + d) - basis(net, at - d)) / 2e-5).toarray() * span[:, axis, None]

            rows = slope(at)
            normal += rows.T @ (heavy[:, None] * rows)
            right += rows.T @ (heavy[:, None] * wanted[axis])
            for k in range(4):
                bent = slope(0.5 * (at + corners[:, k])) - rows
                normal += bent.T @ ((bend * heavy)[:, None] * bent)
                if turns is not None:
                    right += bent.T @ ((bend * heavy)[:, None] * turns[axis][k::4])
    x = solve(net, b, weight, targets, fair, slopes, bend, turns)
    np.testing.assert_allclose(x, np.linalg.solve(normal, right), atol=2e-4)


def test_a_net_with_more_points_than_samples_reach_is_solved(net):
    few = basis(net, UV[:3])
    x = solve(net, few, np.ones(3), np.full((3, 1), 2.0), 0.0)
    assert np.isfinite(x).all()
    np.testing.assert_allclose(few @ x, 2.0, rtol=1e-3)


def test_the_unit_of_weights_says_nothing(net):
    b, targets = basis(net, UV), np.random.default_rng(1).normal(size=(len(UV), 2))
    one, other = (solve(net, b, np.full(len(UV), unit), targets, 1e-3) for unit in (1.0, 1e-8))
    np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-6)
