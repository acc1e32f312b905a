"""drivers.sim.serving.virtual: a port whose time passes only when somebody waits."""

from __future__ import annotations

import pytest

from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError, PortLost, PortMissing
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import SERVOS

PING = bytes.fromhex("FFFFFD0001030001194E")
HOBBY = [ServoSpec(1, "jaw", "rc-180", -0.6, 0.4, 8.0, 200.0)]


def test_waiting_moves_the_clock_to_the_bytes_and_no_further() -> None:
    head = VirtualBus(SERVOS, faults=["unplug:at=1s:for=1s"])
    link, seen = head.link, []
    link.tap = lambda sent, data: seen.append((sent, len(data)))
    with pytest.raises(PortLost):
        link.write(b"")
    link.open()
    assert link.put(PING) == 10
    reply = link.read(0.1)
    assert (len(reply), head.clock()) == (14, pytest.approx(24 * 10 / 1e6 + 500e-6))
    assert link.read(0.2) == b""
    assert head.clock() == 0.2
    assert seen == [(True, 10), (False, 14)]
    with pytest.raises(PortLost, match="went away"):
        link.read(5.0)
    assert head.clock() == 1.0, "it goes away while one waits"
    link.close()
    with pytest.raises(PortMissing):
        link.open()
    head.clock.wait_until(2.5)
    link.open()
    assert link.is_open


def test_a_packet_that_never_ends_is_given_up_and_what_lies_in_it_is_heard() -> None:
    head = VirtualBus(SERVOS)
    head.link.open()
    head.link.write(bytes.fromhex("FFFFFD00010700") + PING)
    assert len(head.link.read(1.0)) == 14
    head.link.write(PING[:5])
    assert head.link.read(head.clock() + 1.0) == b""
    head.link.write(PING)
    assert len(head.link.read(head.clock() + 1.0)) == 14


def test_an_adapters_latency_timer_is_paid_for() -> None:
    head = VirtualBus(SERVOS, latency_s=0.016)
    head.link.open()
    head.link.write(PING)
    assert len(head.link.read(1.0)) == 14
    assert head.clock() == pytest.approx(24 * 10 / 1e6 + 500e-6 + 0.016)


def test_what_is_drained_has_been_paid_for() -> None:
    head = VirtualBus(SERVOS)
    head.link.open()
    head.link.write(PING)
    assert head.link.drain() == 0, "it has not arrived"
    assert head.link.drain(quiet_s=0.01) == 14


def test_a_board_has_no_servos_to_look_at_and_faults_must_be_readable() -> None:
    board = VirtualBus(HOBBY, "maestro", baud=115_200)
    with pytest.raises(TypeError, match="see line"):
        board.servo(1)
    with pytest.raises(DriverError, match="sneeze"):
        board.fault("sneeze:1")
    board.fault("mute:*")
    board.clear()
    assert board.line.faults.active == []


def test_the_same_run_gives_the_same_figures() -> None:
    def run() -> tuple[float, dict[str, int]]:
        head = VirtualBus(SERVOS, faults=["flip:*:p=0.2", "drop:*:p=0.1"], seed=5, driver={"watchdog_ms": 0})
        head.clear()
        with head.bus() as bus:
            bus.start()
            head.fault("flip:*:p=0.2", "drop:*:p=0.1")
            for _ in range(50):
                bus.write([0.1, 0.1, 0.1])
                bus.read()
                head.clock.sleep(0.01)
            head.clear()
            return head.clock(), bus.report().errors

    first = run()
    assert first[1]
    assert run() == first
