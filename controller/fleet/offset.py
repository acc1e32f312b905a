"""Estimates the offsets of other processes' clocks from queries and answers (NTP's exchange, RFC 5905, section 8).

Monotonic clocks of two machines are independent, so each conductor has its own offset. Before the first answer, the
offset is estimated from messages: each was sent before it arrived, so the one that took the least time is the best.
"""

from __future__ import annotations

import threading
from collections import OrderedDict, deque
from dataclasses import dataclass, field

_MAX_ANSWERS, _MAX_CLOCKS = 16, 16


class ClockOffset:
    """Estimates what has to be added to the local clock to get another's.

    It uses the one of the last answers with the shortest round trip; its error is at most half of that.

    Attributes
    ----------
    offset_ns : the estimate; 0 before the first answer. error_ns : bound of its error; None before the first answer.
    """

    def __init__(self) -> None:
        self._answers: deque[tuple[int, int]] = deque(maxlen=_MAX_ANSWERS)
        self.offset_ns = 0
        self.error_ns: int | None = None

    def add(self, asked_ns: int, received_ns: int, answered_ns: int, arrived_ns: int) -> None:
        """Add one exchange, with the first and last time by the local clock; an impossible one is ignored."""
        trip = (arrived_ns - asked_ns) - (answered_ns - received_ns)
        if trip < 0:
            return
        self._answers.append((trip, ((received_ns - asked_ns) + (answered_ns - arrived_ns)) // 2))
        trip, self.offset_ns = min(self._answers)
        self.error_ns = trip // 2

    @property
    def answers(self) -> int:
        """Number of answers in use, at most 16."""
        return len(self._answers)


@dataclass
class _Known:
    """Estimates of one clock. asked : from queries. heard_ns : from messages; None before the first one."""

    asked: ClockOffset = field(default_factory=ClockOffset)
    heard_ns: int | None = None


class Clocks:
    """The clocks of the newest conductors, by their numbers. Any thread may call it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[int, _Known] = OrderedDict()
        self.answered_ns = 0
        """Time of the last answer of any conductor, by the local clock; 0 before the first."""

    def add(self, holder: int, asked_ns: int, received_ns: int, answered_ns: int, arrived_ns: int) -> None:
        """Add one exchange with a conductor, as :meth:`ClockOffset.add`."""
        with self._lock:
            self.answered_ns = max(self.answered_ns, arrived_ns)
            self._of(holder).asked.add(asked_ns, received_ns, answered_ns, arrived_ns)

    def hear(self, holder: int, sent_ns: int, arrived_ns: int) -> None:
        """Note the arrival of a message that a conductor sent at ``sent_ns`` of its clock."""
        with self._lock:
            known, least = self._of(holder), sent_ns - arrived_ns
            known.heard_ns = least if known.heard_ns is None else max(known.heard_ns, least)

    def answers(self, holder: int) -> int:
        """Return the number of answers of a conductor in use."""
        with self._lock:
            return self._known[holder].asked.answers if holder in self._known else 0

    def offset_ns(self, holder: int) -> int:
        """Return what has to be added to the local clock to get a conductor's; 0 for an unknown conductor."""
        with self._lock:
            known = self._known.get(holder)
            if known is None:
                return 0
            return known.asked.offset_ns if known.asked.answers else known.heard_ns or 0

    def _of(self, holder: int) -> _Known:
        """Return the estimates of a clock; add a new one and drop the oldest if there are too many."""
        if holder not in self._known:
            self._known[holder] = _Known()
            if len(self._known) > _MAX_CLOCKS:
                self._known.popitem(last=False)
        return self._known[holder]
