"""drivers.dynamixel.bus over a simulated wire: the contract, and what threatens a running bus as a whole.

Numbers are those of the fault list in docs/drivers.md. See test_telemetry.py and test_startup.py for the others.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus
from drivers.base.errors import NoReply, PortBusy, PortLost, PortMissing, ServoFault
from drivers.packets.packet import ErrorNumber, encode_status
from drivers.sim.serving.virtual import VirtualBus
from drivers.testing import ServoBus
from tests.drivers.contract import SERVOS, BusContract, read_until, settle
from tests.drivers.programs import RAISE, program
from tests.drivers.wire import Wire

CALM = {"margin_s": 0.5, "watchdog_ms": 0}
IDS = [servo.id for servo in SERVOS]


LIMITS = {1: (1657, 2309), 2: (1722, 2374), 7: (1983, 2765)}
"""Ticks of SERVOS' limits: 2048 + (zero_rad -+ angle) x 4096 / 2 pi, widened to whole ones."""


@pytest.fixture
def wire(tmp_path: Path, servo_bus: Callable[..., ServoBus]) -> Iterator[ServoBus]:
    simulated = servo_bus("xl330-m288", IDS, link=tmp_path / "by-id")
    yield simulated
    simulated.never_beyond_limits(LIMITS)


@pytest.fixture
def bus(wire: ServoBus) -> Iterator[Bus]:
    with open_bus("dynamixel", SERVOS, port=wire.port, **CALM) as running:
        running.start()
        yield running


class TestDynamixelBus(BusContract):
    @pytest.fixture
    def bus(self, wire: ServoBus) -> Bus:
        return open_bus("dynamixel", SERVOS, port=wire.port, **CALM)


class TestDynamixelBusFastReads(BusContract):
    @pytest.fixture
    def bus(self) -> Bus:
        return VirtualBus(SERVOS).bus(fast=True, **CALM)


class TestDynamixelBusXl320(BusContract):
    MODELS = ("xl320",) * 3
    SERVOS = tuple(replace(servo, model="xl320") for servo in SERVOS)
    STEP_RAD = np.deg2rad(300) / 1024
    VOLTS = 7.4

    @pytest.fixture
    def bus(self) -> Bus:
        return VirtualBus(self.SERVOS).bus(**CALM)


class TestDynamixelBusWithWatchdogs(BusContract):
    @pytest.fixture
    def bus(self) -> Bus:
        return VirtualBus(SERVOS).bus(margin_s=0.05, watchdog_ms=200)


def torques(wire: ServoBus) -> list[bool]:
    return [wire.servo(i).torque for i in IDS]


def goals(wire: ServoBus) -> list[int]:
    return [wire.servo(i).goal for i in IDS]


def positions(wire: ServoBus) -> list[int]:
    return [wire.servo(i).position_ticks for i in IDS]


def wait_until(done: Callable[[], bool], timeout_s: float = 60.0) -> None:
    end = time.monotonic() + timeout_s
    while not done():
        assert time.monotonic() < end
        time.sleep(0.005)


# ---------------------------------------------------------------------------- 2: unplugged and back


def test_unplugging_is_told_once_and_the_bus_comes_back_where_the_servos_are(wire: ServoBus, bus: Bus) -> None:
    settle(bus, [0.2, 0.2, 0.2])
    wait_until(lambda: positions(wire) == goals(wire))  # settled is near: the last steps are still to come
    before = goals(wire)
    wire.fault("unplug")
    with pytest.raises(PortLost, match="went away"):
        for _ in range(3):
            bus.write(np.zeros(3))
            bus.read()
    for use in (bus.read, lambda: bus.write(np.zeros(3)), lambda: bus.discover([1])):
        with pytest.raises(PortLost, match="is lost") as caught:
            use()
        assert "reconnect" in caught.value.hint
    assert bus.report().errors == {"port_lost": 1}
    with pytest.raises(PortMissing):
        bus.reconnect()
    assert bus.running

    assert goals(wire) == before, "none of the goals after the loss went out"
    wire.clear("unplug")
    wait_until(lambda: Path(wire.port).exists())
    bus.reconnect()
    assert torques(wire) == [True] * 3
    assert goals(wire) == positions(wire) == before
    settle(bus, [0.0, 0.0, 0.0])


def test_stop_while_unplugged_names_everybody(wire: ServoBus, bus: Bus) -> None:
    wire.fault("unplug")
    with pytest.raises(PortLost):
        bus.read()
    with pytest.raises(PortLost, match="not confirmed off") as caught:
        bus.stop()
    assert caught.value.servo_ids == bus.ids
    assert "power off" in caught.value.hint
    assert not bus.running
    wire.clear("unplug")


def test_stop_uses_an_adapter_that_is_back(wire: ServoBus, bus: Bus) -> None:
    wire.fault("unplug")
    with pytest.raises(PortLost):
        bus.read()
    wire.clear("unplug")
    wait_until(lambda: Path(wire.port).exists())
    bus.stop()
    assert torques(wire) == [False] * 3


def test_unplugging_in_the_middle_of_switching_off_is_told(wire: ServoBus) -> None:
    bus = open_bus("dynamixel", SERVOS, port=wire.port, **CALM)
    bus.open()
    bus.start()
    wire.fault("unplug")
    with pytest.raises(PortLost, match="not confirmed off") as caught:
        bus.close()
    assert caught.value.servo_ids == tuple(IDS)
    assert not bus.is_open


# ---------------------------------------------------------------------------- 3: every way out


@pytest.mark.slow
@pytest.mark.parametrize("how", [RAISE, "SIGINT", "SIGTERM", "SIGHUP"])
def test_every_way_out_switches_all_servos_off(wire: ServoBus, how: str) -> None:
    with program("dynamixel", SERVOS, wire.port, how, **CALM) as child:
        if how != RAISE:
            assert child.pid is not None
            os.kill(child.pid, getattr(signal, how))
        child.join(20)
        assert child.exitcode not in (0, None)
        assert torques(wire) == [False] * 3


def test_the_servos_stop_by_themselves_when_the_program_is_killed(wire: ServoBus) -> None:
    with program("dynamixel", SERVOS, wire.port, margin_s=0.5, watchdog_ms=400) as child:
        child.kill()
        child.join(20)
        wait_until(lambda: all(wire.servo(i).register("Bus Watchdog") == 255 for i in IDS))
        rest = [wire.servo(i).position_ticks for i in IDS]
        time.sleep(0.2)
        assert [wire.servo(i).position_ticks for i in IDS] == rest
    with open_bus("dynamixel", SERVOS, port=wire.port, **CALM) as bus:
        bus.start()
        settle(bus, [0.1, 0.1, 0.1])


# ---------------------------------------------------------------------------- 4: errors on the way out


@pytest.mark.slow
def test_the_first_error_is_told_and_the_one_of_closing_is_a_note(wire: ServoBus) -> None:
    bus = open_bus("dynamixel", SERVOS, port=wire.port, margin_s=0.5, watchdog_ms=0)
    with pytest.raises(ZeroDivisionError) as caught, bus:
        bus.start()
        wire.fault("mute:2")
        raise ZeroDivisionError
    assert any('"brow" (id 2)' in note for note in caught.value.__notes__)
    assert not bus.is_open


# ---------------------------------------------------------------------------- 10: somebody else has the port


def test_a_second_program_is_told_that_the_port_is_held(wire: ServoBus, bus: Bus) -> None:
    with pytest.raises(PortBusy):
        open_bus("dynamixel", SERVOS, port=wire.port).open()
    settle(bus, [0.1, 0.1, 0.1])


def test_an_interrupt_in_a_transaction_leaves_the_bus_usable(
    wire: ServoBus, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(bus._port.link, "read", interrupt)
        with pytest.raises(KeyboardInterrupt):
            bus.read()
    settle(bus, [0.1, 0.1, 0.1])


# ---------------------------------------------------------------------------- 16, 20: the watchdog, a stalled host


class Clock:
    """A clock the test may move on."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def __call__(self) -> float:
        return time.monotonic() + self.ahead_s


def test_a_tripped_watchdog_is_cleared_without_a_jump(wire: ServoBus) -> None:
    clock = Clock()
    with open_bus("dynamixel", SERVOS, port=wire.port, margin_s=0.5, watchdog_ms=2000, clock=clock) as bus:
        bus.start()
        settle(bus, [0.0, 0.0, 0.0])
        for i in IDS:
            wire.servo(i).put("Bus Watchdog", 255)
        clock.ahead_s = 5.0
        here = bus.read().position_rad
        sent = bus.write([0.4, 0.5, 0.9])
        assert np.abs(sent - here).max() < 8.0 * 0.2
        assert bus.report().errors == {"watchdog": 3}
        assert [wire.servo(i).register("Bus Watchdog") for i in IDS] == [100] * 3
        wire.servo(1).put("Bus Watchdog", 99)
        bus.read()
        assert wire.servo(1).register("Bus Watchdog") == 99, "cleared once and then left alone"
        settle(bus, [0.2, 0.2, 0.2])


def test_a_servo_is_sent_no_goals_until_its_watchdog_is_seen_to_be_cleared() -> None:
    """Its watchdog is cleared, but the reply is lost: it would obey goals that went far from it while it refused them.

    By the simulated clock, so that the second reply of the servo is the one that is lost.
    """
    wire = VirtualBus(SERVOS, driver={"margin_s": 0.02, "watchdog_ms": 200, "fast": False})
    with wire.bus() as bus:
        bus.start()
        cycles(wire, bus, [0.0, 0.0, 0.0], 20)
        here = wire.servo(2).goal
        wire.clock.sleep(0.3)
        wire.fault("drop:2:every=2:for=0.2s")
        for _ in range(2):
            bus.write([0.3, 0.3, 0.3])
            assert wire.servo(2).register("Bus Watchdog") == 0, "cleared, and the reply lost"
            assert wire.servo(2).goal == here and bus.driven.tolist() == [True, False, True]
        cycles(wire, bus, [0.3, 0.3, 0.3], 50)
        assert bus.driven.all() and wire.servo(2).register("Bus Watchdog") == 10
        assert bus.read().position_rad[1] == pytest.approx(0.3, abs=0.02)


def cycles(wire: VirtualBus, bus: Bus, target: list[float], count: int) -> None:
    """So many cycles of 20 ms by the simulated clock."""
    for _ in range(count):
        bus.write(target)
        bus.read()
        wire.clock.sleep(0.02)


def test_a_watchdog_is_armed_again_where_the_servo_stands_outside_its_own_limits(wire: ServoBus) -> None:
    """As a head that was placed by hand a few steps beyond them; a servo refuses goals outside of its limits."""
    wire.servo(2).put("Min Position Limit", 2000)
    wire.servo(2).place(1995)
    wire.fault("stall:2")
    with open_bus("dynamixel", SERVOS, port=wire.port, margin_s=0.5, watchdog_ms=2000) as bus:
        bus.start()
        wire.servo(2).put("Bus Watchdog", 255)
        read_until(bus, lambda state: "watchdog" in bus.report().errors and not bus._telemetry.tripped)
        assert wire.servo(2).register("Bus Watchdog") == 100
        assert wire.servo(2).goal == 2000


def test_a_watchdog_that_trips_unseen_is_found_in_turn(wire: ServoBus) -> None:
    with open_bus("dynamixel", SERVOS, port=wire.port, margin_s=0.5, watchdog_ms=2000) as bus:
        bus.start()
        wire.servo(2).put("Bus Watchdog", 255)
        settle(bus, [0.2, 0.2, 0.2])
        assert bus.report().errors_by_servo == {2: {"watchdog": 1}}


def test_a_stalled_host_sends_no_burst(wire: ServoBus) -> None:
    clock = Clock()
    with open_bus("dynamixel", SERVOS, port=wire.port, clock=clock, **CALM) as bus:
        bus.start()
        settle(bus, [-0.3, -0.3, -0.3])
        clock.ahead_s += 0.5
        last = bus.read().position_rad
        for _ in range(20):
            start = clock()
            sent = bus.write([0.4, 0.5, 0.9])
            reach = 8.0 * (clock() - start + 0.06)
            assert np.abs(sent - last).max() <= reach
            last = sent
            clock.ahead_s += 0.01


# ---------------------------------------------------------------------------- servos that let go


def test_a_servo_that_let_go_comes_back_only_when_asked(wire: ServoBus, bus: Bus) -> None:
    settle(bus, [0.2, 0.2, 0.2])
    wire.servo(2).latch(0x20)
    read_until(bus, lambda state: not state.torque[1])
    with pytest.raises(ServoFault, match="0x20"):
        bus.recover([2])
    wire.servo(2).place(2200)
    for _ in range(5):
        bus.write([0.1, 0.1, 0.1])
        bus.read()
    assert torques(wire) == [True, False, True]
    object.__setattr__(bus.policy, "reboot_faulted", True)
    bus.recover([2])
    assert torques(wire) == [True] * 3
    assert wire.servo(2).position_ticks == pytest.approx(2200, abs=3)
    settle(bus, [0.1, 0.1, 0.1])


def test_a_servo_that_is_gone_cannot_be_recovered(wire: ServoBus, bus: Bus) -> None:
    wire.fault("mute:2")
    bus._port.margin_s = 0.05
    with pytest.raises(NoReply, match="id 2"):
        bus.recover()
    assert torques(wire)[0]
    wire.clear()


def test_everybody_is_found_when_nobody_is_named(bus: Bus) -> None:
    assert [(info.id, info.model, info.firmware > 40) for info in bus.discover()] == [
        (i, "xl330-m288", True) for i in IDS
    ]


def test_a_servo_that_answers_only_with_an_error_is_passed_over() -> None:
    with Wire(lambda packet: [encode_status(packet.id, ErrorNumber.RESULT_FAIL)]) as far:
        bus = open_bus("dynamixel", SERVOS, port=far.path, margin_s=0.5)
        bus.open()
        assert bus.discover([1]) == []
        bus.close()


def test_an_absent_id_that_is_not_configured_owes_no_answer() -> None:
    wire = VirtualBus(SERVOS)
    with wire.bus(**CALM) as bus:
        assert [info.id for info in bus.discover([1, 9])] == [1]
        assert bus._port.suspects == set()
