"""The clock keeps absolute deadlines and skips what it missed."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.clock import Clock, Samples


class Time:
    """A time source that only moves when told to."""

    def __init__(self) -> None:
        self.ns = 1_000

    def now(self) -> int:
        return self.ns

    def sleep(self, seconds: float) -> None:
        self.ns += round(seconds * 1e9)


def run(clock: Clock, time: Time, work_ns: list[int]) -> list[int]:
    """Tick once per entry of ``work_ns``, each tick taking that long; returns when ticks began."""
    began = []
    for now in clock.run(lambda: len(began) < len(work_ns)):
        began.append(now)
        time.ns += work_ns[len(began) - 1]
    return began


def test_ticks_stay_on_the_grid_of_deadlines() -> None:
    time = Time()
    clock = Clock(100.0, now_ns=time.now, sleep_s=time.sleep)
    began = run(clock, time, [3_000_000, 9_999_999, 0, 5_000_000])
    assert began == [1_000 + k * 10_000_000 for k in range(4)]
    assert clock.skipped == 0


def test_a_step_is_the_time_between_two_deadlines_also_where_some_were_skipped() -> None:
    time = Time()
    clock = Clock(100.0, now_ns=time.now, sleep_s=time.sleep)
    assert clock.step_s == pytest.approx(0.01)
    steps, work = [], iter([0, 35_000_000, 0])
    for _ in clock.run(lambda: len(steps) < 3):
        steps.append(clock.step_s)
        time.ns += next(work)
    assert steps == pytest.approx([0.01, 0.01, 0.04])


def test_a_tick_says_when_it_was_due_however_late_it_began() -> None:
    """Motion goes on by the time between these, so what is sent with this time is as far as its motion."""
    time, dues, steps = Time(), list[int](), list[float]()

    def oversleeps(seconds: float) -> None:
        time.ns += round(seconds * 1e9) + 3_000_000

    clock = Clock(100.0, now_ns=time.now, sleep_s=oversleeps)
    for now in clock.run(lambda: len(dues) < 5):
        assert now - clock.deadline_ns in (0, 3_000_000)
        dues.append(clock.deadline_ns)
        steps.append(clock.step_s)
        time.ns += 25_000_000 if len(dues) == 2 else 1_000_000
    assert np.diff(dues).tolist() == [10_000_000, 30_000_000, 10_000_000, 10_000_000]
    np.testing.assert_allclose(np.diff(dues) * 1e-9, steps[1:], rtol=1e-12)


@pytest.mark.parametrize("off_ns", [4_000_000, -4_000_000, 123_456_789_000])
def test_ticks_come_to_where_they_are_aligned_in_steps_that_stay_even(off_ns: int) -> None:
    time = Time()
    clock, began = Clock(100.0, now_ns=time.now, sleep_s=time.sleep), list[int]()
    for now in clock.run(lambda: len(began) < 60):
        began.append(now)
        clock.align(1_000 + off_ns)
    left = (began[-1] - 1_000 - off_ns + 5_000_000) % 10_000_000 - 5_000_000
    assert abs(left) < 10_000
    steps = np.diff(began)
    assert steps.min() >= 9_500_000 and steps.max() <= 10_500_000
    assert clock.step_s == pytest.approx(steps[-1] * 1e-9)


def test_a_clock_that_is_no_longer_aligned_keeps_its_grid() -> None:
    time = Time()
    clock, began = Clock(100.0, now_ns=time.now, sleep_s=time.sleep), list[int]()
    for now in clock.run(lambda: len(began) < 10):
        began.append(now)
        if len(began) == 1:
            clock.align(now + 2_000_000)
    assert np.diff(began).tolist() == [10_500_000, *[10_000_000] * 8]


def test_a_late_tick_skips_deadlines_and_does_not_hurry() -> None:
    time = Time()
    clock = Clock(100.0, now_ns=time.now, sleep_s=time.sleep)
    began = run(clock, time, [0, 35_000_000, 0, 0])
    assert [(b - 1_000) // 10_000_000 for b in began] == [0, 1, 5, 6]
    assert clock.skipped == 3


def test_a_prompt_clock_ticks_at_once_after_a_late_tick_and_never_faster_than_its_rate() -> None:
    time = Time()
    clock = Clock(100.0, now_ns=time.now, sleep_s=time.sleep, prompt=True)
    began = run(clock, time, [0, 35_000_000, 12_000_000, 4_000_000, 0, 0])
    assert [b - 1_000 for b in began] == [0, 10_000_000, 45_000_000, 57_000_000, 67_000_000, 77_000_000]
    assert clock.skipped == 0


def test_report_counts_rate_and_jitter() -> None:
    time = Time()
    clock = Clock(50.0, now_ns=time.now, sleep_s=lambda s: time.sleep(s + 0.002))
    run(clock, time, [0] * 11)
    report = clock.report()
    assert report["ticks"] == 11
    assert report["jitter_ms"]["max"] == pytest.approx(2.0)  # type: ignore[index]
    assert report["rate_hz"] == pytest.approx(11 / 0.202)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_rate_must_be_positive(rate: float) -> None:
    with pytest.raises(ValueError, match="rate_hz"):
        Clock(rate)


def test_samples_keep_the_newest_and_do_not_grow() -> None:
    samples = Samples(capacity=4)
    for value in range(10):
        samples.add(float(value))
    summary = samples.summary()
    assert samples.count == 10
    assert summary["p50"] == pytest.approx(7.5)
    assert summary["max"] == 9.0
    assert summary["mean"] == pytest.approx(4.5)
    assert Samples().summary() == {}


def test_summary_of_known_measurements() -> None:
    samples = Samples()
    for value in range(101):
        samples.add(value / 10)
    assert samples.summary() == pytest.approx({"mean": 5.0, "p50": 5.0, "p95": 9.5, "p99": 9.9, "max": 10.0})
    assert list(samples.summary()) == ["mean", "p50", "p95", "p99", "max"]


def test_report_of_a_clock_that_never_ran_and_of_one_that_skipped() -> None:
    clock = Clock(100.0)
    assert clock.report() == {"rate_hz": 0.0, "wanted_hz": 100.0, "ticks": 0, "skipped": 0, "jitter_ms": {}}
    time = Time()
    clock = Clock(100.0, now_ns=time.now, sleep_s=time.sleep)
    run(clock, time, [10_000_000, 25_000_000, 0])
    report = clock.report()
    assert (report["ticks"], report["skipped"], report["wanted_hz"]) == (3, 3, 100.0)
    assert report["rate_hz"] == pytest.approx(3 / 0.05)


def test_figures_of_a_report_are_exact() -> None:
    time = Time()
    clock = Clock(8.0, now_ns=time.now, sleep_s=lambda s: time.sleep(s + 0.0625))
    run(clock, time, [0] * 9)  # the first tick is on time, the others half a period late
    report = clock.report()
    assert report["rate_hz"] == 9 / 1.0625
    assert report["wanted_hz"] == 8.0
    assert report["jitter_ms"]["max"] == 62.5 and report["jitter_ms"]["p50"] == 62.5  # type: ignore[index]
    assert report["jitter_ms"]["mean"] == 8 * 62.5 / 9  # type: ignore[index]
    waits: list[float] = []
    clock = Clock(8.0, now_ns=time.now, sleep_s=lambda s: (waits.append(s), time.sleep(s)))
    run(clock, time, [0, 0])
    assert waits == [0.125] and Clock(1.0).period_ns == 10**9


def test_samples_fill_their_whole_room_and_the_usual_one_is_large() -> None:
    samples = Samples()
    for value in (7.0,) * 65536:
        samples.add(value)
    assert samples.summary()["p50"] == 7.0
    samples.add(-1.0)  # in place of the oldest
    assert samples.count == 65537 and np.isclose(samples.summary()["mean"], 7.0, atol=1e-3)
    assert samples.summary()["p50"] == 7.0 and samples.maximum == 7.0
