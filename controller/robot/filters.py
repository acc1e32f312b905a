"""Filters of channels' targets: a moving average or a One Euro filter, and the slow start of each channel.

They come before the dead band, slack, rules and limits of motion, which therefore hold whatever a filter gives.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from controller.base.parameters import Flags, Floats
from controller.robot.settings import ChannelSettings, SmoothSettings

_SLOWEST = 0.05  # share of a channel's top speed at which a slow start begins
_SPEED_HZ = 1.0  # cut-off of the speed in a One Euro filter, as in the paper
_MOST_ROWS = 4096


class TargetFilter:
    """Smooths the targets of ``n`` channels, those of each as its settings say; others pass unchanged.

    The moving average is over the time of the cycles it gets; One Euro is the filter of Casiez, Roussel and Vogel
    (CHI 2012), in degrees.
    """

    def __init__(self, channels: Sequence[ChannelSettings]) -> None:
        smooth = [channel.smooth or SmoothSettings(average_s=0.0) for channel in channels]
        self._span = np.array([each.average_s or 0.0 for each in smooth])
        self._euro = np.array([each.min_cutoff_hz is not None for each in smooth])
        self._cutoff = np.array([each.min_cutoff_hz or 1.0 for each in smooth])
        self._beta = np.array([each.beta for each in smooth])
        self._rows: deque[tuple[float, Floats]] = deque(maxlen=_MOST_ROWS)  # time and targets
        self._now = 0.0
        self._last, self._value, self._speed = np.zeros((3, len(smooth)))
        self._known = np.zeros(len(smooth), dtype=bool)
        self.active = bool(self._euro.any() or self._span.any())

    def restart(self, where: Flags) -> None:
        """Forget what channels ``where`` : (n,) were asked before: the next target passes unchanged."""
        self._known[where] = False

    def apply(self, target: Floats, dt: float) -> Floats:
        """(n,) rad for targets (n,) rad of a cycle of ``dt`` s; one that is no number passes and is not remembered."""
        if not self.active:
            return target
        good = np.isfinite(target)
        new = good & ~self._known
        self._value[new], self._speed[new] = target[new], 0.0
        for _, row in self._rows:
            row[new] = target[new]
        self._known |= good
        given = self._last = np.where(good, target, self._last)
        smooth = np.where(
            self._euro, self._one_euro(given, dt), np.where(self._span > 0.0, self._average(given, dt), given)
        )
        return np.where(good, smooth, target)

    def _one_euro(self, target: Floats, dt: float) -> Floats:
        speed = np.degrees(target - self._value) / max(dt, 1e-4)
        self._speed += _share(np.full(len(target), _SPEED_HZ), dt) * (speed - self._speed)
        cutoff = self._cutoff + self._beta * np.abs(self._speed)
        self._value = self._value + _share(cutoff, dt) * (target - self._value)
        return self._value

    def _average(self, target: Floats, dt: float) -> Floats:
        """(n,) means over each channel's time, by the trapezoids of nothing but what it was asked."""
        self._now += dt
        self._rows.append((self._now, target.copy()))
        longest = self._span.max()
        while len(self._rows) > 1 and self._rows[0][0] <= self._now - longest + 1e-9:
            self._rows.popleft()
        times, rows = np.array([at for at, _ in self._rows]), np.array([row for _, row in self._rows])
        inside = times[:, None] > self._now - self._span + 1e-9
        inside[-1] = True
        mean: Floats = np.where(inside, rows, 0.0).sum(axis=0) / inside.sum(axis=0)
        return mean


def _share(cutoff_hz: Floats, dt: float) -> Floats:
    turn: Floats = 2.0 * math.pi * cutoff_hz * dt
    return turn / (turn + 1.0)


class SlowStart:
    """How fast each channel may move after it starts: from a small share of its top speed to all of it."""

    def __init__(self, channels: Sequence[ChannelSettings]) -> None:
        self._length = np.array([channel.slow_start_s for channel in channels])
        self._passed = np.zeros(len(channels))

    def restart(self, where: Flags) -> None:
        """Channels ``where`` : (n,) start again."""
        self._passed[where] = 0.0

    def step(self, dt: float) -> Floats:
        """(n,) share of each channel's top speed in the cycle of ``dt`` s."""
        self._passed += dt
        share: Floats = np.clip(self._passed / np.maximum(self._length, 1e-9), _SLOWEST, 1.0)
        return share
