"""How late the system wakes a thread that waits, learned from the thread's own waits.

Where processors are switched off while nothing runs, a wait ends late by the time that they take to come back, and
polling is worth its cost. Where they are not, or are busy with other work, polling only takes time from that work.
"""

from __future__ import annotations

LONGEST_S = 100e-6
"""Delays are counted up to this one; a thread that waited longer had no processor at all."""
_STEP_S = 4e-6


class WakeDelay:
    """A delay that the given share of all waits does not exceed (a running quantile).

    share : 0 to 1. late_s : the delay to begin with, seconds.
    """

    def __init__(self, share: float, late_s: float) -> None:
        self._up, self._down = share * _STEP_S, (1.0 - share) * _STEP_S
        self.late_s = late_s

    def note(self, late_s: float) -> None:
        """Take into account by how much a wait ended late."""
        if late_s > self.late_s:
            self.late_s = min(self.late_s + self._up, LONGEST_S)
        else:
            self.late_s = max(self.late_s - self._down, 0.0)
