"""drivers.core.speed_limit: nothing asks a servo for more than its top speed, whatever comes in."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.speed_limit import BURST_S, SpeedLimiter

SPEED = np.array([2.0, 6.0])
angles = st.floats(-3.0, 3.0)
calls = st.lists(st.tuples(st.floats(0.0, 0.3), angles, angles), min_size=1, max_size=40)


@given(calls)
def test_the_way_in_any_time_is_within_top_speed(steps: list[tuple[float, float, float]]) -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.zeros(2), 10.0)
    now, times, path = 10.0, [10.0], [np.zeros(2)]
    for elapsed, *target in steps:
        now += elapsed
        path.append(guard.step(np.array(target), now))
        times.append(now)
    for i in range(len(path)):
        for j in range(i + 1, len(path)):
            allowed = SPEED * (times[j] - times[i] + BURST_S) + 1e-9
            assert (np.abs(path[j] - path[i]) <= allowed).all()


@given(calls)
def test_a_step_never_goes_past_its_target(steps: list[tuple[float, float, float]]) -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.zeros(2), 0.0)
    now, last = 0.0, np.zeros(2)
    for elapsed, *wanted in steps:
        now += elapsed
        target = np.array(wanted)
        here = guard.step(target, now)
        assert (np.minimum(last, target) - 1e-12 <= here).all()
        assert (here <= np.maximum(last, target) + 1e-12).all()
        last = here


def test_slow_targets_pass_unchanged() -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.zeros(2), 0.0)
    for k in range(1, 200):
        target = 0.01 * k * 0.99 * SPEED
        np.testing.assert_allclose(guard.step(target, 0.01 * k), target)


def test_nothing_moves_without_time_and_a_clock_that_goes_back_counts_as_none() -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.array([0.5, -0.5]), 5.0)
    for now in (5.0, 4.0, 4.0):
        np.testing.assert_array_equal(guard.step(np.full(2, 3.0), now), [0.5, -0.5])


def test_a_long_stall_saves_up_no_burst() -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.zeros(2), 0.0)
    np.testing.assert_allclose(guard.step(np.full(2, 3.0), 100.0), BURST_S * SPEED)


def test_one_servo_begins_again_by_itself() -> None:
    guard = SpeedLimiter(SPEED)
    guard.reset(np.zeros(2), 0.0)
    guard.step(np.full(2, 0.1), 0.02)
    guard.reset_one(1, 2.0)
    np.testing.assert_allclose(guard.step(np.full(2, 0.1), 0.02), [0.04, 2.0])
