"""What may be asked of servos: finite, inside the angle limits, and no faster than they can follow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drivers.base.bus import BusReport, Floats, ServoSpec
from drivers.core.speed_limit import BURST_S, SpeedLimiter


class TargetLimits:
    """Carries targets through the limits of their servos and counts what it changed.

    Parameters
    ----------
    servos : n of them, in the order of all arrays.
    report : where it counts.

    Attributes
    ----------
    target : (n,) what was last asked for, inside the angle limits.
    """

    def __init__(self, servos: Sequence[ServoSpec], report: BusReport) -> None:
        self.target: Floats = np.zeros(len(servos))
        self._low = np.array([servo.min_rad for servo in servos], dtype=np.float64)
        self._high = np.array([servo.max_rad for servo in servos], dtype=np.float64)
        self._guard = SpeedLimiter(np.array([servo.max_speed_rad_s for servo in servos]))
        self._report = report
        from drivers.core.kernels import limit_targets  # compiled: only who drives servos pays for it

        self._limit = limit_targets

    def reset(self, position_rad: Floats, now_s: float) -> None:
        """Begin from where the servos (n,) are."""
        self.target = np.array(position_rad, dtype=np.float64)
        self._guard.reset(self.target, now_s)

    def reset_one(self, index: int, position_rad: float) -> None:
        """One servo begins again from a position."""
        self.target[index] = position_rad
        self._guard.reset_one(index, position_rad)

    def apply(self, wanted_rad: Floats, now_s: float) -> Floats:
        """What may be asked for now.

        Parameters
        ----------
        wanted_rad : (n,) targets; one that is no finite number keeps the last one.
        now_s : monotonic time.

        Returns
        -------
        (n,) float64 : inside the angle limits, and no further from the last call's than top speed allows.
        """
        guard, report = self._guard, self._report
        refused, clipped, shortened = self._limit(
            wanted_rad, self._low, self._high, self.target,
            guard.speed, guard.elapsed_s(now_s), BURST_S, guard.saved, guard.last,
        )  # fmt: skip
        if refused or clipped or shortened:
            report.refused_targets += refused
            report.limits_hit += clipped
            report.speed_limited += shortened
        return guard.last.copy()
