"""One output of a simulated board for hobby servos: a pulse width that moves to its target within its limits."""

from __future__ import annotations

from typing import Any

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
        """Pulse width at `now_s`; 0 = no pulses."""
        return self._trajectory.at(now_s).position if self.target else 0.0

    def moving(self, now_s: float) -> bool:
        """Whether the pulse has not reached its target."""
        return bool(self.target) and self._trajectory.moving(now_s)

    def describe(self, number: int, now_s: float, unit_us: float = 1.0) -> dict[str, Any]:
        """Channel number, pulse width and target in microseconds, for people and tools."""
        return {"id": number, "pulse_us": self.position(now_s) * unit_us, "target_us": self.target * unit_us}

    def go(self, target: float, now_s: float, speed: float = 0.0, acceleration: float = 0.0) -> None:
        """Move to a target (0 = stop the pulses).

        Parameters
        ----------
        speed, acceleration : units/s and units/s²; 0 = no limit. A channel without pulses does not know where
            its servo is, so its first target is reached at once.
        """
        was_off, now = not self.target, self._trajectory.at(now_s)
        self.target = target
        distance = abs(target - now.position)
        if was_off or not target or not distance or not (speed or acceleration):
            self._trajectory = hold(now_s, target)
        elif acceleration:
            self._trajectory = plan_move(now_s, now, target, speed or NO_LIMIT, acceleration)
        else:
            self._trajectory = plan_timed(now_s, now, target, distance / speed)

    def go_in(self, target: float, now_s: float, seconds: float) -> None:
        """Move to a target so that it is there after `seconds` (0 = at once)."""
        now = self._trajectory.at(now_s)
        jump = not self.target or not target or seconds <= 0.0
        self.target = target
        self._trajectory = hold(now_s, target) if jump else plan_timed(now_s, now, target, seconds)
