"""Offset of another process's clock, from questions and answers (NTP's exchange, RFC 5905, section 8)."""

from __future__ import annotations

from collections import deque

_KEPT = 16


class ClockOffset:
    """Estimates what has to be added to one's own clock to get another's.

    Of the last answers the one with the shortest round trip counts: its error is half of that at most.

    Attributes
    ----------
    offset_ns : the estimate; 0 before the first answer. error_ns : how far it is wrong at most; None before.
    """

    def __init__(self) -> None:
        self._answers: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.offset_ns = 0
        self.error_ns: int | None = None

    def add(self, asked_ns: int, received_ns: int, answered_ns: int, arrived_ns: int) -> None:
        """Take one exchange; the first and last time are of one's own clock. One that is impossible is left out."""
        trip = (arrived_ns - asked_ns) - (answered_ns - received_ns)
        if trip < 0:
            return
        self._answers.append((trip, ((received_ns - asked_ns) + (answered_ns - arrived_ns)) // 2))
        trip, self.offset_ns = min(self._answers)
        self.error_ns = trip // 2

    def forget(self) -> None:
        """Start again, with another clock."""
        self._answers.clear()
        self.offset_ns, self.error_ns = 0, None
