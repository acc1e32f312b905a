"""controller.hardware.moving: how far, along and how late a shaft went, and why a movement ends, on made-up buses.

The buses here answer by formula, so that what must be measured is known; tests/controller/hardware/test_preflight.py
runs the same on simulated servos.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.hardware.moving import MAX_LEAD_RAD, PERIOD_S, STALE_S, NotMoved, Sampler, move_a_little
from drivers.base.bus import BusState

DEG = math.radians(1.0)


class FormulaBus:
    """One servo that follows its goals ``delay`` samples later, by ``gain`` times their way.

    change : called with each state before it is given out.
    """

    def __init__(self, delay: int = 0, gain: float = 1.0, change: Any = None) -> None:
        self.goals = [0.0] * (delay + 1)
        self.delay, self.gain, self.change, self.reads = delay, gain, change, 0
        self.sent: list[float] = []

    def write(self, goals: list[float]) -> np.ndarray:
        goal = self.goals[-1] if math.isnan(goals[0]) else goals[0]
        self.goals.append(goal)
        self.sent.append(goal)
        return np.array([goal])

    def read(self) -> BusState:
        self.reads += 1
        one = np.ones(1)
        position = self.gain * self.goals[-1 - self.delay]
        state = BusState(
            time_s=0.0, position_rad=position * one, velocity_rad_s=0 * one, current_a=0.1 * one, voltage_v=11.0 * one,
            temperature_c=30 * one, hardware_error=np.zeros(1, int), error=np.zeros(1, int), torque=np.ones(1, bool),
            fresh=np.ones(1, bool), silent=np.zeros(1, bool), age_s=0 * one,
        )  # fmt: skip
        return state if self.change is None else self.change(self.reads, state)


def sampler(bus: FormulaBus, load: float = 0.5) -> Sampler:
    """Time passes only where the sampler waits."""
    now = SimpleNamespace(s=0.0)

    def sleep(span_s: float) -> None:
        now.s += span_s

    return Sampler(bus, load, 1.0, sleep, lambda: now.s)  # type: ignore[arg-type]


def moved(bus: FormulaBus, load: float = 0.5, low: float = -1.0, high: float = 1.0) -> Any:
    return move_a_little(sampler(bus, load), 5 * DEG, 30 * DEG, low, high)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_what_a_shaft_did_is_measured(delay: int) -> None:
    found = moved(FormulaBus(delay))
    assert found.wanted_rad == pytest.approx(10 * DEG)
    assert found.moved_rad == pytest.approx(10 * DEG, abs=0.6 * DEG)
    assert found.along > 0.0
    assert delay * PERIOD_S <= found.lag_s <= (delay + 1) * PERIOD_S  # it reads a period after it sends
    assert (found.peak_current_a, found.peak_load, found.least_voltage_v) == pytest.approx((0.1, 0.1, 11.0))


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("reading_s", [0.002, 0.016])
def test_a_delay_is_measured_however_long_reading_takes(delay_s: float, reading_s: float) -> None:
    """16 ms are the latency timer of a common adapter."""
    now, bus = SimpleNamespace(s=0.0), FormulaBus()
    sent: list[tuple[float, float]] = []

    def write(goals: list[float]) -> np.ndarray:
        goal = FormulaBus.write(bus, goals)
        sent.append((now.s, float(goal[0])))
        return goal

    def delay(reads: int, state: BusState) -> BusState:
        now.s += reading_s
        position = next((goal for at_s, goal in reversed(sent) if at_s <= now.s - delay_s), 0.0)
        return replace(state, position_rad=np.array([position]))

    bus.change, bus.write = delay, write  # type: ignore[method-assign]

    def sleep(span_s: float) -> None:
        now.s += span_s

    slow = Sampler(bus, 0.5, 1.0, sleep, lambda: now.s)  # type: ignore[arg-type]
    found = move_a_little(slow, 5 * DEG, 5 * DEG, -1.0, 1.0)
    assert found.lag_s == pytest.approx(delay_s, abs=PERIOD_S)
    assert found.along > 0.0


def test_a_servo_that_runs_away_from_its_goals_is_stopped_and_said_to_go_the_other_way() -> None:
    with pytest.raises(NotMoved, match=r"2\.6 degrees behind") as caught:
        moved(FormulaBus(gain=-0.1))
    assert caught.value.moved.along < 0.0


def test_goals_stay_inside_both_limits_and_end_where_they_began() -> None:
    bus = FormulaBus()
    moved(bus, low=-2 * DEG, high=4 * DEG)
    assert max(bus.sent) == pytest.approx(4 * DEG)
    assert min(bus.sent) == pytest.approx(-2 * DEG)
    assert bus.sent[-1] == pytest.approx(0.0)
    assert np.abs(np.diff(bus.sent)).max() <= 30 * DEG * PERIOD_S + 1e-12


def test_without_room_nothing_moves() -> None:
    bus = FormulaBus()
    with pytest.raises(NotMoved, match="no room"):
        moved(bus, low=-1 * DEG, high=1 * DEG)
    assert set(bus.sent) == {0.0}


def test_trouble_at_the_first_look_is_said_with_nothing_measured() -> None:
    with pytest.raises(NotMoved, match="motor went off") as caught:
        moved(FormulaBus(change=lambda reads, state: peak(reads, state, 1, torque=False)))
    assert math.isnan(caught.value.moved.moved_rad)


def peak(reads: int, state: BusState, at: int, **changes: Any) -> BusState:
    """A state that is changed from the read ``at`` on."""
    return replace(state, **{name: np.array([value]) for name, value in changes.items()}) if reads >= at else state


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"hardware_error": 0x20}, r"hardware error \(0x20\)"),
        ({"error": 0x80}, "hardware error"),
        ({"torque": False}, "motor went off"),
        ({"silent": True}, "no longer says where it is"),
        ({"age_s": STALE_S + 0.01, "fresh": False}, "no longer says where it is"),
        ({"current_a": 0.51}, "stopped at 51 % of its torque"),
        ({"current_a": -0.51}, "stopped at 51 % of its torque"),
        ({"position_rad": 10 * DEG}, r"degrees behind its goal"),
    ],
)
def test_a_movement_ends_at_the_first_sign_of_trouble(changes: dict[str, Any], why: str) -> None:
    bus = FormulaBus(change=lambda reads, state: peak(reads, state, 5, **changes))
    with pytest.raises(NotMoved, match=why) as caught:
        moved(bus)
    assert bus.reads == 5, "no goal follows"
    assert caught.value.moved.wanted_rad < 10 * DEG, "what was measured until then"


def test_nearly_too_much_goes_on() -> None:
    changes = {"current_a": 0.5, "age_s": STALE_S}
    assert moved(FormulaBus(change=lambda reads, state: peak(reads, state, 1, **changes))).peak_load == 0.5
    slow = FormulaBus(change=lambda reads, state: replace(state, position_rad=state.position_rad - 0.99 * MAX_LEAD_RAD))
    assert moved(slow).moved_rad == pytest.approx(10 * DEG)
