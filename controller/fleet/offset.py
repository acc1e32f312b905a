"""Offsets of other processes' clocks, from questions and answers (NTP's exchange, RFC 5905, section 8).

Monotonic clocks of two machines have nothing in common, so each conductor has an offset of its own. Before the first
answer, what arrives says it: a message was sent before it arrived, so of the messages heard the one that took the least
time comes nearest.
"""

from __future__ import annotations

import threading
from collections import OrderedDict, deque
from dataclasses import dataclass, field

_KEPT, _CLOCKS = 16, 16


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

    @property
    def answers(self) -> int:
        """How many answers it has, at most 16."""
        return len(self._answers)


@dataclass
class _Known:
    """asked : by questions. heard_ns : by messages; None before the first one."""

    asked: ClockOffset = field(default_factory=ClockOffset)
    heard_ns: int | None = None


class Clocks:
    """The clocks of conductors by their numbers; of the newest few. Any thread may call it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[int, _Known] = OrderedDict()
        self.answered_ns = 0
        """When a conductor answered last, by one's own clock; 0 before."""

    def add(self, holder: int, asked_ns: int, received_ns: int, answered_ns: int, arrived_ns: int) -> None:
        """Take one exchange with a conductor, as :meth:`ClockOffset.add`."""
        with self._lock:
            self.answered_ns = max(self.answered_ns, arrived_ns)
            self._of(holder).asked.add(asked_ns, received_ns, answered_ns, arrived_ns)

    def hear(self, holder: int, sent_ns: int, arrived_ns: int) -> None:
        """Note when a message arrived that a conductor sent at ``sent_ns`` of its clock."""
        with self._lock:
            known, least = self._of(holder), sent_ns - arrived_ns
            known.heard_ns = least if known.heard_ns is None else max(known.heard_ns, least)

    def answers(self, holder: int) -> int:
        """How many answers of a conductor there are."""
        with self._lock:
            return self._known[holder].asked.answers if holder in self._known else 0

    def offset_ns(self, holder: int) -> int:
        """What has to be added to one's own clock to get that of a conductor; 0 for one that was never heard."""
        with self._lock:
            known = self._known.get(holder)
            if known is None:
                return 0
            return known.asked.offset_ns if known.asked.answers else known.heard_ns or 0

    def _of(self, holder: int) -> _Known:
        """What is known of a clock, from nothing on for a new one; then the oldest one of many goes."""
        if holder not in self._known:
            self._known[holder] = _Known()
            if len(self._known) > _CLOCKS:
                self._known.popitem(last=False)
        return self._known[holder]
