"""drivers.core.limits: no target leaves the angle limits or asks for more than top speed, whatever comes in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import drivers.core.kernels  # noqa: F401  compiled code is loaded here and not within an example's deadline
from drivers.base.bus import BusReport, ServoSpec
from drivers.core.limits import BURST_S, TargetLimits

SPEED = np.array([2.0, 6.0])
LOW, HIGH = np.array([-9.0, -8.0]), np.array([8.0, 9.0])
angles = st.floats(-3.0, 3.0)
calls = st.lists(st.tuples(st.floats(0.0, 0.3), angles, angles), min_size=1, max_size=40)


def limits_at(position: list[float], now_s: float = 0.0) -> tuple[TargetLimits, BusReport]:
    servos = [ServoSpec(i, f"s{i}", "m", LOW[i], HIGH[i], SPEED[i], 50.0) for i in range(2)]
    report = BusReport()
    limits = TargetLimits(servos, report)
    limits.reset(np.array(position), now_s)
    return limits, report


def counts(report: BusReport) -> tuple[int, int, int]:
    return report.refused_targets, report.limits_hit, report.speed_limited


@given(calls)
def test_the_way_in_any_time_is_within_top_speed(steps: list[tuple[float, float, float]]) -> None:
    limits, _ = limits_at([0.0, 0.0], 10.0)
    now, times, path = 10.0, [10.0], [np.zeros(2)]
    for elapsed, *target in steps:
        now += elapsed
        path.append(limits.apply(np.array(target), now))
        times.append(now)
    for i in range(len(path)):
        for j in range(i + 1, len(path)):
            allowed = SPEED * (times[j] - times[i] + BURST_S) + 1e-9
            assert (np.abs(path[j] - path[i]) <= allowed).all()


@given(calls)
def test_a_step_never_goes_past_its_target(steps: list[tuple[float, float, float]]) -> None:
    limits, _ = limits_at([0.0, 0.0])
    now, last = 0.0, np.zeros(2)
    for elapsed, *wanted in steps:
        now += elapsed
        target = np.array(wanted)
        here = limits.apply(target, now)
        assert (np.minimum(last, target) - 1e-12 <= here).all()
        assert (here <= np.maximum(last, target) + 1e-12).all()
        last = here


def test_slow_targets_pass_unchanged() -> None:
    limits, report = limits_at([0.0, 0.0])
    for k in range(1, 150):
        target = 0.01 * k * 0.99 * SPEED
        np.testing.assert_allclose(limits.apply(target, 0.01 * k), target)
    assert counts(report) == (0, 0, 0)


def test_nothing_moves_without_time_and_a_clock_that_goes_back_counts_as_none() -> None:
    limits, report = limits_at([0.5, -0.5], 5.0)
    for now in (5.0, 4.0, 4.0):
        np.testing.assert_array_equal(limits.apply(np.full(2, 3.0), now), [0.5, -0.5])
    np.testing.assert_allclose(limits.apply(np.full(2, 3.0), 4.01), [0.5 + 0.01 * 2, -0.5 + 0.01 * 6])
    assert counts(report) == (0, 0, 8)


@pytest.mark.parametrize("calls_before", [0, 3])
def test_a_long_stall_saves_up_no_more_than_a_burst(calls_before: int) -> None:
    limits, _ = limits_at([0.0, 0.0])
    for k in range(calls_before):
        limits.apply(np.zeros(2), 20.0 * (k + 1))
    np.testing.assert_allclose(limits.apply(np.full(2, 3.0), 100.0), 0.05 * SPEED)
    np.testing.assert_allclose(limits.apply(np.full(2, -3.0), 100.0), 0.05 * SPEED)  # the budget is spent
    np.testing.assert_allclose(limits.apply(np.full(2, -3.0), 100.02), 0.03 * SPEED)


def test_one_servo_begins_again_by_itself() -> None:
    limits, _ = limits_at([0.0, 0.0])
    limits.apply(np.full(2, 0.1), 0.02)
    limits.reset_one(1, 2.0, 0.02)
    np.testing.assert_allclose(limits.apply(np.full(2, 0.1), 0.02), [0.04, 2.0])
    limits.reset_one(1, 3.0, 0.02)
    np.testing.assert_allclose(limits.apply(np.array([0.1, np.nan]), 0.02), [0.04, 3.0])


def test_the_travel_of_a_servo_that_begins_again_counts_from_that_moment() -> None:
    limits, _ = limits_at([0.0, 0.0])
    limits.apply(np.zeros(2), 1.0)
    limits.reset_one(1, 2.0, 1.03)
    np.testing.assert_allclose(limits.apply(np.full(2, 3.0), 1.04), [0.05 * SPEED[0], 2.0 + 0.01 * SPEED[1]])


def test_a_servo_that_is_not_driven_keeps_its_last_goal_wherever_that_is() -> None:
    limits, report = limits_at([0.0, 12.0])
    driven = np.array([True, False])
    for k in range(1, 4):
        sent = limits.apply(np.array([0.1, -3.0]), 0.02 * k, driven)
        assert sent[1] == 12.0
    assert sent[0] == pytest.approx(0.1) and counts(report)[1] == 0
    assert limits.apply(np.array([0.1, -3.0]), 0.08)[1] < 12.0


def test_targets_beyond_the_angle_limits_are_clipped_and_counted() -> None:
    limits, report = limits_at([7.99, -7.99])
    np.testing.assert_allclose(limits.apply(np.array([8.5, -8.5]), 1.0), [8.0, -8.0])
    np.testing.assert_array_equal(limits.target, [8.0, -8.0])
    assert counts(report) == (0, 2, 0)
    limits.apply(np.array([8.0, -8.0]), 2.0)  # the limits themselves are allowed
    assert counts(report) == (0, 2, 0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_target_that_is_no_number_keeps_the_last_one_and_is_counted(bad: float) -> None:
    limits, report = limits_at([0.0, 0.0])
    limits.apply(np.array([0.2, 0.01]), 0.05)
    np.testing.assert_allclose(limits.apply(np.array([bad, 0.02]), 0.1), [0.2, 0.02])  # the first goes on to 0.2
    assert counts(report) == (1, 0, 1)


def test_what_leaves_is_a_copy() -> None:
    limits, _ = limits_at([0.0, 0.0])
    limits.apply(np.ones(2), 0.01)[:] = 5.0
    np.testing.assert_allclose(limits.apply(np.zeros(2), 0.01), [0.02, 0.06])
