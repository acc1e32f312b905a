"""drivers.core.scale: steps of real servos and the angles, speeds and limits they mean."""

from __future__ import annotations

import math

import numpy as np
import pytest

import drivers.core.kernels  # noqa: F401  compiled code is loaded here
from drivers.base.bus import ServoSpec
from drivers.core.scale import Scale
from drivers.tables.tables import load_table

STEP = math.tau / 4096
"""Of an XL330; its middle is 2048 (e-Manual)."""


def scale(*servos: ServoSpec) -> Scale:
    return Scale(servos, [load_table(servo.model) for servo in servos])


def spec(low: float = -1.0, high: float = 1.0, **changes: object) -> ServoSpec:
    return ServoSpec(1, "jaw", str(changes.pop("model", "xl330-m288")), low, high, 5.0, 50.0, **changes)  # type: ignore[arg-type]


def goals(of: Scale, angles: list[float], before: list[int]) -> tuple[list[int], list[float]]:
    steps = np.array(before, np.int32)
    sent = of.goals(np.array(angles), steps)
    return steps.tolist(), sent.tolist()


def test_angles_become_the_nearest_steps_and_come_back() -> None:
    both = scale(spec(), spec(reverse=True), spec(zero_rad=100 * STEP))
    steps, sent = goals(both, [300.4 * STEP, 300.6 * STEP, -50 * STEP], [2048] * 3)
    assert steps == [2348, 1747, 2098]
    assert sent == pytest.approx([300 * STEP, 301 * STEP, -50 * STEP])


def test_goals_end_at_the_angle_limits() -> None:
    both = scale(spec(-100 * STEP, 200 * STEP), spec(-100 * STEP, 200 * STEP, reverse=True))
    assert both.low.tolist() == [1948, 1848]
    assert both.high.tolist() == [2248, 2148]
    assert goals(both, [1.0, 1.0], [2048, 2048])[0] == [2248, 1848]
    assert goals(both, [-1.0, -1.0], [2048, 2048])[0] == [1948, 2148]


def test_limits_between_two_steps_are_rounded_inwards() -> None:
    both = scale(spec(-100.5 * STEP, 200.5 * STEP))
    assert (both.low.tolist(), both.high.tolist()) == ([1948], [2248])


def test_goals_never_leave_the_turn_of_the_servo() -> None:
    wide = scale(spec(-4.0, 4.0), spec(-4.0, 4.0, model="xl320"))
    assert wide.low.tolist() == [0, 0]
    assert wide.high.tolist() == [4095, 1023]
    assert wide.highest.tolist() == [4095, 1023]
    assert goals(wide, [4.0, 4.0], [2048, 512])[0] == [4095, 1023]
    assert goals(wide, [-4.0, -4.0], [2048, 512])[0] == [0, 0]


def test_a_goal_outside_the_limits_may_only_come_nearer() -> None:
    one = scale(spec(-100 * STEP, 100 * STEP))
    for wanted, before, after in (
        (300, 2300, 2300),  # it stays where it is
        (200, 2300, 2248),  # and comes nearer as far as it is asked to
        (0, 2300, 2048),
        (400, 2300, 2300),  # no further out
        (-300, 1800, 1800),
        (-200, 1800, 1848),
        (-400, 1800, 1800),
    ):
        assert goals(one, [wanted * STEP], [before])[0] == [after]


def test_registers_of_the_servo_are_limits_that_nothing_passes() -> None:
    one = scale(spec(-100 * STEP, 100 * STEP))
    one.narrow(0, 2000, 2100)
    assert (one.lowest[0], one.low[0], one.high[0], one.highest[0]) == (2000, 2000, 2100, 2100)
    assert goals(one, [1.0], [2048])[0] == [2100]
    assert goals(one, [-1.0], [2048])[0] == [2000]
    assert goals(one, [1.0], [2300])[0] == [2100]  # outside its own registers it takes no goal
    assert goals(one, [-1.0], [1500])[0] == [2000]
    one.narrow(0, 1500, 2600)
    assert (one.low[0], one.high[0]) == (2000, 2100)
    one.narrow(0, 100, 200)
    assert (one.low[0], one.high[0]) == (200, 200)


def test_measurements_have_the_sign_of_the_angle() -> None:
    both = scale(spec(), spec(reverse=True, zero_rad=10 * STEP))
    known = np.array([[2148.0, 1948.0], [2.5, 2.5], [-0.1, -0.1], [7.0, 8.5]])
    angle, speed, current, age = both.measured(known, 10.0)
    np.testing.assert_allclose(angle, [100 * STEP, 110 * STEP])
    np.testing.assert_allclose(speed, [2.5, -2.5])
    np.testing.assert_allclose(current, [-0.1, 0.1])
    np.testing.assert_allclose(age, [3.0, 1.5])


def test_angles_of_steps_without_limits() -> None:
    both = scale(spec(), spec(reverse=True, zero_rad=10 * STEP), spec(model="xl320"))
    np.testing.assert_allclose(
        both.radians(np.array([2148, 2148, 512 + 150])), [100 * STEP, -90 * STEP, math.radians(150 * 300 / 1024)]
    )
    np.testing.assert_array_equal(both.ticks(np.array([9.0, 100 * STEP, 0.0])), [2048 + 5867, 1958, 512])
