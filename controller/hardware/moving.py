"""A small movement of one servo that is supervised at every step and ends at the first sign of load or error."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from controller.base.parameters import Floats
from drivers.base.bus import Bus, BusState

PERIOD_S = 0.02
SETTLE_S = 0.4
"""Longest time in which a servo may arrive after its last goal."""
STALE_S = 0.3
MAX_LAG_S = 1.0
MAX_LEAD_RAD = math.radians(2.5)
"""A servo that lags further behind its goal counts as blocked."""
MAX_END_ERROR_RAD = math.radians(0.25)
ALERT = 0x80


@dataclass
class Moved:
    """What was measured; unknown values are NaN.

    wanted_rad, moved_rad : distance from end to end that the goals and the shaft moved.
    along : positive where the shaft moved in the direction of its goals.
    lag_s : delay of the shaft behind its goals. peak_load : fraction of the stall torque.
    """

    wanted_rad: float = math.nan
    moved_rad: float = math.nan
    along: float = math.nan
    lag_s: float = math.nan
    peak_current_a: float = math.nan
    peak_load: float = math.nan
    least_voltage_v: float = math.nan


class NotMoved(Exception):
    """The movement was stopped early; ``moved`` is what was measured until then."""

    def __init__(self, message: str, moved: Moved) -> None:
        super().__init__(message)
        self.moved = moved


@dataclass
class Sampler:
    """Sends goals to the only servo of a bus and checks its measurements.

    load : fraction of the stall torque, or of ``full_a`` (A), above which it stops.
    share : greatest such fraction so far. sleep, clock : functions in seconds.
    """

    bus: Bus
    load: float
    full_a: float
    sleep: Callable[[float], object] = time.sleep
    clock: Callable[[], float] = time.monotonic
    sent_s: list[float] = field(default_factory=list)
    goals: list[float] = field(default_factory=list)
    read_s: list[float] = field(default_factory=list)
    positions: list[float] = field(default_factory=list)
    current_a: float = math.nan
    share: float = math.nan
    voltage_v: float = math.nan
    stopped: str = ""

    def step(self, goal_rad: float) -> float:
        """Send a goal, wait one period and read; return the position. Raises NotMoved where it must stop."""
        start_s = self.clock()
        sent = float(self.bus.write([goal_rad])[0])
        self.sleep(max(0.0, start_s + PERIOD_S - self.clock()))
        state = self.bus.read()
        position = float(state.position_rad[0])
        self.sent_s.append(start_s)
        self.goals.append(sent)
        if state.fresh[0]:
            self.read_s.append(self.clock())
            self.positions.append(position)
        self._update_peaks(state)
        if why := self._reason_to_stop(state, sent, position):
            raise NotMoved(why, self.moved())
        return position

    def _update_peaks(self, state: BusState) -> None:
        self.current_a = _max_known(self.current_a, abs(float(state.current_a[0])))
        load = getattr(self.bus, "load", None)  # servos with Protocol 1.0 measure it
        self.share = _max_known(self.share, abs(float(load[0])) if load is not None else math.nan)
        self.share = _max_known(self.share, self.current_a / self.full_a if self.full_a > 0.0 else math.nan)
        self.voltage_v = -_max_known(-self.voltage_v, -float(state.voltage_v[0]))

    def _reason_to_stop(self, state: BusState, goal: float, position: float) -> str:
        """Return why the movement must end now; empty where it may go on."""
        if state.hardware_error[0] or state.error[0] & ALERT:
            return f"stopped: it reports a hardware error (0x{int(state.hardware_error[0]):02X})"
        if not state.torque[0]:
            return "stopped: its motor went off by itself"
        if state.silent[0] or state.age_s[0] > STALE_S:
            return "stopped: it no longer says where it is"
        if self.share > self.load:
            return f"stopped at {100 * self.share:.0f} % of its torque: something blocks it"
        if abs(goal - position) > MAX_LEAD_RAD:
            return f"stopped: it is {math.degrees(abs(goal - position)):.1f} degrees behind its goal, as if blocked"
        return ""

    def moved(self) -> Moved:
        """Return what was measured so far."""
        found = Moved(peak_current_a=self.current_a, peak_load=self.share, least_voltage_v=self.voltage_v)
        if len(self.positions) > 1:  # one sample is no movement
            found.wanted_rad = max(self.goals) - min(self.goals)
            found.moved_rad = max(self.positions) - min(self.positions)
            found.lag_s = self._lag_s()
            found.along = float(np.diff(self._goals_before(found.lag_s)) @ np.diff(self.positions))
        return found

    def _goals_before(self, lag_s: float) -> Floats:
        """(k,) the goal in effect ``lag_s`` before each position was read; the first goal where that was earlier."""
        at = np.searchsorted(self.sent_s, np.array(self.read_s) - lag_s, side="right") - 1
        goals: Floats = np.array(self.goals)[np.maximum(at, 0)]
        return goals

    def _lag_s(self) -> float:
        """Delay of the positions behind the goals: the one with the least mean distance, or the mean of equal ones."""
        lags = np.arange(0.0, min(MAX_LAG_S, 0.5 * (self.read_s[-1] - self.sent_s[0])), 0.5 * PERIOD_S)
        errors = np.array([np.abs(self._goals_before(lag) - self.positions).mean() for lag in lags])
        return float(lags[errors <= errors.min() + 1e-9].mean()) if len(lags) else 0.0


def move_a_little(sampler: Sampler, by_rad: float, speed_rad_s: float, low_rad: float, high_rad: float) -> Moved:
    """Move up, down and back by at most ``by_rad``, inside both limits.

    Raises NotMoved: it stopped early, or there is no room. Torque stays on then, at the position where it stopped.
    """
    start = sampler.step(math.nan)
    up, down = min(start + by_rad, high_rad), max(start - by_rad, low_rad)
    if up - down < by_rad:
        raise NotMoved("has no room to move within limit_deg", sampler.moved())
    goal = start
    for target in (up, down, start):
        goal = _ramp(sampler, goal, target, speed_rad_s)
    return sampler.moved()


def _ramp(sampler: Sampler, goal: float, target: float, speed_rad_s: float) -> float:
    """Send goals that move to ``target`` at a speed, and wait until the shaft arrives; return the last goal."""
    step = speed_rad_s * PERIOD_S
    position = goal
    while goal != target:
        goal += max(min(target - goal, step), -step)
        position = sampler.step(goal)
    end_s = sampler.clock() + SETTLE_S
    while abs(position - target) > MAX_END_ERROR_RAD and sampler.clock() < end_s:
        position = sampler.step(goal)
    return goal


def _max_known(one: float, other: float) -> float:
    """Return the greater of two values; where one is unknown (NaN), the other."""
    return other if math.isnan(one) else one if math.isnan(other) else max(one, other)
