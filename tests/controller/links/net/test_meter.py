"""Rate, jitter and loss of sources that are known."""

from __future__ import annotations

import numpy as np
import pytest

from controller.links.net.meter import Meter


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 200.0])
def test_rate_jitter_and_age_are_those_of_the_source(rate_hz: float) -> None:
    meter, rng = Meter(), np.random.default_rng(1)
    for n in range(400):
        meter.note(n / rate_hz + rng.uniform(-0.001, 0.001))
    report = meter.report(400 / rate_hz + 0.1)
    assert report["rate_hz"] == pytest.approx(rate_hz, rel=0.05)
    assert 0.2 < report["jitter_ms"] < 1.5
    assert report["age_s"] == pytest.approx(0.1 + 1 / rate_hz, abs=0.003)


@pytest.mark.parametrize("step", [1, 2])
def test_frames_are_lost_where_numbers_are_missing_whatever_the_usual_step(step: int) -> None:
    meter = Meter()
    numbers = [n * step for n in range(100) if n not in (50, 51, 70)]
    for n, number in enumerate(numbers):
        meter.note(n / 60, number)
    assert meter.lost == 3


def test_a_frame_that_comes_early_once_does_not_make_all_others_late() -> None:
    meter = Meter()
    for n in range(200):
        meter.note(n / 30, 2 * n - (n % 50 == 7))
    assert meter.lost == 0


def test_messages_that_were_not_read_are_not_lost() -> None:
    meter = Meter()
    meter.note(0.0, 1)
    meter.note(0.01, 2)
    meter.note(0.1, 12, skipped=9)
    assert (meter.lost, meter.frames) == (0, 12)


def test_frames_that_overtake_others_are_not_lost() -> None:
    meter, rng = Meter(), np.random.default_rng(3)
    for n, late in enumerate(rng.integers(0, 60, 500)):  # as a sender's numbers that go back and forth within a second
        meter.note(n / 60, 4_707_600 + n - int(late))
    assert meter.lost <= 60
    meter = Meter()
    for n, number in enumerate([1, 2, 4, 3, 5, 7, 8]):
        meter.note(n / 60, number)
    assert meter.lost == 1


@pytest.mark.parametrize("restarted", [0, 60_000_000])
def test_a_source_that_begins_anew_keeps_what_it_lost_and_loses_nothing_more(restarted: int) -> None:
    meter = Meter()
    for n, number in enumerate([50_000, 50_001, 50_003, 50_004, restarted, restarted + 1, restarted + 2]):
        meter.note(n / 60, number)
    assert meter.lost == 1


def test_a_silent_source_has_no_rate_and_midnight_loses_nothing() -> None:
    meter = Meter()
    assert meter.report(5.0) == {"rate_hz": 0.0, "jitter_ms": 0.0, "lost": 0, "age_s": None}
    for n, number in enumerate([5_183_998, 5_183_999, 0, 1]):
        meter.note(n / 60, number)
    assert meter.lost == 0 and meter.report(60.0)["rate_hz"] == 0.0


def test_averages_move_by_a_twentieth_and_pauses_are_left_out() -> None:
    meter = Meter()
    for now_s in (0.0, 0.02, 0.04, 0.08):
        meter.note(now_s)
    wanted = {"rate_hz": 47.6, "jitter_ms": 1.0, "lost": 0, "age_s": 0.02}
    assert meter.report(0.1) == wanted
    meter.note(5.0)
    assert meter.report(5.02) == wanted and meter.report(5.98)["rate_hz"] == 47.6
    assert meter.report(6.02)["rate_hz"] == 0.0


def test_messages_that_were_not_read_count_in_the_rate() -> None:
    meter = Meter()
    meter.note(0.0)
    meter.note(0.1, skipped=9)
    assert meter.report(0.1)["rate_hz"] == 100.0 and meter.frames == 11
    meter.note(2.1, skipped=9)  # 0.2 s each
    assert meter.report(2.1)["rate_hz"] < 100.0


@pytest.mark.parametrize(("number", "lost"), [(3002, 2999), (3003, 0), (-99, 0), (1, 0)])
def test_three_thousand_may_be_missing_at_once_and_beyond_a_source_has_begun_anew(number: int, lost: int) -> None:
    meter = Meter()
    for n, each in enumerate([100, 101, 102, 100 + number, 101 + number]):
        meter.note(n / 60, each)
    assert meter.lost == lost
