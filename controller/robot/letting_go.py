"""Letting go: a bus whose servos have been still for a while, with nothing that pulls at them, is switched off.

Servos that hold still for hours wear and warm for nothing. They are switched off together, since a servo that is off
beside others that move is pulled along; and they come back when a target moves, or when one of them is moved.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Floats
from drivers.base.bus import BusState

_STILL_RAD = np.radians(0.1)
_THERE_RAD = np.radians(2.0)
_SAGGED_RAD = np.radians(3.0)
_TRIES = 2
"""How often a bus that sagged when it was let go is tried again before it is held for the rest of the run."""


class LettingGo:
    """Decides when a bus is let go and when it is taken again.

    after_s : how long it must be still; 0 for never. below_a : current of each servo that counts as nothing.
    times : how often it was let go. sagged : how often it was taken again because a servo had moved.
    """

    def __init__(self, after_s: float, below_a: float) -> None:
        self._after_s, self._below_a = after_s, below_a
        self._goals: Floats | None = None
        self._still_s, self._wanted = 0.0, np.zeros(0)
        self._here: Floats | None = None
        self.times = self.sagged = 0

    def may_let_go(self, goals: Floats, state: BusState | None, dt: float) -> bool:
        """Whether all servos have held ``goals`` : (n,) rad for long enough, each at its goal and none against a load.

        A servo whose current is not measured is held: nobody knows what pulls at it.
        """
        if not self._after_s or self.sagged >= _TRIES:
            return False
        moved = self._goals is None or np.abs(goals - self._goals).max() > _STILL_RAD
        if moved or state is None or not self._unloaded(goals, state):
            self._goals, self._still_s = goals.copy(), 0.0
            return False
        self._still_s += dt
        return self._still_s >= self._after_s

    def _unloaded(self, goals: Floats, state: BusState) -> bool:
        there = state.fresh & (np.abs(state.position_rad - goals) < _THERE_RAD)
        return bool((there & (np.abs(state.current_a) < self._below_a)).all())

    def begin(self, wanted: Floats, state: BusState | None) -> None:
        """It was let go while ``wanted`` : (n,) rad was asked, with its servos at these positions."""
        self._here = None if state is None else state.position_rad.copy()
        self._wanted = wanted.copy()
        self._still_s = 0.0
        self.times += 1

    def must_hold(self, wanted: Floats, state: BusState) -> bool:
        """Whether to take it again: something else is ``wanted`` : (n,) rad than then, or a servo was moved."""
        if self._here is None or (np.abs(wanted - self._wanted) > _STILL_RAD).any():
            return True
        sagged = bool((np.abs(state.position_rad - self._here) > _SAGGED_RAD).any())
        self.sagged += sagged
        return sagged
