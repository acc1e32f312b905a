"""Bounded least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from controller.base.solve import BoundedSolver, _newton_step, _solve, _step_fraction


def problem(seed: int, m: int = 150, n: int = 52) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(m, n))
    low = np.where(random.random(n) < 0.2, -1.0, 0.0)
    truth = random.uniform(low, 1.0) * (random.random(n) < 0.6)
    return matrix, low, np.ones(n), matrix @ truth + 0.3 * random.normal(size=m)


@pytest.mark.parametrize("seed", range(5))
def test_agrees_with_scipy(seed: int) -> None:
    matrix, low, high, wanted = problem(seed)
    solver = BoundedSolver(matrix, low, high, ridge=0.0, tolerance=1e-12)
    np.testing.assert_allclose(solver.solve(wanted), lsq_linear(matrix, wanted, (low, high), tol=1e-13).x, atol=1e-7)


def test_the_optimality_conditions_hold_with_ridge_weights_and_sparsity() -> None:
    matrix, low, high, wanted = problem(9)
    weights = np.random.default_rng(1).uniform(0.1, 2.0, len(wanted))
    solver = BoundedSolver(matrix, low, high, weights=weights, ridge=0.5, sparsity=8.0, tolerance=1e-12)
    x = solver.solve(wanted)
    slope = matrix.T @ (weights**2 * (matrix @ x - wanted)) + 0.5 * x
    inside = (x > low + 1e-9) & (x < high - 1e-9) & (np.abs(x) > 1e-9)
    np.testing.assert_allclose(slope[inside] + 8.0 * np.sign(x[inside]), 0.0, atol=1e-6)
    assert np.all(slope[x >= high - 1e-12] + 8.0 <= 1e-6)
    zero = np.abs(x) <= 1e-9
    assert np.all(slope[zero] >= -8.0 - 1e-6) and zero.sum() > 5


def test_starting_from_the_last_solution_takes_no_more_rounds() -> None:
    matrix, low, high, wanted = problem(2)
    solver = BoundedSolver(matrix, low, high)
    first = solver.solve(wanted)
    cold = solver.rounds
    again = solver.solve(wanted + 1e-3, start=first)
    assert solver.rounds <= cold
    np.testing.assert_allclose(again, solver.solve(wanted + 1e-3), atol=1e-5)


def test_rows_that_say_nothing_leave_zero_and_bounds_hold() -> None:
    matrix = np.array([[1.0, 0.0], [0.0, 0.0]])
    solver = BoundedSolver(matrix, np.zeros(2), np.ones(2), ridge=0.0)
    np.testing.assert_array_equal(solver.solve(np.array([5.0, 1.0])), [1.0, 0.0])


def test_columns_that_are_alike_are_settled() -> None:
    random = np.random.default_rng(4)
    matrix = random.normal(size=(60, 20))
    matrix[:, 10:] = matrix[:, :10] + 1e-4 * random.normal(size=(60, 10))
    wanted = matrix @ random.uniform(0, 1, 20)
    solver = BoundedSolver(matrix, np.zeros(20), np.ones(20))
    assert np.abs(wanted - matrix @ solver.solve(wanted)).max() < 5e-4
    matrix[:, 10:] = matrix[:, :10]
    same = BoundedSolver(matrix, np.zeros(20), np.ones(20), ridge=0.0)
    wanted = matrix @ np.full(20, 0.5)
    assert np.abs(wanted - matrix @ same.solve(wanted)).max() < 1e-6


def test_wrong_arguments_are_named() -> None:
    one = np.eye(2)
    with pytest.raises(ValueError, match="weights must be"):
        BoundedSolver(one, np.zeros(2), np.ones(2), weights=np.ones(3))
    with pytest.raises(ValueError, match="low must not be above high"):
        BoundedSolver(one, np.ones(2), np.zeros(2))
    with pytest.raises(ValueError, match="finite"):
        BoundedSolver(one * np.nan, np.zeros(2), np.ones(2))
    with pytest.raises(ValueError, match="wanted must be finite"):
        BoundedSolver(one, np.zeros(2), np.ones(2)).solve(np.array([np.nan, 0.0]))


def test_rounds_are_few_and_one_from_the_solution_itself() -> None:
    rounds = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        matrix = random.normal(size=(60, 20))
        matrix[:, 10:] = matrix[:, :10] + 1e-4 * random.normal(size=(60, 10))
        solver = BoundedSolver(matrix, -np.ones(20), np.ones(20), sparsity=0.01)
        wanted = matrix @ random.uniform(-1, 1, 20)
        found = solver.solve(wanted)
        rounds.append(solver.rounds)
        np.testing.assert_allclose(solver.solve(wanted, found), found, atol=1e-7)
        assert solver.rounds == 1
    assert max(rounds) < 200 and min(rounds) < 30, rounds  # one value at a time would take thousands of them
    plain = BoundedSolver(np.eye(3), np.zeros(3), np.ones(3), ridge=0.0)
    np.testing.assert_allclose(plain.solve(np.array([0.25, 2.0, -1.0])), [0.25, 1.0, 0.0], atol=1e-9)
    assert plain.rounds == 2


def test_values_without_a_start_begin_at_the_nearest_bound() -> None:
    solver = BoundedSolver(np.zeros((1, 2)), np.array([0.25, -1.0]), np.array([0.5, -0.5]))
    np.testing.assert_allclose(solver.solve(np.zeros(1)), [0.25, -0.5])
    np.testing.assert_allclose(solver.solve(np.zeros(1), np.array([9.0, -9.0])), [0.25, -0.5])


def test_the_ridge_decides_what_rows_leave_open() -> None:
    one = np.array([[2.0]])
    for ridge, value in ((0.0, 0.5), (4.0, 0.25), (12.0, 0.125)):
        solver = BoundedSolver(one, -np.ones(1), np.ones(1), ridge=ridge, tolerance=1e-12)
        assert solver.solve(np.array([1.0])) == pytest.approx([value], abs=1e-9)
    for sparsity, value in ((1.0, 0.25), (2.0, 0.0), (3.0, 0.0)):
        solver = BoundedSolver(one, -np.ones(1), np.ones(1), sparsity=sparsity, tolerance=1e-12)
        assert solver.solve(np.array([1.0])) == pytest.approx([value], abs=1e-8)
        assert solver.solve(np.array([-1.0])) == pytest.approx([-value], abs=1e-8)


@pytest.mark.parametrize(
    ("x", "step", "low", "high", "share"),
    [
        (0.5, 0.25, 0.0, 1.0, 1.0),  # ends inside
        (0.5, 0.5, 0.0, 1.0, 1.0),  # ends on the bound
        (0.5, 1.0, 0.0, 1.0, 0.5),  # would pass the upper bound
        (0.5, -1.0, -1.0, 1.0, 0.5),  # would pass zero from above
        (0.5, -0.5, -1.0, 1.0, 1.0),
        (0.5, -0.5, 0.25, 1.0, 0.5),  # the lower bound comes before zero
        (-0.5, -1.0, -1.0, 1.0, 0.5),  # would pass the lower bound
        (-0.5, 1.0, -1.0, 1.0, 0.5),  # would pass zero from below
        (-0.5, 0.25, -1.0, 1.0, 1.0),
        (-0.5, 0.5, -1.0, -0.25, 0.5),  # the upper bound comes before zero
        (2.0, -4.0, -3.0, 3.0, 0.5),
        (-2.0, 4.0, -3.0, 3.0, 0.5),
        (0.0, 2.0, -1.0, 1.0, 0.5),  # from zero, any way is free up to the bound
        (0.0, -2.0, -1.0, 1.0, 0.5),
        (0.5, 0.0, 0.0, 1.0, 1.0),
    ],
)
def test_a_step_ends_at_a_bound_and_at_zero(x: float, step: float, low: float, high: float, share: float) -> None:
    assert _step_fraction(x, step, low, high) == share


def test_linear_systems_are_solved_with_every_sign_and_order_of_rows() -> None:
    random = np.random.default_rng(5)
    for n in (1, 2, 3, 5):
        for _ in range(40):
            matrix = random.integers(-2, 3, (n, n)).astype(float)  # many zeros, ones and equal rows
            if abs(np.linalg.det(matrix)) < 0.5:
                continue
            right = random.normal(size=n)
            found = right.copy()
            _solve(matrix.copy(), found)
            np.testing.assert_allclose(matrix @ found, right, atol=1e-9)
    with pytest.raises(ValueError, match="do not determine each other"):
        _solve(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))


def test_a_value_that_newtons_step_brings_to_zero_is_exactly_zero() -> None:
    for x in np.linspace(0.1, 0.9, 50):
        for sign in (-1.0, 1.0):
            values = np.array([sign * x])
            _newton_step(np.eye(1), 3.3 * values, -np.ones(1), np.ones(1), 0.0, values)
            assert values[0] == 0.0


def test_values_at_a_bound_or_at_zero_stay_in_newtons_step() -> None:
    x = np.array([-1.0, 1.0, 0.0, 0.5, -0.5])
    _newton_step(np.eye(5), np.full(5, 0.125), -np.ones(5), np.ones(5), 0.0, x)
    np.testing.assert_array_equal(x, [-1.0, 1.0, 0.0, 0.375, -0.625])
    x = np.array([0.5, -0.5])
    _newton_step(np.eye(2), np.zeros(2), -np.ones(2), np.ones(2), 0.125, x)  # sparsity pulls both to zero
    np.testing.assert_array_equal(x, [0.375, -0.375])


def test_the_least_ridge_is_relative_to_the_columns_but_not_below_that_of_ones() -> None:
    small = BoundedSolver(np.array([[1e-6]]), -np.full(1, 1e9), np.full(1, 1e9), ridge=0.0)
    assert small.solve(np.ones(1)) == pytest.approx([1e-6 / 2e-12])
    large = BoundedSolver(np.diag([2e6, 1.0]), -np.full(2, 9.0), np.full(2, 9.0), ridge=0.0)
    assert large.solve(np.ones(2))[1] == pytest.approx(1 / (1 + 1e-12 * (4e12 + 1) / 2))
    assert BoundedSolver(np.ones((1, 1)), np.zeros(1), np.ones(1)).solve(np.full(1, 0.5)) == pytest.approx([0.5])


def test_the_rounds_are_limited() -> None:
    matrix, low, high, wanted = problem(3)
    solver = BoundedSolver(matrix, low, high, tolerance=0.0)
    solver.solve(wanted)
    assert solver.rounds == 200
    solver.solve(np.zeros(len(wanted)))
    assert solver.rounds == 200  # no change is less than none
