"""Which servos of a bus are driven: goals go only to those whose positions are known.

A servo is away while it does not report its position. It may be moved meanwhile, and the goals that it missed may be
far from its new position. So it is sent no goals while it is away, and its goals begin at its measured position when it
is back. It is back when two of its positions in a row agree: in Protocol 1.0, whose checksum has 8 bits, one wrong
reply in 256 passes the check.
"""

from __future__ import annotations

import numpy as np

from drivers.base.bus import BusState, Flags, read_only

AWAY_S = 0.1
"""A servo is away if its newest position is older than this and it has missed the rounds of reading below."""
AWAY_ROUNDS = 2
"""Rounds of reading that it must have missed as well, so that a pause of the caller does not make servos absent."""
MAX_DISAGREEMENT_RAD = 0.3
"""How far two positions in a row may lie apart for a servo that was away to count as back."""


class Presence:
    """Keeps track of which of n servos are driven, that is, sent goals.

    driven : (n,) bool, read-only, a new array whenever it changes. A servo is not driven while it is away, left out or
        held back.
    left_out : (n,) bool, servos that could not be started with the others.
    held_back : (n,) bool, servos that answer but refuse goals, as with a tripped watchdog, until :meth:`join`.
    all_driven, some_left_out : whether all servos are driven, and whether any is left out.
    """

    def __init__(self, n: int) -> None:
        self._complete = False  # all servos are driven and were measured by the last read
        self.reset(np.ones(n, bool))

    def reset(self, started: Flags) -> None:
        """Begin with the servos that were ``started`` (n,); the others are left out."""
        self.left_out: Flags = ~started
        self.held_back: Flags = np.zeros(len(started), bool)
        self._missed = np.zeros(len(started), np.int64)  # reads in a row without the servo's position
        self._seen_rad = np.full(len(started), np.nan)  # last position of a servo that is away
        self._set_driven(started)

    def join(self, index: int) -> None:
        """Drive a servo that was left out, held back or away and has been started at its position."""
        self.left_out[index] = self.held_back[index] = False
        self._missed[index] = 0
        self._set_driven(self.driven | (np.arange(len(self.driven)) == index))

    def leave_out(self, index: int) -> None:
        """Stop driving a servo until it has been started again."""
        self.left_out[index] = True
        self._set_driven(self.driven & (np.arange(len(self.driven)) != index))

    def hold_back(self, index: int) -> None:
        """Stop driving a servo that refuses goals for now, whether or not its position is known."""
        if not self.held_back[index]:
            self.held_back[index] = True
            self._set_driven(self.driven & ~self.held_back)

    def note(self, state: BusState, reads_per_round: int) -> list[int]:
        """Update from the state after a read; return the indices of the servos that are back.

        reads_per_round : number of reads in which the position of every servo is requested once.
        """
        if self._complete and state.fresh.all():
            return []
        self._missed = np.where(state.fresh, 0, self._missed + 1)
        unknown = (self._missed > AWAY_ROUNDS * reads_per_round) & (state.age_s > AWAY_S)
        away = ~state.fresh & (state.silent | unknown)
        returning = state.fresh & ~self.driven & ~self.left_out & ~self.held_back
        back = returning & (np.abs(state.position_rad - self._seen_rad) <= MAX_DISAGREEMENT_RAD)
        self._seen_rad = np.where(back | away, np.nan, np.where(returning, state.position_rad, self._seen_rad))
        if away.any() or back.any():
            self._set_driven(self.driven & ~away | back)
        self._complete = bool(self.driven.all()) and not self._missed.any()
        return np.flatnonzero(back).tolist()

    def _set_driven(self, driven: Flags) -> None:
        self.driven: Flags = read_only(driven.copy())
        self.all_driven, self.some_left_out = bool(driven.all()), bool(self.left_out.any())
        self._complete = False
