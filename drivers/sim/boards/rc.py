"""One output for a hobby servo: a pulse width that moves to its target as fast as it is allowed."""

from __future__ import annotations

from drivers.sim.servos.motion import hold, plan_move, plan_timed

NO_LIMIT = 1e9


class RcChannel:
    """Pulse width of one output, in any unit; the shaft behind it is not known.

    Attributes
    ----------
    target : last target; 0 = no pulses.
    """

    def __init__(self) -> None:
        self.target = 0.0
        self._trajectory = hold(0.0, 0.0)

    def position(self, now_s: float) -> float:
        """Pulse width that is put out at `now_s`; 0 = none."""
        return self._trajectory.at(now_s).position if self.target else 0.0

    def moving(self, now_s: float) -> bool:
        """Whether the pulse is still on its way."""
        return bool(self.target) and self._trajectory.moving(now_s)

    def go(self, target: float, now_s: float, speed: float = 0.0, acceleration: float = 0.0) -> None:
        """Move to a target (0 = stop the pulses).

        Parameters
        ----------
        speed, acceleration : units/s and units/s²; 0 = no limit. A channel without pulses does not know where
            its servo is, so the first target is put out at once.
        """
        was_off, now = not self.target, self._trajectory.at(now_s)
        self.target = target
        distance = abs(target - now.position)
        if was_off or not target or not distance or not (speed or acceleration):
            self._trajectory = hold(now_s, target)
        elif acceleration:
            self._trajectory = plan_move(now_s, now.position, now.velocity, target, speed or NO_LIMIT, acceleration)
        else:
            self._trajectory = plan_timed(now_s, now.position, 0.0, target, distance / speed, 0.0)

    def go_in(self, target: float, now_s: float, seconds: float) -> None:
        """Move to a target so that it is there after `seconds` (0 = at once)."""
        now = self._trajectory.at(now_s)
        jump = not self.target or not target or seconds <= 0.0
        self.target = target
        self._trajectory = hold(now_s, target) if jump else plan_timed(now_s, now.position, 0.0, target, seconds, 0.0)
