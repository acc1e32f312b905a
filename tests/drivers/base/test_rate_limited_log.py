"""drivers.base.rate_limited_log: every fault is told at once, and none again and again."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from drivers.base.bus import ServoSpec
from drivers.base.rate_limited_log import BURST, MAX_TEXTS, RateLimitedLogger
from drivers.sim.serving.virtual import VirtualBus, VirtualClock

IDS = range(1, 13)


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def say(clock: VirtualClock, caplog: pytest.LogCaptureFixture) -> RateLimitedLogger:
    caplog.set_level(logging.WARNING)
    return RateLimitedLogger(logging.getLogger("drivers.test"), clock)


def test_a_fault_is_told_at_once_and_again_with_how_often(
    say: RateLimitedLogger, clock: VirtualClock, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(30):
        say("servo %d stopped", 7)
        clock.sleep(0.5)
    assert caplog.messages == ["servo 7 stopped", "servo 7 stopped (20 times in 10 s)"]


def test_different_faults_do_not_hide_each_other(say: RateLimitedLogger, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(3):
        for servo in range(250):
            say("servo %d stopped", servo)
    assert caplog.messages == [f"servo {servo} stopped" for servo in range(250)]


def test_what_was_said_before_comes_at_a_bounded_rate_whoever_it_is_about(
    say: RateLimitedLogger, clock: VirtualClock, caplog: pytest.LogCaptureFixture
) -> None:
    for servo in range(250):
        say("servo %d stopped", servo)
    caplog.clear()
    for _ in range(60):
        clock.sleep(1.0)
        for servo in range(250):
            say("servo %d stopped", servo)
    assert BURST <= len(caplog.messages) <= BURST + 60


def test_texts_are_not_kept_for_ever(say: RateLimitedLogger) -> None:
    for number in range(3 * MAX_TEXTS):
        say("refused line %d", number)
    assert len(say._logged) == MAX_TEXTS


@pytest.mark.slow
def test_many_servos_that_come_and_go_are_all_told_and_flood_no_log(caplog: pytest.LogCaptureFixture) -> None:
    """A head with a bad cable: what was counted is in the report, the log stays readable."""
    specs = [ServoSpec(i, f"s{i}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in IDS]
    head = VirtualBus(specs, driver={"margin_s": 0.004})
    with head.bus() as bus, caplog.at_level(logging.WARNING):
        bus.start()
        for at in range(60):
            loose = [f"mute:{i}:for=0.4s" for i in IDS if (i + at) % 3 == 0]
            head.fault(*(loose if at % 4 else ["alert:*:for=0.5s"]))
            for _ in range(12):
                bus.write(np.zeros(len(specs)))
                bus.read()
                head.clock.sleep(0.08)
        head.clock.sleep(2.0)
    told = {message.split(" (id")[0] + message.partition(")")[2].split(" (")[0] for message in caplog.messages}
    for i in IDS:
        assert {f'servo "s{i}" stopped answering', f'servo "s{i}" reports a hardware error'} <= told
    assert sum(bus.report().errors.values()) > 100
    assert len(caplog.messages) <= len(told) + BURST + head.clock()
