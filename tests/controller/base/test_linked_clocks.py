"""A hurried clock ticks early, a fed clock ticks with its feeder; both keep the time that motion is given."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from controller.base.clock import Clock
from controller.base.linked_clocks import FedClock, HurriedClock

MS = 1_000_000
BEGIN_NS = 10**9
Event = tuple[int, Callable[[], None]]


class Time:
    """A time source that moves when something waits, and acts at given times while it does."""

    def __init__(self) -> None:
        self.ns = BEGIN_NS
        self.events: list[Event] = []

    def now(self) -> int:
        return self.ns

    def wait(self, seconds: float) -> bool:
        """Move on to the next event, which ends a wait, or by so many seconds."""
        until = self.ns + max(round(seconds * 1e9), 1)
        if self.events and self.events[0][0] <= until:
            at, act = self.events.pop(0)
            self.ns = max(self.ns, at)
            act()
        else:
            self.ns = until
        return True


class Condition:
    """A condition of one thread, whose waits move the time."""

    def __init__(self, time: Time) -> None:
        self.wait = time.wait

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def notify(self) -> None:
        pass


class Flag:
    """An event of one thread, whose waits move the time."""

    def __init__(self, time: Time) -> None:
        self.wait, self._set = time.wait, False

    def set(self) -> None:
        self._set = True

    def clear(self) -> None:
        self._set = False

    def is_set(self) -> bool:
        return self._set


def hurried(time: Time) -> HurriedClock:
    """A clock of 100 Hz on that time, hurried by events."""
    clock = HurriedClock(100.0, now_ns=time.now)
    clock._hurried, clock._sleep_s = Flag(time), time.wait  # type: ignore[assignment]
    return clock


def fed(time: Time, rate_hz: float = 100.0, feed_s: float = 0.01) -> FedClock:
    clock = FedClock(rate_hz, feed_s, now_ns=time.now)
    clock._condition = Condition(time)  # type: ignore[assignment]
    return clock


def ticks(clock: Clock, time: Time, count: int, work_ns: int = 0) -> Iterator[tuple[float, float]]:
    """When each tick began (ms) and the time it was given (ms)."""
    for now in itertools.islice(clock.run(lambda: True), count):
        yield round((now - BEGIN_NS) / MS, 3), round(clock.step_s * 1e3, 3)
        time.ns += work_ns


def from_outside(act: Callable[[], None]) -> Callable[[], None]:
    """The same, called in another thread."""

    def run() -> None:
        thread = threading.Thread(target=act)
        thread.start()
        thread.join()

    return run


def feeds(time: Time, clock: FedClock, at_ms: list[float], step_s: float = 0.01) -> None:
    time.events = [(BEGIN_NS + round(at * MS), lambda: clock.feed(step_s)) for at in at_ms]


def test_a_clock_that_nobody_hurries_keeps_its_deadlines() -> None:
    time = Time()
    assert list(ticks(hurried(time), time, 4, 3 * MS)) == [(0, 10), (10, 10), (20, 10), (30, 10)]


def test_a_hurried_tick_comes_at_once_and_later_ones_a_period_after_it() -> None:
    time = Time()
    clock = hurried(time)
    time.events = [(BEGIN_NS + 17 * MS, from_outside(clock.hurry))]
    assert list(ticks(clock, time, 4)) == [(0, 10), (10, 10), (17, 7), (27, 10)]
    assert clock.skipped == 0 and clock.jitter_ms.maximum == 0.0


def test_a_hurried_tick_keeps_half_a_period_from_the_last_one() -> None:
    time = Time()
    clock = hurried(time)
    time.events = [(BEGIN_NS + at * MS, from_outside(clock.hurry)) for at in (11, 12, 16)]
    assert list(ticks(clock, time, 5)) == [(0, 10), (10, 10), (15, 5), (20, 5), (30, 10)]


@pytest.mark.parametrize(("every_ms", "most_hz", "late_ms"), [(1, 121, 9), (1000 / 60, 121, 0.1), (150, 107, 0.0)])
def test_a_flood_hardly_raises_the_rate_and_a_stream_is_acted_on_at_once(
    every_ms: float, most_hz: float, late_ms: float
) -> None:
    """``late_ms`` : how long 95 of 100 commands wait at most for a tick."""
    time = Time()
    clock = hurried(time)
    sent = np.arange(every_ms, 1900.0, every_ms)
    with ThreadPoolExecutor(1) as other:
        time.events = [(BEGIN_NS + round(at * MS), lambda: other.submit(clock.hurry).result()) for at in sent.tolist()]
        began = np.array([at for at, _ in ticks(clock, time, round(2.0 * most_hz))])
    assert began[-1] > 2000.0
    waited = began[np.searchsorted(began, np.round(sent, 3))] - sent
    assert np.percentile(waited[3:], 95) <= late_ms


@pytest.mark.parametrize(("at", "tick", "late"), [(17, 18.5, 1.5), (12, 15.0, 0.0), (19.5, 21.0, 1.5)])
def test_how_late_a_hurried_tick_comes_counts_as_jitter(at: float, tick: float, late: float) -> None:
    """From when it was hurried, or from the half period that it has to keep."""
    time = Time()
    clock = hurried(time)

    def slow() -> None:
        from_outside(clock.hurry)()
        time.ns += round(1.5 * MS)

    time.events = [(BEGIN_NS + round(at * MS), slow)]
    assert [began for began, _ in ticks(clock, time, 3)] == [0, 10, tick]
    assert clock.jitter_ms.maximum == late


def test_the_ticking_thread_does_not_hurry_itself() -> None:
    time = Time()
    clock = hurried(time)
    began = []
    for now in itertools.islice(clock.run(lambda: True), 3):
        began.append((now - BEGIN_NS) // MS)
        clock.hurry()
    assert began == [0, 10, 20]


def test_hurry_wakes_a_clock_that_waits() -> None:
    clock = HurriedClock(0.01)  # the next deadline is 100 s away
    ticked = threading.Semaphore(0)
    going = threading.Event()
    going.set()

    def run() -> None:
        for _ in clock.run(going.is_set):
            ticked.release()
            clock.period_ns = 2 * MS  # the half period after which hurry may act

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ticked.acquire(timeout=30)
    clock.hurry()
    assert ticked.acquire(timeout=30)
    going.clear()
    clock.hurry()
    thread.join(30)
    assert not thread.is_alive()


def test_a_clock_that_nothing_feeds_ticks_by_itself() -> None:
    time = Time()
    assert list(ticks(fed(time, feed_s=0.0), time, 4, 2 * MS)) == [(0, 10), (10, 10), (20, 10), (30, 10)]


def test_a_fed_clock_ticks_with_its_feeder() -> None:
    time = Time()
    clock = fed(time)
    feeds(time, clock, [3 + 10 * k for k in range(40)])
    began = list(ticks(clock, time, 40, 6 * MS))
    assert [at for at, _ in began] == [3 + 10 * k for k in range(40)]
    assert [step for _, step in began[1:]] == [10] * 39
    assert clock.skipped == 0 and clock.jitter_ms.summary()["p50"] < 0.3, "its deadlines have followed the feeder"


def test_a_bus_of_half_the_rate_takes_every_other_feed() -> None:
    time = Time()
    clock = fed(time, 50.0)
    feeds(time, clock, [1 + 10 * k for k in range(20)])
    began = list(ticks(clock, time, 8))
    assert [at for at, _ in began] == [1 + 20 * k for k in range(8)]
    assert [step for _, step in began[1:]] == [20] * 7


def test_other_rates_are_kept_on_average_and_so_is_the_time_of_motion() -> None:
    time = Time()
    clock = fed(time, 60.0)
    feeds(time, clock, [10.0 * k for k in range(400)])
    began = list(ticks(clock, time, 200))
    assert began[-1][0] == pytest.approx(200 / 60 * 1e3, rel=0.02)
    assert all(at % 10 == 0 for at, _ in began), "each with a feed"
    assert sum(step for _, step in began) == pytest.approx(began[-1][0], rel=0.02)


def test_a_bus_faster_than_the_feeder_goes_on_between_feeds() -> None:
    time = Time()
    clock = fed(time, 200.0)
    feeds(time, clock, [10.0 * k + 4.0 for k in range(20)])
    began = list(ticks(clock, time, 20))
    assert np.diff([at for at, _ in began]) == pytest.approx(5.0, abs=0.01)


def test_an_urgent_feed_is_taken_at_once_but_not_before_half_a_period() -> None:
    time = Time()
    clock = fed(time, 50.0)
    feeds(time, clock, [10.0 * k for k in range(5)])
    time.events += [
        (BEGIN_NS + 52 * MS, lambda: clock.feed(0.012, urgent=True)),
        (BEGIN_NS + 56 * MS, lambda: clock.feed(0.004, urgent=True)),
    ]
    began = list(ticks(clock, time, 6))
    assert [at for at, _ in began][:3] == [0, 20, 40]
    assert began[3] == (52, 12)
    assert began[4] == (62, 4), "fed at 56, half a period after the last"
    assert began[5][0] == 82 + 5, "nothing feeds it any more"


def test_how_late_an_urgent_feed_is_taken_counts_as_jitter() -> None:
    time = Time()
    clock = fed(time)
    feeds(time, clock, [10.0 * k for k in range(3)])

    def late() -> None:
        clock.feed(0.007, urgent=True)
        time.ns += round(1.5 * MS)

    time.events.append((BEGIN_NS + 27 * MS, late))
    assert [at for at, _ in ticks(clock, time, 4)] == [0, 10, 20, 28.5]
    assert clock.jitter_ms.maximum == 1.5


def test_a_feeder_that_stands_still_does_not_stop_the_bus_and_no_time_counts_twice() -> None:
    time = Time()
    clock = fed(time)
    feeds(time, clock, [0, 10, 20])
    time.events += [(BEGIN_NS + 106 * MS, lambda: clock.feed(0.086)), (BEGIN_NS + 116 * MS, lambda: clock.feed(0.01))]
    began = list(ticks(clock, time, 13))
    assert [at for at, _ in began] == [0, 10, 20, *range(35, 106, 10), 110, 116]
    assert max(step for _, step in began) <= 15, "a long pause is no leap"
    assert sum(step for _, step in began) <= 116 + 10 + 5


def test_a_cycle_that_takes_too_long_skips_a_deadline() -> None:
    time = Time()
    clock = fed(time)
    feeds(time, clock, [10.0 * k for k in range(30)])
    began = list(ticks(clock, time, 10, 12 * MS))
    assert np.diff([at for at, _ in began]).min() >= 12 and clock.skipped >= 8
    assert max(step for _, step in began) <= 15
