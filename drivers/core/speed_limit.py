"""The last line against jumps: no target may ask a servo for more than its top speed."""

from __future__ import annotations

import numpy as np

from drivers.base.bus import Floats

BURST_S = 0.05
"""Travel at top speed that may be saved up while a target rests, so that an uneven clock is not punished."""


class SpeedLimiter:
    """Shortens steps that a servo could only follow by exceeding its top speed.

    Every servo saves up travel as time goes by, at its top speed and no more than ``BURST_S`` of it, and each
    step is paid from that. So the mean speed never exceeds the limit, whatever arrives after a pause or a stall.

    Parameters
    ----------
    max_speed_rad_s : (n,) top speeds.

    Attributes
    ----------
    speed, saved, last : (n,) top speeds, travel saved up, and what was last allowed.
    shortened : how many steps of the last call of `step` were.
    """

    def __init__(self, max_speed_rad_s: Floats) -> None:
        self.speed = np.array(max_speed_rad_s, dtype=np.float64)
        self.saved = np.zeros_like(self.speed)
        self.last = np.zeros_like(self.speed)
        self._time_s = 0.0
        self.shortened = 0
        from drivers.core.kernels import spend_travel  # compiled: only who drives servos pays for it

        self._spend = spend_travel

    def reset(self, position_rad: Floats, now_s: float) -> None:
        """Begin again from where the servos are, with nothing saved up."""
        self.last = np.array(position_rad, dtype=np.float64)
        self.saved = np.zeros_like(self.speed)
        self._time_s = now_s

    def reset_one(self, index: int, position_rad: float) -> None:
        """Begin again for one servo."""
        self.last[index] = position_rad
        self.saved[index] = 0.0

    def step(self, target_rad: Floats, now_s: float) -> Floats:
        """The target, or the nearest to it that may be asked for now.

        Parameters
        ----------
        target_rad : (n,) finite.
        now_s : time on the clock of the call before; going backwards counts as no time.

        Returns
        -------
        (n,) float64.
        """
        self.shortened = self._spend(target_rad, self.speed, self.elapsed_s(now_s), BURST_S, self.saved, self.last)
        return self.last.copy()

    def elapsed_s(self, now_s: float) -> float:
        """Time since the call before that counts, at most ``BURST_S``; from now on the next one counts from `now_s`."""
        elapsed = min(max(now_s - self._time_s, 0.0), BURST_S)
        self._time_s = now_s
        return elapsed
