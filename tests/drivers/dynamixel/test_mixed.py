"""drivers.dynamixel.mixed: servos of both protocols on one wire are one bus."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import BusError, NoReply, ServoFault, WrongModel
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import read_until, settle

CALM = {"margin_s": 1.0, "watchdog_ms": 0}
MODELS = ("xl330-m288", "ax-12a", "xl330-m288", "mx1-28")
SERVOS = tuple(
    ServoSpec(number, f"s{number}", model, -0.5, 0.5, 8.0, 200.0)
    for number, model in zip((5, 3, 1, 4), MODELS, strict=True)
)
STEP_RAD = np.deg2rad(300) / 1024


@pytest.fixture
def wire() -> VirtualBus:
    return VirtualBus(SERVOS)


def make(wire: VirtualBus, servos: tuple[ServoSpec, ...] = SERVOS, **options: object) -> Bus:
    return open_bus("dynamixel", servos, port=wire.link, clock=wire.clock, **(CALM | options))


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with make(wire) as running:
        running.start()
        yield running


def torques(wire: VirtualBus) -> list[bool]:
    return [wire.servo(servo.id).torque for servo in SERVOS]


def test_every_servo_is_driven_in_its_own_place(wire: VirtualBus, bus: Bus) -> None:
    state = settle(bus, [0.1, 0.2, -0.1, -0.2], 2 * STEP_RAD)
    ticks = [wire.servo(servo.id).position_ticks for servo in SERVOS]
    assert ticks == pytest.approx([2048 + 65, 512 + 39, 2048 - 65, 2048 - 130], abs=7)
    assert np.isfinite(state.current_a).tolist() == [True, False, True, False]
    assert np.isfinite(state.velocity_rad_s).all()


def test_what_one_half_needs_does_not_trouble_the_other(wire: VirtualBus) -> None:
    with make(wire, fast=True, singles=1, torque_limit=0.5, min_voltage_v=4.0) as bus:
        bus.start()
        assert [wire.servo(number).register("Torque Limit") for number in (3, 4)] == [512, 512]


@pytest.mark.parametrize(("number", "model"), [(3, "mx1-28"), (1, "xm430-w350")])
def test_a_wrong_model_in_one_half_leaves_nobody_on(wire: VirtualBus, number: int, model: str) -> None:
    servos = tuple(replace(s, model=model) if s.id == number else s for s in SERVOS)
    with make(wire, servos) as bus, pytest.raises(WrongModel) as caught:
        bus.start()
    assert caught.value.servo_ids == (number,)
    assert not any(torques(wire))


@pytest.mark.parametrize("number", [3, 1])
def test_a_dead_servo_of_one_half_leaves_no_other_on(wire: VirtualBus, number: int) -> None:
    bus = make(wire)
    with pytest.raises(NoReply) as caught, bus:
        bus.start()
        wire.fault(f"mute:{number}")
    assert caught.value.servo_ids == (number,)
    assert torques(wire) == [servo.id == number for servo in SERVOS]


def test_servos_that_held_go_on_holding_where_one_of_the_other_half_cannot_start(
    wire: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    with make(wire) as first:
        first.start()  # permanent settings are right from now on
    for number in (5, 4):
        wire.servo(number).put("Goal Position", wire.servo(number).position_ticks)
        wire.servo(number).put("Torque Enable", 1)
    with make(wire, watchdog_ms=200) as bus:
        registers = bus._old._registers
        original = registers.get_all
        far = {3: 50_000}
        monkeypatch.setattr(
            registers, "get_all", lambda ids, name: original(ids, name) | (far if name == "position" else {})
        )
        with pytest.raises(ServoFault, match="reads position 50000"):
            bus.start()
    assert torques(wire) == [True, False, False, True]
    assert wire.servo(5).register("Bus Watchdog") == 0


def test_halves_that_are_not_confirmed_off_are_switched_off_when_the_bus_is_closed(wire: VirtualBus) -> None:
    with make(wire, margin_s=0.05) as bus:
        bus.start()
        wire.fault("mute:3", "mute:1")
        with pytest.raises(NoReply) as caught:
            bus.stop()
        assert set(caught.value.servo_ids) == {1, 3}
        wire.clear()
    assert not any(torques(wire))


def test_counters_are_those_of_both_halves(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("mute:3", "mute:1")
    read_until(bus, lambda state: int(state.silent.sum()) == 2)
    bus.write([9.0, 0.4, 0.4, 9.0])
    report = bus.report()
    assert report.silent == (1, 3)
    assert report.errors == {"no_reply": 2}
    assert report.errors_by_servo == {1: {"no_reply": 1}, 3: {"no_reply": 1}}
    assert report.limits_hit == 2
    assert any("Return Delay Time" in line and "id 3" in line for line in report.eeprom_writes)
    wire.clear()
    read_until(bus, lambda state: bool(state.fresh.all()))


def test_nothing_is_recovered_before_the_start(wire: VirtualBus) -> None:
    with make(wire) as bus, pytest.raises(BusError, match="is not started"):
        bus.recover()
    assert not any(torques(wire))


def test_a_servo_of_either_half_is_recovered_where_it_is(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.1, 0.1, 0.1, 0.1], 2 * STEP_RAD)
    for number in (3, 1):
        wire.servo(number).latch(0x20)
    read_until(bus, lambda state: state.torque.tolist() == [True, False, False, True])
    with pytest.raises(ServoFault):
        bus.recover()
    assert dict(zip(bus.ids, bus.driven.tolist(), strict=True)) == {5: True, 3: False, 1: False, 4: True}
    for half in bus._halves:
        object.__setattr__(half.policy, "reboot_faulted", True)
    bus.recover([3, 1])
    assert all(torques(wire))
    wire.clock.sleep(0.05)
    settle(bus, [0.0, 0.0, 0.0, 0.0], 2 * STEP_RAD)


def test_a_servo_that_its_half_holds_back_is_driven_by_neither(wire: VirtualBus) -> None:
    """Its watchdog is cleared, but the reply is lost; goals begin where it is once that is confirmed."""
    with make(wire, margin_s=0.02, watchdog_ms=200, fast=False) as bus:
        bus.start()
        for _ in range(20):
            bus.write([0.0] * 4)
            bus.read()
            wire.clock.sleep(0.02)
        wire.clock.sleep(0.3)
        wire.fault("drop:1:every=2:for=0.2s")
        bus.write([0.3] * 4)
        at = bus.ids.index(1)
        assert not bus.driven[at] and bus.report().not_driven == (1,)
        for _ in range(60):
            bus.write([0.3] * 4)
            bus.read()
            wire.clock.sleep(0.02)
        assert bus.driven.all() and bus.report().not_driven == ()
        assert bus.read().position_rad[at] == pytest.approx(0.3, abs=0.02)


def test_everybody_is_found_in_either_protocol(wire: VirtualBus) -> None:
    with make(wire, margin_s=0.02) as bus:
        found = bus.discover([5, 3, 1, 4, 9])
        assert [(info.id, info.model) for info in found] == [
            (1, "xl330-m288"), (3, "ax-12a"), (4, "mx1-28"), (5, "xl330-m288")
        ]  # fmt: skip


def test_what_keeps_a_servo_out_grows_no_trace_of_every_attempt(
    wire: VirtualBus, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(index: int) -> float:
        raise BusError("it does not start")

    monkeypatch.setattr(bus._new, "_join", refuse)
    for each in (bus, bus._new):  # the first servo is the first of its half
        each._give_up(0, BusError("it is off"))
    for _ in range(50):
        bus.read()
        wire.clock.sleep(1.0)
    assert not bus.driven[0] and bus.driven[1:].all()
    assert len(traceback.extract_tb(bus._reasons[0].__traceback__)) < 5
