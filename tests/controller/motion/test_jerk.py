"""The moving mean that keeps limits of jerk."""

from __future__ import annotations

import numpy as np
import pytest

from controller.motion.jerk import JerkFilter

A, J, DT = np.array([10.0, 10.0, 4.0]), np.array([200.0, np.inf, 1000.0]), 0.01


def bang_bang(seed: int, count: int, most: np.ndarray) -> np.ndarray:
    """(count, n) positions whose acceleration jumps between its ends."""
    push = np.random.default_rng(seed).choice([-1.0, 0.0, 1.0], (count, len(most))) * most
    return np.cumsum(np.cumsum(push, axis=0), axis=0) * DT**2


def filtered(path: np.ndarray, filter_: JerkFilter) -> np.ndarray:
    filter_.reset(np.zeros(path.shape[1]))
    return np.array([filter_.step(DT, row, np.zeros(path.shape[1])) for row in path])


def test_jerk_is_kept_strictly_and_nothing_else_is_broken() -> None:
    path = bang_bang(0, 5000, A)
    out = np.concatenate([np.zeros((3, 3)), filtered(path, JerkFilter(A, J))])
    first, second, third = (np.diff(out, n, axis=0) / DT**n for n in (1, 2, 3))
    assert np.all(np.abs(third).max(axis=0) <= J * (1 + 1e-6))
    assert np.abs(third)[:, 0].max() > 0.9 * J[0]  # the window is no longer than it has to be
    assert np.all(np.abs(second).max(axis=0) <= A * (1 + 1e-6))
    assert np.abs(first).max() <= np.abs(np.diff(path, axis=0) / DT).max() * (1 + 1e-9)


def test_no_limit_is_no_delay_and_a_limit_delays_by_half_its_window() -> None:
    line = np.arange(1, 400)[:, None] * np.ones(3)
    out = filtered(line, JerkFilter(A, J))
    np.testing.assert_allclose(out[:, 1], line[:, 1], rtol=1e-12)
    filter_ = JerkFilter(A, J)
    np.testing.assert_allclose((line - out)[-1] * DT, filter_.window_s / 2, atol=1e-9)
    assert filter_.window_s == pytest.approx([0.1, 0.0, 0.008])


def test_it_rests_where_the_values_rest() -> None:
    filter_ = JerkFilter(A, J)
    filter_.reset(np.full(3, 0.25))
    np.testing.assert_allclose(filter_.step(DT, np.full(3, 0.25), np.zeros(3)), 0.25, rtol=1e-12)
    for _ in range(20):
        out = filter_.step(DT, np.ones(3), np.zeros(3))
    np.testing.assert_allclose(out, 1.0, rtol=1e-12)


def test_steps_may_change_their_length() -> None:
    filter_ = JerkFilter(A, J)
    filter_.reset(np.zeros(3))
    out, before, place = np.zeros(3), np.zeros(3), 0.0
    for dt in np.random.default_rng(1).uniform(0.001, 0.03, 500):
        place += dt
        filter_.step(dt, np.full(3, place), out)
        assert np.all(out - before <= dt * (1 + 1e-9)) and np.all(out >= before)
        before = out.copy()
    np.testing.assert_allclose(place - out, filter_.window_s / 2, atol=1e-9)


def test_nothing_limited_is_not_active() -> None:
    assert not JerkFilter(A, np.full(3, np.inf)).active and JerkFilter(A, J).active
