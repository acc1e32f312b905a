"""How late the system wakes a thread that waits, learned from the thread's own waits.

Where an idle processor is put to sleep, a wait ends late by the time that the processor takes to wake, and polling is
worth its cost. Where processors do not sleep, or are busy with other work, polling only takes time from that work.
"""

from __future__ import annotations

MAX_DELAY_S = 100e-6
"""Greatest delay that is learned; a thread that waited longer had to wait for a processor in use."""
_STEP_S = 4e-6


class WakeDelay:
    """A running quantile of the delays of waits: ``late_s``.

    fraction : of the waits, 0 to 1, that end no later than ``late_s``. late_s : initial delay, seconds.
    """

    def __init__(self, fraction: float, late_s: float) -> None:
        self._up, self._down = fraction * _STEP_S, (1.0 - fraction) * _STEP_S
        self.late_s = late_s

    def note(self, late_s: float) -> None:
        """Update the quantile with the delay of one wait, seconds."""
        if late_s > self.late_s:
            self.late_s = min(self.late_s + self._up, MAX_DELAY_S)
        else:
            self.late_s = max(self.late_s - self._down, 0.0)
