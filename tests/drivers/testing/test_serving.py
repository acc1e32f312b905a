"""drivers.testing.serving: the same line behind a port in real time, and without one in time that a test steps."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import pytest
import serial

from drivers.base.errors import DriverError
from drivers.sim.serving.simulated import SimulatedBus
from drivers.sim.serving.virtual import VirtualClock
from drivers.sim.wire.simulator import make_line
from drivers.testing.records import Record
from drivers.testing.serving import OnPort, Serving, Stepped, stepped

PING = bytes.fromhex("FFFFFD0001030001194E")  # e-Manual, Protocol 2.0, Ping
ANSWER = 14


def make_stepped(now_s: float = 50.0, latency_s: float = 0.0) -> Stepped:
    line = make_line("dynamixel", [(1, "xl330-m288")], now_s, baud=1_000_000)
    return Stepped(line, VirtualClock(now_s), 1_000_000, latency_s)


@pytest.fixture
def on_port() -> Iterator[OnPort]:
    line = make_line("dynamixel", [(1, "xl330-m288")], time.monotonic(), baud=1_000_000)
    serving = OnPort(SimulatedBus([], line=line))
    yield serving
    serving.close()


# ---------------------------------------------------------------- stepped
def test_stepped_time_passes_only_when_it_is_stepped() -> None:
    serving = make_stepped()
    assert serving.port == "" and serving.clock() == 50.0
    serving.step(0.25)
    assert serving.clock() == 50.25
    serving.step(-1.0)
    assert serving.clock() == 50.25


def test_a_step_lets_the_far_end_do_what_is_due() -> None:
    serving = make_stepped()
    serving.fault(["mute:1:at=1s"])
    assert serving.line.faults.active == []
    serving.step(1.0)
    assert [fault.kind for fault in serving.line.faults.active] == ["mute"]  # though nobody wrote or read
    serving.clear(None)
    serving.fault(["mute:1:at=1s"])
    assert len(ping(serving)) == ANSWER
    serving.step(1.0)
    assert ping(serving) == b""


def ping(serving: Stepped) -> bytes:
    port = serving.serial(timeout=0.05)
    port.write(PING)
    found = bytes(port.read(ANSWER))
    port.close()
    return found


def test_bytes_that_pass_are_told_to_the_newest_record_alone() -> None:
    serving, first, second = make_stepped(), Record(0.0), Record(0.0)
    serving.record_to(first)
    assert len(ping(serving)) == ANSWER
    assert [(each.sent, each.size) for each in first.traffic] == [(True, len(PING)), (False, ANSWER)]
    assert [each.time_s for each in first.traffic] == sorted(each.time_s for each in first.traffic)
    assert first.traffic[0].time_s == 50.0 < first.traffic[1].time_s < 50.01
    serving.record_to(second)
    ping(serving)
    assert len(first.traffic) == 2 and len(second.traffic) == 2


def test_faults_are_set_and_cleared_by_kind() -> None:
    serving = make_stepped()
    serving.fault(["mute:1", "drop:*:p=0"])
    assert ping(serving) == b""
    serving.clear("drop")
    assert ping(serving) == b""
    serving.clear("mute")
    assert len(ping(serving)) == ANSWER
    serving.fault(["mute:1"])
    serving.clear(None)
    assert len(ping(serving)) == ANSWER and serving.line.faults.active == []
    with pytest.raises(DriverError):
        serving.fault(["mood:1"])


def test_an_adapter_holds_answers_back() -> None:
    times = []
    for latency_s in (0.0, 0.016):
        serving = make_stepped(latency_s=latency_s)
        assert len(ping(serving)) == ANSWER
        times.append(serving.clock())
    assert times[1] - times[0] == pytest.approx(0.016, abs=0.001)


def test_closing_and_waiting_change_nothing_without_a_port() -> None:
    serving = make_stepped()
    serving.sync()
    serving.close()
    assert serving.clock() == 50.0 and len(ping(serving)) == ANSWER


# ---------------------------------------------------------------- on a port
def test_a_port_is_opened_by_any_program_until_it_is_closed(on_port: OnPort) -> None:
    path = on_port.port
    assert path and on_port.baud == 1_000_000
    with serial.serial_for_url(path, 1_000_000, timeout=10) as port:
        port.write(PING)
        assert len(port.read(ANSWER)) == ANSWER
    on_port.close()
    assert not os.path.exists(path)


def test_what_was_written_to_a_port_has_been_carried_out_after_sync(on_port: OnPort) -> None:
    record = Record(on_port.clock())
    on_port.record_to(record)
    with serial.serial_for_url(on_port.port, 1_000_000, timeout=10) as port:
        port.write(3 * PING)
        on_port.sync()
        assert sum(each.size for each in record.traffic if each.sent) == 3 * len(PING)
        assert len(port.read(3 * ANSWER)) == 3 * ANSWER
    assert all(0.0 <= each.time_s - record.start_s < 60.0 for each in record.traffic)
    assert abs(on_port.clock() - time.monotonic()) < 60.0


def test_faults_of_a_port(on_port: OnPort) -> None:
    on_port.fault(["mute:1"])
    assert [fault.spec for fault in on_port.line.faults.active] == ["mute:1"]
    on_port.clear("drop")
    assert len(on_port.line.faults.active) == 1
    on_port.clear(None)
    assert on_port.line.faults.active == []


def test_only_stepped_time_can_be_stepped(on_port: OnPort) -> None:
    serving: Serving = make_stepped()
    assert stepped(serving) is serving
    with pytest.raises(DriverError, match="the time of a port runs by itself") as error:
        stepped(on_port)
    assert error.value.hint == "ask the fixture for stepped=True"
