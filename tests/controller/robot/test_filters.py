"""Smoothing, slow start and limits by temperature of channels, in computed time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.links.net.one_euro import OneEuro
from controller.robot.filters import TargetFilter
from controller.robot.idle_torque import IdleTorqueOff
from controller.robot.safety import GoalFilter
from controller.robot.settings import ChannelSettings, HeatRule, RuleSettings, SmoothSettings
from drivers.base.bus import BusState

DT = 0.01


def channel(name: str = "a", **changes: Any) -> ChannelSettings:
    keys = {
        "name": name, "bus": "b", "id": 1, "model": "xl330-m288", "mix": {"headYaw": 1.0},
        "map": {"at": [-1, 1], "deg": [-40, 40]}, "limit_deg": (-40, 40), "max_speed_deg_s": 200,
        "max_accel_deg_s2": 4000,
    }  # fmt: skip
    return ChannelSettings.model_validate(keys | changes)


def state(celsius: float, amperes: float = 0.0, rad: float = 0.0) -> BusState:
    none, yes, no, zeros = np.array([np.nan]), np.array([True]), np.array([False]), np.zeros(1, np.uint8)
    at, current, warm = np.array([rad]), np.array([amperes]), np.array([celsius])
    return BusState(0.0, at, none, current, yes, np.zeros(1), zeros, no, none, warm, zeros, yes)


def moved(goals: GoalFilter, deg: float, seconds: float, measured: BusState | None = None) -> np.ndarray:
    """(k,) degrees of each cycle towards a target."""
    wanted = np.radians([deg])
    return np.degrees([goals.step(wanted, measured, DT)[0] for _ in range(round(seconds / DT))])


def test_a_moving_average_is_the_mean_of_its_time() -> None:
    smooth = TargetFilter([channel(smooth=SmoothSettings(average_s=0.05)), channel()])
    rng = np.random.default_rng(1)
    asked = rng.normal(size=(60, 2))
    given = np.array([smooth.apply(row, DT) for row in asked])
    for k in range(10, 60):
        assert given[k, 0] == pytest.approx(asked[k - 4 : k + 1, 0].mean())
    assert np.array_equal(given[:, 1], asked[:, 1])  # a channel without one


def test_one_euro_is_the_filter_of_the_links() -> None:
    """That one was written against the authors' own program; here it works in degrees."""
    smooth = TargetFilter([channel(smooth=SmoothSettings(min_cutoff_hz=1.5, beta=0.05))])
    other = OneEuro(1, 1.5, 0.05)
    rng = np.random.default_rng(2)
    for k, asked in enumerate(np.cumsum(rng.normal(scale=2.0, size=80))):
        expected = other(np.array([asked]), 1.0 + k * DT)
        assert np.degrees(smooth.apply(np.radians([asked]), DT)) == pytest.approx(expected, abs=1e-6)


def test_what_is_no_number_passes_and_leaves_no_trace() -> None:
    smooth = TargetFilter([channel(smooth=SmoothSettings(average_s=0.05))])
    for _ in range(8):
        smooth.apply(np.array([0.5]), DT)
    assert np.isnan(smooth.apply(np.array([np.nan]), DT)).all()
    assert smooth.apply(np.array([0.5]), DT) == pytest.approx([0.5])


@pytest.mark.parametrize("smooth", [{"average_s": 0.1}, {"min_cutoff_hz": 2.0, "beta": 0.1}])
def test_limits_come_after_the_filter(smooth: dict[str, float]) -> None:
    goals = GoalFilter([channel(smooth=smooth, limit_deg=(-20, 20), map={"at": [-1, 1], "deg": [-20, 20]})], P,
                       RuleSettings(), DT)  # fmt: skip
    path = np.concatenate([moved(goals, deg, 0.4) for deg in (80.0, -80.0, 80.0)])
    assert np.abs(path).max() <= 20.0 + 1e-9
    assert np.abs(np.diff(path)).max() <= 200 * DT + 1e-9
    assert np.abs(np.diff(path, 2)).max() <= 4000 * DT**2 + 1e-6


def test_a_smoothed_channel_still_arrives() -> None:
    goals = GoalFilter([channel(smooth={"average_s": 0.1})], P, RuleSettings(), DT)
    assert moved(goals, 30.0, 1.0)[-1] == pytest.approx(30.0)


def test_a_slow_start_begins_slowly_and_again_after_a_restart() -> None:
    goals = GoalFilter([channel(slow_start_s=1.0)], P, RuleSettings(), DT)
    quick = GoalFilter([channel()], P, RuleSettings(), DT)
    for _ in range(2):
        goals.restart(np.radians([-40.0]))
        path = moved(goals, 40.0, 1.5)
        speeds = np.abs(np.diff(path)) / DT
        assert speeds[:10].max() <= 200 * 0.12
        assert speeds.max() <= 200 + 1e-6
        for k, speed in enumerate(speeds):
            assert speed <= 200 * min(1.0, max(0.05, (k + 2) * DT)) + 1e-6
        assert path[-1] == pytest.approx(40.0)
    quick.restart(np.radians([-40.0]))
    assert np.abs(np.diff(moved(quick, 40.0, 0.2))).max() / DT == pytest.approx(200, rel=0.01)


def heated(**changes: float) -> GoalFilter:
    rule = HeatRule.model_validate({"channels": ["a"], "above_c": 50, "full_c": 60, **changes})
    return GoalFilter([channel()], P, RuleSettings(heat=[rule]), DT)


@pytest.mark.parametrize(("celsius", "reach"), [(20.0, 40.0), (50.0, 40.0), (55.0, 30.0), (60.0, 20.0), (90.0, 20.0)])
def test_a_warm_servo_moves_less_far(celsius: float, reach: float) -> None:
    goals = heated()
    path = moved(goals, 40.0, 4.0, state(celsius))
    assert path[-1] == pytest.approx(reach, abs=0.01)
    assert moved(goals, -40.0, 2.0, state(celsius))[-1] == pytest.approx(-reach, abs=0.01)
    rules = [row["rule"] for row in goals.guard.report()]
    assert rules == ([] if celsius <= 50.0 else ["heat a"])


def test_it_moves_more_slowly_too_and_without_a_jump() -> None:
    goals = heated(range=1.0, speed=0.25)
    moved(goals, -40.0, 1.0, state(20.0))
    moved(goals, -40.0, 3.0, state(60.0))
    path = moved(goals, 40.0, 3.0, state(60.0))
    assert np.abs(np.diff(path)).max() / DT == pytest.approx(50.0, rel=0.01)
    goals = heated()
    moved(goals, 40.0, 1.0, state(20.0))
    path = moved(goals, 40.0, 4.0, state(60.0))  # it gives way from where it is
    assert np.abs(np.diff(path)).max() / DT <= 25.0
    assert moved(goals, 40.0, 4.0, state(20.0))[-1] == pytest.approx(40.0)


def test_a_temperature_that_is_not_known_changes_nothing() -> None:
    goals = heated()
    assert moved(goals, 40.0, 2.0, state(np.nan))[-1] == pytest.approx(40.0)
    moved(goals, 40.0, 4.0, state(60.0))
    assert moved(goals, 40.0, 1.0, state(np.nan))[-1] == pytest.approx(20.0, abs=0.01)


@pytest.mark.parametrize("keys", [{}, {"average_s": 0.1, "min_cutoff_hz": 1.0}, {"average_s": 0.1, "beta": 1.0}])
def test_a_filter_is_one_thing(keys: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"needs either|beta goes with"):
        SmoothSettings.model_validate(keys)


@pytest.mark.parametrize(("measured", "let_go"), [
    (state(30.0, 0.01), True), (state(30.0, -0.01), True), (state(30.0, 0.2), False), (state(30.0, -0.2), False),
    (state(30.0, np.nan), False), (state(30.0, 0.01, 0.2), False), (None, False),
])  # fmt: skip
def test_only_what_is_still_and_unloaded_for_certain_is_let_go(measured: BusState | None, let_go: bool) -> None:
    idle = IdleTorqueOff(1.0, 0.05)
    found = [idle.update(np.zeros(1), measured, 0.1) for _ in range(15)]
    assert any(found) == let_go
    assert not any(found[:9])
    assert not any(IdleTorqueOff(0.0, 0.05).update(np.zeros(1), measured, 0.1) for _ in range(15))
