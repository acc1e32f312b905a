"""Filters of channels' targets: a moving average or a One Euro filter, and the slow start of each channel.

They come before the dead band, slack, rules and limits of motion, which therefore apply to whatever a filter returns.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from controller.base.parameters import Flags, Floats
from controller.robot.settings import ChannelSettings, SmoothSettings

_START_SPEED = 0.05  # fraction of its top speed at which the slow start of a channel begins
_SPEED_CUTOFF_HZ = 1.0  # cut-off of the speed in a One Euro filter, as in the paper
_MAX_ROWS = 4096


class TargetFilter:
    """Smooths the targets of ``n`` channels as their settings say; without settings, targets pass unchanged.

    The moving average is the mean of the targets in the last ``average_s``; One Euro is the filter of Casiez, Roussel
    and Vogel (CHI 2012), in degrees.
    """

    def __init__(self, channels: Sequence[ChannelSettings]) -> None:
        smooth = [channel.smooth or SmoothSettings(average_s=0.0) for channel in channels]
        self._span = np.array([each.average_s or 0.0 for each in smooth])
        self._euro = np.array([each.min_cutoff_hz is not None for each in smooth])
        self._cutoff = np.array([each.min_cutoff_hz or 1.0 for each in smooth])
        self._beta = np.array([each.beta for each in smooth])
        self._rows: deque[tuple[float, Floats]] = deque(maxlen=_MAX_ROWS)  # time and targets
        self._now = 0.0
        self._last, self._value, self._speed = np.zeros((3, len(smooth)))
        self._known = np.zeros(len(smooth), dtype=bool)
        self.active = bool(self._euro.any() or self._span.any())

    def restart(self, where: Flags) -> None:
        """Forget the targets of the channels ``where`` : (n,), so that their next target passes unchanged."""
        self._known[where] = False

    def apply(self, target: Floats, dt: float) -> Floats:
        """Filter targets (n,) rad of a cycle of ``dt`` s; one that is not finite passes and is not stored."""
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
        self._speed += _gain(np.full(len(target), _SPEED_CUTOFF_HZ), dt) * (speed - self._speed)
        cutoff = self._cutoff + self._beta * np.abs(self._speed)
        self._value = self._value + _gain(cutoff, dt) * (target - self._value)
        return self._value

    def _average(self, target: Floats, dt: float) -> Floats:
        """(n,) mean of the targets in each channel's ``average_s``, the newest one included."""
        self._now += dt
        self._rows.append((self._now, target.copy()))
        max_span = self._span.max()
        while len(self._rows) > 1 and self._rows[0][0] <= self._now - max_span + 1e-9:
            self._rows.popleft()
        times, rows = np.array([at for at, _ in self._rows]), np.array([row for _, row in self._rows])
        inside = times[:, None] > self._now - self._span + 1e-9
        inside[-1] = True
        mean: Floats = np.where(inside, rows, 0.0).sum(axis=0) / inside.sum(axis=0)
        return mean


def _gain(cutoff_hz: Floats, dt: float) -> Floats:
    """Weight of a new value in a low-pass filter of first order."""
    angle: Floats = 2.0 * math.pi * cutoff_hz * dt
    return angle / (angle + 1.0)


class SlowStart:
    """Limits the speed of each channel after it starts: from a small fraction of its top speed to all of it."""

    def __init__(self, channels: Sequence[ChannelSettings]) -> None:
        self._length = np.array([channel.slow_start_s for channel in channels])
        self._passed = np.zeros(len(channels))

    def restart(self, where: Flags) -> None:
        """Begin the slow start of the channels ``where`` : (n,) again."""
        self._passed[where] = 0.0

    def step(self, dt: float) -> Floats:
        """(n,) fraction of its top speed that each channel may use in this cycle of ``dt`` s."""
        self._passed += dt
        fraction: Floats = np.clip(self._passed / np.maximum(self._length, 1e-9), _START_SPEED, 1.0)
        return fraction
