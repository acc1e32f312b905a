"""Steps of encoders and the angles they mean, for all servos of a bus at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Floats, ServoSpec
from drivers.tables.tables import ControlTable

Ticks = NDArray[np.int32]

_EDGE = 1e-6  # steps: a limit given as a whole step must not lose it to rounding


class Scale:
    """Steps of each servo's encoder and the angles they mean; shapes ``(n,)``.

    ``shaft = (ticks - center) * rad_per_tick`` and ``shaft = zero_rad + sign * angle``.

    Parameters
    ----------
    servos : n servos.
    tables : their control tables, in the same order.

    Attributes
    ----------
    axes : (4, n): sign, zero_rad, center and rad_per_tick, which are its rows.
    low, high : where goals may lie, steps.
    lowest, highest : what the servos take as a goal at all, steps.
    """

    def __init__(self, servos: Sequence[ServoSpec], tables: Sequence[ControlTable]) -> None:
        from drivers.core.kernels import to_si, to_steps  # start-up: compiled, and only who drives servos pays for it

        self._to_steps, self._to_si = to_steps, to_si
        sign = [-1.0 if servo.reverse else 1.0 for servo in servos]
        zero_rad = [servo.zero_rad for servo in servos]
        self.axes = np.array(
            [sign, zero_rad, [table.center for table in tables], [table.rad_per_tick for table in tables]], np.float64
        )
        self.sign, self.zero_rad, self.center, self.rad_per_tick = self.axes
        reach = np.array([(servo.min_rad, servo.max_rad) for servo in servos], dtype=np.float64)
        ends = [self._steps(reach[:, 0]), self._steps(reach[:, 1])]
        top = np.array([table.ticks_per_turn - 1 for table in tables])
        low = np.clip(np.ceil(np.minimum(*ends) - _EDGE), 0, top)
        high = np.clip(np.floor(np.maximum(*ends) + _EDGE), low, top)
        self._bounds = np.array([low, high, np.zeros_like(top), top], np.int32)
        self.low, self.high, self.lowest, self.highest = self._bounds

    def _steps(self, angle_rad: Floats) -> Floats:
        steps: Floats = self.center + (self.zero_rad + self.sign * angle_rad) / self.rad_per_tick
        return steps

    def ticks(self, angle_rad: Floats) -> Ticks:
        """Nearest step of each angle, not limited. ``(n,)`` finite -> ``(n,) int32``."""
        return np.rint(self._steps(angle_rad)).astype(np.int32)

    def radians(self, ticks: NDArray[np.integer] | Floats) -> Floats:
        """Angle of each step, ``(n,) -> (n,) float64``."""
        angle: Floats = self.sign * ((ticks - self.center) * self.rad_per_tick - self.zero_rad)
        return angle

    def goals(self, angle_rad: Floats, steps: Ticks) -> Floats:
        """Where the servos shall go, inside all limits; one that stands outside them is led in, not thrown in.

        Parameters
        ----------
        angle_rad : (n,) finite.
        steps : (n,) the goals before, changed to the new ones.

        Returns
        -------
        (n,) float64 : the angles of the new goals.
        """
        sent: Floats = np.empty(len(steps))
        self._to_steps(angle_rad, self.axes, self._bounds, steps, sent)
        return sent

    def measured(self, known: Floats, now_s: float) -> Floats:
        """Angles (rad), speeds and currents with the angle's sign, and ages (s), (4, n).

        Parameters
        ----------
        known : (at least 4, n): position in steps, speed, current, and when they were measured.
        """
        out: Floats = np.empty((4, known.shape[1]))
        self._to_si(known, self.axes, now_s, out)
        return out

    def narrow(self, index: int, low: int, high: int) -> None:
        """Also keep one servo inside limits that its own registers hold, outside which it takes no goal."""
        self.lowest[index], self.highest[index] = low, high
        self.low[index] = min(max(self.low[index], low), high)
        self.high[index] = max(min(self.high[index], high), self.low[index])
