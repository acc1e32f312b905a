"""Which servos of a bus are driven: goals go only to those whose positions are known.

A servo that was away may stand anywhere, and the goals that it missed may be far from there. So it is sent nothing
while it is away, and its goals begin at its measured position when it is back. It is back when two of its positions in
a row agree: one wrong reply in 256 has a right checksum in Protocol 1.0, whose checksum has 8 bits.
"""

from __future__ import annotations

import numpy as np

from drivers.base.bus import BusState, Flags, read_only

AWAY_S = 0.1
"""Age of its position from which a servo is away that does not report where it is."""
AWAY_TURNS = 2
"""Turns of reading that it must have missed as well, so that a pause of the caller makes no servo absent."""
AGREE_RAD = 0.3
"""How far two positions of a servo that comes back may lie apart."""


class Presence:
    """Keeps which of n servos are driven.

    driven : (n,) bool, read-only, a new array whenever it changes. A servo is not driven while it is away, left out or
        held back.
    left_out : (n,) bool, servos that could not be started with the others.
    held_back : (n,) bool, servos that answer but refuse goals, as with a tripped watchdog: until they :meth:`join`.
    all_driven, some_left_out : what these arrays say as a whole.
    """

    def __init__(self, n: int) -> None:
        self._complete = False  # all are driven and were just read
        self.reset(np.ones(n, bool))

    def reset(self, started: Flags) -> None:
        """Begin with the servos that were ``started`` (n,); the others are left out."""
        self.left_out: Flags = ~started
        self.held_back: Flags = np.zeros(len(started), bool)
        self._missed = np.zeros(len(started), np.int64)  # reads in a row without the servo's position
        self._seen_rad = np.full(len(started), np.nan)  # last position of a servo that is away
        self._drive(started)

    def join(self, index: int) -> None:
        """A servo that was left out, held back or away has been started at its position."""
        self.left_out[index] = self.held_back[index] = False
        self._missed[index] = 0
        self._drive(self.driven | (np.arange(len(self.driven)) == index))

    def leave_out(self, index: int) -> None:
        """A servo has to be started again before it is driven."""
        self.left_out[index] = True
        self._drive(self.driven & (np.arange(len(self.driven)) != index))

    def hold_back(self, index: int) -> None:
        """A servo refuses goals for now, whether or not its position is known."""
        if not self.held_back[index]:
            self.held_back[index] = True
            self._drive(self.driven & ~self.held_back)

    def note(self, state: BusState, turn: int) -> list[int]:
        """Take a read into account, of which ``turn`` are needed to ask every servo; returns who came back with it."""
        if self._complete and state.fresh.all():
            return []
        self._missed = np.where(state.fresh, 0, self._missed + 1)
        unknown = (self._missed > AWAY_TURNS * turn) & (state.age_s > AWAY_S)
        away = ~state.fresh & (state.silent | unknown)
        here = state.fresh & ~self.driven & ~self.left_out & ~self.held_back
        back = here & (np.abs(state.position_rad - self._seen_rad) <= AGREE_RAD)
        self._seen_rad = np.where(back | away, np.nan, np.where(here, state.position_rad, self._seen_rad))
        if away.any() or back.any():
            self._drive(self.driven & ~away | back)
        self._complete = bool(self.driven.all()) and not self._missed.any()
        return np.flatnonzero(back).tolist()

    def _drive(self, driven: Flags) -> None:
        self.driven: Flags = read_only(driven.copy())
        self.all_driven, self.some_left_out = bool(driven.all()), bool(self.left_out.any())
        self._complete = False
