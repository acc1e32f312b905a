"""A timeline of commands to a simulated bus: faults that come and go, shafts that are moved by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

AT_ONCE = 100
"""Commands carried out at a time, beyond those of a whole round."""


class Timeline:
    """Command lines (``drivers.sim.serving.control``) with the seconds after which each is carried out.

    steps : in rising time. loop_s : after how long they begin again; 0: never.
    """

    def __init__(self, steps: Sequence[tuple[float, str]], loop_s: float = 0.0) -> None:
        self.steps, self.loop_s = tuple(steps), loop_s
        self._next, self._start_s = 0, math.nan

    def start(self, now_s: float) -> None:
        """Count the time from now."""
        self._next, self._start_s = 0, now_s

    @property
    def due_s(self) -> float:
        """When the next command is due; infinity: there is none, or the timeline has not been started."""
        if self._next >= len(self.steps) or math.isnan(self._start_s):
            return math.inf
        return self._start_s + self.steps[self._next][0]

    def advance(self, now_s: float, carry_out: Callable[[str], object]) -> None:
        """Carry out what is due; of a loop that is behind, some rounds, so that the caller's other work goes on."""
        for _ in range(len(self.steps) + AT_ONCE):
            if self.due_s > now_s:
                return
            line = self.steps[self._next][1]
            self._next += 1
            if self._next == len(self.steps) and self.loop_s:
                self._next, self._start_s = 0, self._start_s + self.loop_s
            carry_out(line)
