"""Clocks that react to events: :class:`HurriedClock` ticks early on request, :class:`FedClock` follows another clock.

A command hurries the clock of the control loop, and each tick of the control loop feeds the clocks of the buses.
Otherwise a command would wait for two independent clocks, one after the other.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from controller.base.clock import Clock

_MAX_TICKS_PER_PERIOD = 2
"""The shortest time between two ticks is the period divided by this."""
_CREDIT_DIVISOR = 5
"""The time by which ticks may come early grows by the elapsed time divided by this, so a flood of commands cannot
double the rate."""
_MAX_DEBT_S = 0.1
"""Longest time by which a bus that ran on without feeds may be ahead of the control loop, and waits for it later."""
_FOLLOW_DIVISOR = 8
"""The deadlines of a fed clock move by the difference to its feeder divided by this."""


class HurriedClock(Clock):
    """A clock whose next tick can be brought forward, to half a period after the last one at the earliest.

    Later deadlines move with an early tick. A credit limits how much earlier than planned ticks come: at most one
    period, which is refilled slowly. So single commands are handled immediately, and a flood hardly raises the rate.
    The jitter of a hurried tick counts from the earliest time that it was allowed.
    """

    def __init__(self, rate_hz: float, *, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(rate_hz, now_ns=now_ns)
        self._hurried = threading.Event()
        self._tick_ns = self._hurried_ns = self._thread = 0
        self._credit_ns = 0  # the time by which the next ticks may precede their deadlines, in total

    def hurry(self) -> None:
        """Tick as soon as possible; any thread may call it. During a tick of the clock's own thread it does nothing."""
        if threading.get_ident() != self._thread:
            if not self._hurried.is_set():
                self._hurried_ns = self._now_ns()
            self._hurried.set()

    def _wait(self) -> int:
        self._thread, now = threading.get_ident(), self._now_ns()
        while now < (due := self._due_ns()):
            # waiting for an event that is set would return immediately
            self._sleep_s((due - now) / 1e9) if self._hurried.is_set() else self._hurried.wait((due - now) / 1e9)
            now = self._now_ns()
        self._hurried.clear()  # first, so that a command that comes while the tick reads hurries the next one
        credit_ns = min(self._credit_ns + (now - self._tick_ns) // _CREDIT_DIVISOR, self.period_ns)
        self._credit_ns = max(credit_ns - max(self._deadline_ns - now, 0), 0)
        self._deadline_ns, self._tick_ns = min(self._deadline_ns, now), now
        self.jitter_ms.add((now - due) / 1e6)
        return now

    def _due_ns(self) -> int:
        deadline = self._deadline_ns
        if not self._hurried.is_set():
            return deadline
        earliest = max(self._tick_ns + self.period_ns // _MAX_TICKS_PER_PERIOD, deadline - self._credit_ns)
        return min(deadline, max(self._hurried_ns, earliest))


class FedClock(Clock):
    """A clock that ticks when another clock feeds it, ``rate_hz`` times a second on average.

    Of several feeds in one period it ticks at the one nearest to its own deadline, and at an urgent one immediately,
    but not before half a period since the last tick. Without a feed it ticks half a feeding period after its deadline.
    The jitter of a tick is its distance from the deadline or, after an urgent feed, from the earliest time allowed.

    rate_hz : ticks per second. feed_s : time between feeds; 0 if nothing feeds the clock.
    """

    def __init__(self, rate_hz: float, feed_s: float = 0.0, *, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        super().__init__(rate_hz, now_ns=now_ns)
        self._condition = threading.Condition()
        # a clock that is faster than its feeder does not wait for it
        self._slack_ns = round(feed_s * 0.5e9) if feed_s * 1e9 <= 1.01 * self.period_ns else 0
        self._max_step_s = self.period_ns * 1e-9 + 0.5 * feed_s
        self._urgent = self._is_fed = False
        self._balance_s = 0.0  # time by which the feeder is ahead of this clock's steps
        self._feed_ns = self._urgent_ns = self._tick_ns = 0

    def feed(self, step_s: float, *, urgent: bool = False) -> None:
        """Report that the feeding clock has advanced by ``step_s``; any thread may call it."""
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
        earliest = self._tick_ns + self.period_ns // _MAX_TICKS_PER_PERIOD
        if self._urgent:
            return min(self._deadline_ns, max(self._urgent_ns, earliest))
        # if no feed is near, wait for the next one, which will be nearer to the deadline than the last
        return (
            max(self._deadline_ns - self._slack_ns, earliest) if self._is_near() else self._deadline_ns + self._slack_ns
        )

    def _is_near(self) -> bool:
        """Whether the last feed is the one nearest to the deadline."""
        return self._feed_ns > self._tick_ns and self._feed_ns >= self._deadline_ns - self._slack_ns

    def _keep_deadline(self, now: int) -> None:
        """Record the tick's distance from its deadline, and move the deadline: towards feeds, or to an urgent tick."""
        self._is_fed = self._urgent or self._is_near()
        due = self._deadline_ns
        if self._urgent:
            due, self._deadline_ns = self._due_ns(), min(self._deadline_ns, now)
        self.jitter_ms.add(abs(now - due) / 1e6)
        if self._is_fed:
            self._deadline_ns += (now - self._deadline_ns) // _FOLLOW_DIVISOR

    def _step_s(self, before_ns: int) -> float:
        """Return how far the feeder has advanced since the last tick, within a limit; a period if nothing fed."""
        with self._condition:
            period_s = self.period_ns * 1e-9
            step_s = min(max(self._balance_s, 0.0), self._max_step_s) if self._is_fed else period_s
            # time beyond the step is dropped, as skipped deadlines are
            self._balance_s = max(min(self._balance_s - step_s, 0.0), -_MAX_DEBT_S)
            self._urgent = False
        return step_s
