"""Clocks that follow events: one ticks early when it is hurried, one ticks when another clock has fed it.

A command hurries the control loop, and each tick of the control loop feeds the buses, so that a command waits for
neither of two clocks that drift past each other.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from controller.base.clock import Clock

_MOST_TICKS = 2
"""Ticks in the length of a period, at most: so much of it, one over this, lies between two ticks at least."""
_SPARE = 5
"""A clock that is hurried again and again gains one over this of the time: a flood must not double its rate."""
_LONGEST_DEBT_S = 0.1
"""For how long a bus that had to go on by itself waits at most, until the control loop has caught up."""
_FOLLOW = 8
"""How slowly the deadlines of a fed clock follow its feeder: by one over this of each difference."""


class HurriedClock(Clock):
    """A clock whose next tick can be brought forward, to half a period after the last one at the earliest.

    Later deadlines move with an early tick. By how much ticks come early is bounded: by a period at once, which comes
    back slowly. So a command now and then is acted on at once, and a flood hardly raises the rate. Its jitter is how
    late it came after it was hurried.
    """

    def __init__(self, rate_hz: float, *, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(rate_hz, now_ns=now_ns)
        self._hurried = threading.Event()
        self._tick_ns = self._hurried_ns = self._thread = 0
        self._credit_ns = 0  # how much earlier than their deadlines the next ticks may come

    def hurry(self) -> None:
        """Tick as soon as possible; any thread may call it. In a tick it does nothing: that one is not over."""
        if threading.get_ident() != self._thread:
            if not self._hurried.is_set():
                self._hurried_ns = self._now_ns()
            self._hurried.set()

    def _wait(self) -> int:
        self._thread, now = threading.get_ident(), self._now_ns()
        while now < (due := self._due_ns()):
            # an event that is set would not wait
            self._sleep_s((due - now) / 1e9) if self._hurried.is_set() else self._hurried.wait((due - now) / 1e9)
            now = self._now_ns()
        self._hurried.clear()  # before the tick reads what hurried it
        gained = min(self._credit_ns + (now - self._tick_ns) // _SPARE, self.period_ns)
        self._credit_ns = max(gained - max(self._deadline_ns - now, 0), 0)
        self._deadline_ns, self._tick_ns = min(self._deadline_ns, now), now
        self.jitter_ms.add((now - due) / 1e6)
        return now

    def _due_ns(self) -> int:
        deadline = self._deadline_ns
        if not self._hurried.is_set():
            return deadline
        earliest = max(self._tick_ns + self.period_ns // _MOST_TICKS, deadline - self._credit_ns)
        return min(deadline, max(self._hurried_ns, earliest))


class FedClock(Clock):
    """Ticks when it has been fed by the tick of another clock, ``rate_hz`` times a second on average.

    Of several feeds in one period it takes the one nearest to its own deadline, and an urgent one at once, but not
    before half a period since the last tick. A clock that is not fed ticks by itself, half a feeding period late.
    Its jitter is how far from its deadline it ticks, and how late after an urgent feed.

    rate_hz : ticks per second. feed_s : time between feeds; 0 for a clock that nothing feeds.
    """

    def __init__(self, rate_hz: float, feed_s: float = 0.0, *, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(rate_hz, now_ns=now_ns)
        self._condition = threading.Condition()
        # a bus faster than the control loop does not wait for it
        self._slack_ns = round(feed_s * 0.5e9) if feed_s * 1e9 <= 1.01 * self.period_ns else 0
        self._most_s = self.period_ns * 1e-9 + 0.5 * feed_s
        self._urgent = self._is_fed = False
        self._balance_s = 0.0  # fed, and not used by ticks
        self._feed_ns = self._urgent_ns = self._tick_ns = 0

    def feed(self, step_s: float, *, urgent: bool = False) -> None:
        """Report that the feeding clock has gone on by ``step_s``; any thread may call it."""
        with self._condition:
            self._balance_s += step_s
            self._feed_ns = self._now_ns()
            if urgent and not self._urgent:
                self._urgent, self._urgent_ns = True, self._feed_ns
            self._condition.notify()

    def _wait(self) -> int:
        with self._condition:
            while (now := self._now_ns()) < (due := self._due_ns()):
                self._condition.wait((due - now) / 1e9)
            self._keep_deadline(now)
            self._tick_ns = now
        return now

    def _due_ns(self) -> int:
        earliest = self._tick_ns + self.period_ns // _MOST_TICKS
        if self._urgent:
            return min(self._deadline_ns, max(self._urgent_ns, earliest))
        # without a near feed wait for the next one, which will be nearer to the deadline than the last
        return (
            max(self._deadline_ns - self._slack_ns, earliest) if self._is_near() else self._deadline_ns + self._slack_ns
        )

    def _is_near(self) -> bool:
        """Whether the last feed is the one nearest to the deadline."""
        return self._feed_ns > self._tick_ns and self._feed_ns >= self._deadline_ns - self._slack_ns

    def _keep_deadline(self, now: int) -> None:
        """Count how far the tick is from its deadline, which follows the feeder slowly, and any early tick at once."""
        self._is_fed = self._urgent or self._is_near()
        due = self._deadline_ns
        if self._urgent:
            due, self._deadline_ns = self._due_ns(), min(self._deadline_ns, now)
        self.jitter_ms.add(abs(now - due) / 1e6)
        if self._is_fed:
            self._deadline_ns += (now - self._deadline_ns) // _FOLLOW

    def _step_s(self, before_ns: int) -> float:
        """How far the feeder has gone on since the last tick, and a period without feeds; never much more than that."""
        with self._condition:
            period_s = self.period_ns * 1e-9
            step_s = min(max(self._balance_s, 0.0), self._most_s) if self._is_fed else period_s
            # what is more than a step is lost, as skipped deadlines are
            self._balance_s = max(min(self._balance_s - step_s, 0.0), -_LONGEST_DEBT_S)
            self._urgent = False
        return step_s
