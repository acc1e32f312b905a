"""Hair behind a moving head: the spring against a numerical solution, and its rest."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from surface.head.model.sway import _DAMPING, _HZ, Sway, sway_moves


def test_a_step_rings_as_the_differential_equation_says():
    sway, own = Sway(), 2 * np.pi * _HZ
    sway.advance(np.zeros(3), 0.0)
    times = np.cumsum(np.random.default_rng(1).uniform(0.002, 0.04, 40))
    sway.advance(np.array([0.1, 0.0, -0.05]), times[0])
    got = [sway.lag.copy()]
    for t in times[1:]:
        sway.advance(np.array([0.1, 0.0, -0.05]), t)
        got.append(sway.lag.copy())

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -(own**2) * y[0] - 2 * _DAMPING * own * y[1]])

    solved = solve_ivp(motion, (0, times[-1]), [-0.1, 0.0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    np.testing.assert_allclose(np.array(got)[:, 0], solved, atol=1e-6)
    np.testing.assert_allclose(np.array(got)[:, 2], -0.5 * solved, atol=1e-6)
    assert not np.array(got)[:, 1].any()
    assert np.array(got)[:, 0].max() > 0.01  # it swings past


def test_it_comes_to_rest_and_a_pause_forgets_it():
    sway = Sway()
    sway.advance(np.zeros(3), 0.0)
    sway.advance(np.full(3, 0.1), 0.02)
    assert sway.lag.any()
    for k in range(200):
        sway.advance(np.full(3, 0.1), 0.04 + 0.02 * k)
    assert not sway.lag.any()
    sway.advance(np.zeros(3), 4.1)
    assert sway.lag.any()
    sway.advance(np.zeros(3), 60.0)
    assert not sway.lag.any()


def test_a_radian_about_each_axis_moves_what_sways():
    moves = sway_moves(np.array([[0.0, 10.0, 5.0], [1.0, 2.0, 3.0]]), np.array([1.0, 0.0]), (0.0, 0.0, 0.0))
    assert moves[:, 0].tolist() == [[5.0, 0.0, 0.0], [0.0, -5.0, 10.0], [-10.0, 0.0, 0.0]]
    assert not moves[:, 1].any()
    assert moves[0, 0] == pytest.approx(np.cross([0, 1, 0], [0, 10, 5]))
