"""drivers.sim.serving.timeline: commands come at their times, alone and in a server."""

from __future__ import annotations

import logging
import math
import os
import threading
import time

import pytest

from drivers.sim.serving.serve import serve
from drivers.sim.serving.timeline import Timeline
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo


def test_commands_come_at_their_times() -> None:
    timeline, done = Timeline([(1.0, "a"), (2.0, "b"), (2.0, "c")]), []
    assert timeline.due_s == math.inf, "it has not begun"
    timeline.start(100.0)
    assert timeline.due_s == 101.0
    timeline.advance(100.9, done.append)
    assert done == []
    timeline.advance(102.0, done.append)
    assert done == ["a", "b", "c"] and timeline.due_s == math.inf


def test_a_loop_begins_again() -> None:
    timeline, done = Timeline([(0.5, "a"), (1.0, "b")], loop_s=2.0), []
    timeline.start(0.0)
    timeline.advance(4.6, done.append)
    assert done == ["a", "b", "a", "b", "a"] and timeline.due_s == 5.0


@pytest.mark.parametrize("loop_s", [1e-300, 1e-9])
def test_a_loop_that_is_always_behind_leaves_time_for_the_wire(loop_s: float) -> None:
    timeline, done = Timeline([(0.0, "a")], loop_s=loop_s), []
    timeline.start(100.0)
    timeline.advance(101.0, done.append)
    assert 1 < len(done) < 1000
    timeline.advance(101.0, done.append)
    assert len(done) < 2000


def test_a_server_plays_it_without_any_client(caplog: pytest.LogCaptureFixture) -> None:
    chain = Chain([SimulatedServo(1, now_s=time.monotonic())], time.monotonic())
    steps = [(0.0, "place 1 1000"), (0.0, "fault mute:1"), (0.05, "place 9 1"), (0.1, "clear"), (0.15, "fault alert:1")]
    stop_r, stop_w = os.pipe()
    thread = threading.Thread(target=serve, args=(chain,), kwargs={"timeline": Timeline(steps), "stop": stop_r})
    with caplog.at_level(logging.WARNING):
        thread.start()
        end_s = time.monotonic() + 20
        while [fault.kind for fault in chain.faults.active] != ["alert"] and time.monotonic() < end_s:
            time.sleep(0.01)
        os.close(stop_w)
        thread.join()
    os.close(stop_r)
    assert chain.servo(1).position_ticks(time.monotonic()) == 1000
    assert [fault.spec for fault in chain.faults.active] == ["alert:1"]
    assert "place 9 1: 'place 9 1': no simulated servo has id 9" in caplog.text
