"""Base class of drivers for boards that put out pulses, with a plausibility check of the pulses they report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.boards.bus import BoardBus
from drivers.boards.hobby import PulseScale

GROUP = 8
"""Number of channels polled in one cycle; boards have small input buffers."""


class PulseTrack:
    """Range of pulses that each of n outputs can have, from its last reported pulse and the goals since.

    A board moves its outputs towards their goals and overshoots only by its braking distance, so a pulse outside of the
    range was damaged or belongs to another request.

    goal_us : (n,) last goal; NaN for none.
    """

    def __init__(self, n: int) -> None:
        self.goal_us = np.full(n, math.nan)
        self._low, self._high = self.goal_us, self.goal_us

    def begin(self, seen_us: Floats) -> None:
        """Start from what a board puts out (n,) us; 0 is no pulses."""
        self._low, self._high = np.fmin(seen_us, self.goal_us), np.fmax(seen_us, self.goal_us)

    def go(self, goal_us: Floats) -> None:
        """Set new goals (n,) us; NaN keeps the last one."""
        self.goal_us = np.where(np.isfinite(goal_us), goal_us, self.goal_us)
        self._low, self._high = np.fmin(self._low, self.goal_us), np.fmax(self._high, self.goal_us)

    def believes(self, index: int, pulse_us: float, slack_us: float, stop_us: float = 0.0) -> bool:
        """Whether a reported pulse is possible for an output; a pulse at the goal narrows the range to it.

        ``slack_us`` is the board's own rounding, ``stop_us`` its braking distance.
        """
        if not pulse_us:
            return True
        beyond = slack_us + stop_us
        if not self._low[index] - beyond <= pulse_us <= self._high[index] + beyond:
            return False
        if abs(pulse_us - self.goal_us[index]) <= slack_us:
            self._low[index] = self._high[index] = self.goal_us[index]
        return True


class PulseBus(BoardBus):
    """A board of hobby servos, whose ``id`` is the channel; options as :class:`~drivers.boards.bus.BoardBus`."""

    SLACK_US = 2.0
    """Greatest deviation of a reported pulse, by the board's own rounding."""

    def __init__(self, servos: Iterable[ServoSpec], **options: Any) -> None:
        super().__init__(servos, **options)
        self._scale = PulseScale(self.servos)
        self._track = PulseTrack(len(self.servos))
        self._stop_us = np.zeros(len(self.servos))  # braking distance, where the board limits the acceleration
        indices = list(range(len(self.servos)))
        self._groups = [indices[i : i + GROUP] for i in range(0, len(indices), GROUP)]
        self._next = 0
        self._forgot = False  # the board may have been reset

    def _doubt(self) -> None:
        """Called after an implausible answer; does nothing by default."""

    def _turn(self) -> list[int]:
        """Choose the servos (indices) to poll in this cycle."""
        self._next = (self._next + 1) % len(self._groups)
        return self._groups[self._next]

    def _take(self, group: Sequence[int], pulses: Iterable[float]) -> None:
        """Check and store reported pulses (us); a servo that lost them shows that the board may have been reset."""
        seen = np.zeros(len(self.servos))
        seen[list(group)] = pulses = list(pulses)
        angles = self._scale.radians(seen)
        for index, pulse in zip(group, pulses, strict=True):
            if not self._track.believes(index, pulse, self.SLACK_US, float(self._stop_us[index])):
                self._report.count("corrupt", self.ids[index])
                self._doubt()
                return
            self._forgot |= bool(self._running and self._on[index] and not pulse)
            self._note(index, float(angles[index]))
