"""Input, output and counter of all safety rules, and the heat rule: a warm servo moves less far and more slowly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.base.parameters import Flags, Floats, Indices
from controller.robot.channels import ChannelTable
from controller.robot.settings import HeatRule
from drivers.base.bus import BusState

_SETTLE_S = 2.0  # time over which a change takes full effect; readings come in whole degrees, that is, in steps


@dataclass
class RuleInput:
    """Inputs of the rules in one cycle, the last of ``dt`` s.

    target, position, rest : (n,) rad: the targets, the last goals, and where the servos would come to rest if they
    braked from the next step on. state : the newest measurement.
    """

    target: Floats
    position: Floats
    rest: Floats
    state: BusState | None
    dt: float


@dataclass
class AllowedRange:
    """Positions that each servo may be sent, low and high (n,) rad; ``narrow`` only makes the range smaller."""

    low: Floats
    high: Floats

    def narrow(self, at: Indices, sign: Floats, bound: Floats, where: Flags) -> None:
        """Bound servos ``at`` : (k,) from above by ``bound`` : (k,) where ``sign`` : (k,) is +1, else from below."""
        if not where.any():
            return
        up, down = where & (sign > 0), where & (sign < 0)
        np.minimum.at(self.high, at[up], bound[up])
        np.maximum.at(self.low, at[down], bound[down])


class RuleCounter:
    """Counts how many times each of k rules began to act, and for how many seconds it acted."""

    def __init__(self, labels: list[str]) -> None:
        self.labels = labels
        self._times, self._seconds = np.zeros(len(labels), np.int64), np.zeros(len(labels))
        self._acting = np.zeros(len(labels), bool)

    def count(self, acting: Flags, dt: float) -> None:
        """Count one cycle of the rules that act now."""
        self._times += acting & ~self._acting
        self._seconds += acting * dt
        self._acting = acting

    def report(self) -> list[dict[str, object]]:
        """The rules that acted, with their counts."""
        return [
            {"rule": label, "times": int(times), "seconds": round(float(seconds), 3)}
            for label, times, seconds in zip(self.labels, self._times, self._seconds, strict=True)
            if times
        ]


class HeatRules:
    """Narrows the range about the neutral face, and the speed, as temperature rises from ``above_c`` to ``full_c``.

    A servo that has not reported a temperature is not limited. If it stops reporting, the last one stays in effect.
    """

    def __init__(self, rules: Sequence[HeatRule], table: ChannelTable, neutral: Floats) -> None:
        each = [(rule, name) for rule in rules for name in rule.channels]
        self._at = np.array([table.names.index(name) for _, name in each], dtype=np.intp)
        numbers = np.array([(r.above_c, r.full_c, r.range, r.speed) for r, _ in each]).reshape(-1, 4)
        self._above, self._full, self._range, self._speed = numbers.T
        self._neutral = neutral[self._at]
        self._low, self._high = table.low_rad[self._at], table.high_rad[self._at]
        self._warmth = np.zeros(len(each))
        self._share = np.ones(len(table.names))
        self.counter = RuleCounter([f"heat {name}" for _, name in each])

    def narrow(self, now: RuleInput, allowed: AllowedRange) -> None:
        """Narrow the allowed range for one cycle."""
        if now.state is not None:
            measured = now.state.temperature_c[self._at]
            wanted = np.clip((measured - self._above) / (self._full - self._above), 0.0, 1.0)
            wanted = np.where(np.isfinite(measured), wanted, self._warmth)
            max_step = now.dt / _SETTLE_S
            self._warmth += np.clip(wanted - self._warmth, -max_step, max_step)
        range_fraction = 1.0 - self._warmth * (1.0 - self._range)
        acting = self._warmth > 0.0
        for sign, end in ((1.0, self._high), (-1.0, self._low)):
            bound = self._neutral + range_fraction * (end - self._neutral)
            allowed.narrow(self._at, np.full(len(self._at), sign), bound, acting)
        self.counter.count(acting, now.dt)

    @property
    def speed_fraction(self) -> Floats:
        """(n,) fraction of its top speed that each channel of the table may use now."""
        self._share[:] = 1.0
        np.minimum.at(self._share, self._at, 1.0 - self._warmth * (1.0 - self._speed))
        return self._share
