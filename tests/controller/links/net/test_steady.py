"""controller.links.net.steady"""

from __future__ import annotations

import time

import numpy as np

from controller.links.net.steady import SteadyThread
from tests.controller.links.net.sockets import wait_for


def test_it_calls_at_its_rate_until_it_is_stopped() -> None:
    times: list[float] = []
    thread = SteadyThread("steady", 0.02, times.append)
    thread.start()
    wait_for(lambda: len(times) >= 10)
    thread.stop()
    count = len(times)
    time.sleep(0.06)
    assert len(times) == count
    assert np.diff(times).min() > 0.0 and (times[-1] - times[0]) / (count - 1) > 0.0199


def test_turns_that_come_too_late_are_left_out() -> None:
    times: list[float] = []

    def slow(now_s: float) -> None:
        times.append(now_s)
        time.sleep(0.05 if len(times) == 1 else 0.0)

    thread = SteadyThread("steady", 0.01, slow)
    thread.start()
    wait_for(lambda: len(times) >= 8)
    thread.stop()
    assert times[1] - times[0] >= 0.05
    apart_s = np.diff(times)
    late = (apart_s > 0.015).sum()  # the first turn is; on a busy machine others may be, too
    assert (apart_s < 0.001).sum() <= late, "five turns were missed, and do not come all at once"


def test_it_can_be_stopped_before_it_was_started() -> None:
    SteadyThread("steady", 0.01, lambda now_s: None).stop()
