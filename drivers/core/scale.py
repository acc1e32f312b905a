"""Conversion between encoder steps and angles, speeds and currents, for all servos of a bus at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Floats, ServoSpec
from drivers.tables.tables import ControlTable

Ticks = NDArray[np.int32]

_EDGE_STEPS = 1e-6  # tolerance, so that rounding does not move a limit that is a whole step


class Scale:
    """Conversion between steps of each servo's encoder and angles; shapes ``(n,)``.

    ``shaft = (ticks - center) * rad_per_tick`` and ``shaft = zero_rad + sign * angle``.

    axes : (4, n): sign, zero_rad, center and rad_per_tick, which are its rows.
    low, high : limits of goals by the servos' angle limits, steps.
    lowest, highest : limits of goals by the servos' own registers, steps.
    """

    def __init__(self, servos: Sequence[ServoSpec], tables: Sequence[ControlTable]) -> None:
        from drivers.core.kernels import to_si, to_steps  # imported lazily: compiled, for driving only

        self._to_steps, self._to_si = to_steps, to_si
        sign = [-1.0 if servo.reverse else 1.0 for servo in servos]
        zero_rad = [servo.zero_rad for servo in servos]
        self.axes = np.array(
            [sign, zero_rad, [table.center for table in tables], [table.rad_per_tick for table in tables]], np.float64
        )
        self.sign, self.zero_rad, self.center, self.rad_per_tick = self.axes
        ends = [self._steps(np.array([getattr(servo, end) for servo in servos])) for end in ("min_rad", "max_rad")]
        first = np.array([table.first_step for table in tables])
        top = first + np.array([table.ticks_per_turn - 1 for table in tables])
        low = np.clip(np.ceil(np.minimum(*ends) - _EDGE_STEPS), first, top)
        high = np.clip(np.floor(np.maximum(*ends) + _EDGE_STEPS), low, top)
        self._bounds = np.array([low, high, first, top], np.int32)
        self.low, self.high, self.lowest, self.highest = self._bounds

    def _steps(self, angle_rad: Floats) -> Floats:
        steps: Floats = self.center + (self.zero_rad + self.sign * angle_rad) / self.rad_per_tick
        return steps

    def ticks(self, angle_rad: Floats) -> Ticks:
        """Nearest step of each angle, not limited. ``(n,)`` finite -> ``(n,) int32``."""
        return np.rint(self._steps(angle_rad)).astype(np.int32)

    def tick(self, index: int, angle_rad: float) -> int:
        """Nearest step of one servo's angle, not limited."""
        sign, zero_rad, center, rad_per_tick = map(float, self.axes[:, index])
        return round(center + (zero_rad + sign * angle_rad) / rad_per_tick)

    def radians(self, ticks: NDArray[np.integer] | Floats) -> Floats:
        """Angle of each step, ``(n,) -> (n,) float64``."""
        angle: Floats = self.sign * ((ticks - self.center) * self.rad_per_tick - self.zero_rad)
        return angle

    def goals(self, angle_rad: Floats, steps: Ticks) -> Floats:
        """Set goals, (n,) steps, for angles (n,) rad, finite, and return their angles (n,).

        The last goals are in `steps`; one outside the limits may only move towards them.
        """
        sent: Floats = np.empty(len(steps))
        self._to_steps(angle_rad, self.axes, self._bounds, steps, sent)
        return sent

    def measured(self, known: Floats, now_s: float) -> Floats:
        """Angles (rad), speeds and currents with the angle's sign, and ages (s), (4, n).

        ``known`` is (at least 4, n): position in steps, speed, current, time of the measurement.
        """
        out: Floats = np.empty((4, known.shape[1]))
        self._to_si(known, self.axes, now_s, out)
        return out

    def narrow(self, index: int, low: int, high: int) -> None:
        """Also apply the limits of one servo's own registers, outside which it refuses goals."""
        self.lowest[index], self.highest[index] = low, high
        self.low[index] = min(max(self.low[index], low), high)
        self.high[index] = max(min(self.high[index], high), self.low[index])
