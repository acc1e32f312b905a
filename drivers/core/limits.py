"""Limits of targets before they are sent: finite, inside the angle limits, and no faster than the servo's top speed.

Speed is limited by a travel budget (rad) for each servo: it grows at the servo's top speed, up to the travel of
``BURST_S`` at that speed, and every step spends from it. So the mean speed never exceeds the limit, whatever arrives
after a pause or a stall.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.base.bus import BusReport, Flags, Floats, ServoSpec

BURST_S = 0.05
"""Largest travel budget, as time at top speed; above 0, so that uneven cycles do not slow the servos down."""


class TargetLimits:
    """Applies the limits of n servos to their targets, and counts the changed targets in a report.

    target : (n,) last targets, inside the angle limits.
    """

    def __init__(self, servos: Sequence[ServoSpec], report: BusReport) -> None:
        from drivers.core.kernels import limit_targets  # imported lazily: compiled, needed only to drive servos

        self._limit = limit_targets
        self._low, self._high, self._speed = np.array(
            [(servo.min_rad, servo.max_rad, servo.max_speed_rad_s) for servo in servos], dtype=np.float64
        ).T.copy()
        self._report = report
        self.reset(np.zeros(len(servos)), 0.0)

    def reset(self, position_rad: Floats, now_s: float) -> None:
        """Start from the servos' positions (n,) with an empty travel budget."""
        self.target: Floats = np.array(position_rad, dtype=np.float64)
        self._last, self._budget = self.target.copy(), np.zeros_like(self.target)
        self._time_s = now_s

    def reset_one(self, index: int, position_rad: float, now_s: float) -> None:
        """Start one servo again from a position; its travel budget grows from now on."""
        self.target[index] = self._last[index] = position_rad
        before_s = min(max(now_s - self._time_s, 0.0), BURST_S)
        self._budget[index] = -before_s * self._speed[index]  # the next step adds before_s for all servos

    def apply(self, wanted_rad: Floats, now_s: float, driven: Flags | None = None) -> Floats:
        """Targets (n,) rad inside the angle limits and no further from the last ones than top speed allows.

        A target that is not finite is replaced by the last one. If the clock goes backwards, no time has passed. A
        servo that is not ``driven`` (n,) keeps its last target, even outside the limits; None means all are driven.
        """
        elapsed_s = min(max(now_s - self._time_s, 0.0), BURST_S)
        self._time_s = now_s
        if driven is not None and not driven.all():
            kept = self._last[~driven]
            wanted_rad = np.where(driven, wanted_rad, np.clip(self._last, self._low, self._high))
            self._step(wanted_rad, elapsed_s)
            self.target[~driven] = self._last[~driven] = kept
        else:
            self._step(wanted_rad, elapsed_s)
        return self._last.copy()

    def _step(self, wanted_rad: Floats, elapsed_s: float) -> None:
        refused, clipped, shortened = self._limit(
            wanted_rad, self._low, self._high, self._speed, elapsed_s, BURST_S, self.target, self._budget, self._last
        )
        if refused or clipped or shortened:
            self._report.refused_targets += refused
            self._report.limits_hit += clipped
            self._report.speed_limited += shortened
