"""drivers.servos.bus: recovery, limits and counters of buses of every protocol."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers.base.bus import Bus
from drivers.base.errors import BusError, NoReply, PortLost, ServoFault
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import SERVOS, read_until, settle

MODELS = {"xl330-m288": "dynamixel", "mx1-28": "dynamixel", "ax-12a": "dynamixel", "sts3215": "feetech"}


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    servos = [replace(servo, model=request.param, max_speed_rad_s=1.5) for servo in SERVOS]
    return VirtualBus(servos, MODELS[request.param], driver={"margin_s": 0.05, "watchdog_ms": 0})


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with wire.bus() as running:
        running.start()
        yield running
        wire.clear()


def test_a_port_is_open_between_open_and_close(wire: VirtualBus) -> None:
    bus = wire.bus()
    assert not bus.is_open
    bus.open()
    assert bus.is_open
    assert bus.path == "virtual"
    bus.close()
    assert not bus.is_open


def test_recovery_begins_where_the_servo_is_and_leaves_the_others_alone(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.1, 0.1, 0.1], 0.02)
    wire.clock.sleep(0.5)
    others = [wire.servo(i).position_ticks for i in (1, 7)]
    wire.servo(2).put("Torque Enable", 0)
    read_until(bus, lambda state: not state.torque[1])
    wire.servo(2).place(wire.servo(2).position_ticks - round(0.3 / bus.scale.rad_per_tick[1]))
    here = wire.servo(2).position_ticks
    wire.servo(2).put("Goal Position", here)
    bus.recover([2])
    assert wire.servo(2).torque
    sent = bus.write([0.1, 0.1, 0.1])
    there = bus.scale.radians(np.array([0, here, 0]))[1]
    assert there == pytest.approx(0.4, abs=0.03)
    assert abs(sent[1] - there) < 0.1, "a ramp begins at the new position"
    assert [wire.servo(i).position_ticks for i in (1, 7)] == pytest.approx(others, abs=1)
    wire.clock.sleep(1.0)
    settle(bus, [0.1, 0.1, 0.1], 0.02)


def test_recovering_nobody_in_particular_means_all(wire: VirtualBus, bus: Bus) -> None:
    for servo in (1, 7):
        wire.servo(servo).put("Torque Enable", 0)
    bus.recover()
    assert [wire.servo(servo.id).torque for servo in SERVOS] == [True] * 3
    assert read_until(bus, lambda state: bool(state.torque.all())).torque.all()


def test_a_bus_that_is_not_started_recovers_nobody(wire: VirtualBus, bus: Bus) -> None:
    """Nothing would switch them off again, as stop() of a stopped bus does nothing."""
    bus.stop()
    with pytest.raises(BusError, match="is not started"):
        bus.recover()
    assert [wire.servo(servo.id).torque for servo in SERVOS] == [False] * 3


def test_what_does_not_answer_cannot_be_recovered(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("mute:7")
    with pytest.raises(NoReply) as caught:
        bus.recover()
    assert caught.value.servo_ids == (7,)


def test_one_that_cannot_be_recovered_leaves_the_others_holding(
    wire: VirtualBus, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    wire.servo(1).put("Torque Enable", 0)
    wire.servo(2).put("Torque Enable", 0)
    original = bus._registers.get_all

    def far(ids: list[int], name: str) -> dict[int, int]:
        return original(ids, name) | ({2: 50_000} if name == "position" and 2 in ids else {})

    monkeypatch.setattr(bus._registers, "get_all", far)
    off: list[bool] = []
    wire.link.tap = lambda sent, data: off.append(not wire.servo(7).torque)
    with pytest.raises(ServoFault, match="reads position 50000") as caught:
        bus.recover()
    wire.link.tap = None
    assert caught.value.servo_ids == (2,)
    assert [wire.servo(servo.id).torque for servo in SERVOS] == [True, False, True]
    assert not any(off)
    assert bus.running
    monkeypatch.undo()
    bus.recover()
    assert [wire.servo(servo.id).torque for servo in SERVOS] == [True] * 3


def test_all_that_cannot_be_recovered_are_named(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("mute:7", "mute:1")
    with pytest.raises(NoReply) as caught:
        bus.recover()
    assert caught.value.servo_ids == (1, 7)
    assert wire.servo(2).torque


def test_one_that_cannot_be_recovered_is_driven_no_longer_and_joins_where_it_is(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.1, 0.1, 0.1], 0.02)
    step = bus.scale.rad_per_tick[1]
    wire.fault("hw:2:0x20")
    read_until(bus, lambda state: not state.torque[1])
    assert bus.report().not_driven == ()
    with pytest.raises(ServoFault, match="0x20"):
        bus.recover([2])
    assert bus.driven.tolist() == [True, False, True]
    assert bus.report().not_driven == (2,)
    goal = wire.servo(2).goal
    for _ in range(20):
        bus.write([0.2, -0.2, 0.2])
        bus.read()
        wire.clock.sleep(0.1)
    assert not wire.servo(2).torque, "nobody reboots it unasked"
    assert wire.servo(2).goal == goal, "it is sent no goals"
    wire.chain.servo(2).reboot(wire.clock())  # somebody has switched its power off and on
    wire.servo(2).place(wire.servo(2).position_ticks - round(0.1 / step))
    here = wire.servo(2).position_ticks
    sent = [0.0, 0.0, 0.0]
    end = wire.clock() + 10.0
    while not bus.driven[1]:
        bus.read()
        sent = bus.write([0.2, -0.2, 0.2]).tolist()
        wire.clock.sleep(0.02)
        assert wire.clock() < end
    assert sent[1] == pytest.approx(bus.scale.radians(np.array([0, here, 0]))[1], abs=0.1), "a ramp begins there"
    settle(bus, [0.2, -0.2, 0.2], 0.02)


def test_permanent_writes_are_reported_once(wire: VirtualBus) -> None:
    wire.servo(2).put("Return Delay Time", 250)
    with wire.bus() as bus:
        bus.start()
        written = [line for line in bus.report().eeprom_writes if '"brow"' in line]
        assert written == ['servo "brow" (id 2): Return Delay Time 250 -> 0']
        count = len(bus.report().eeprom_writes)
        bus.recover()
        assert len(bus.report().eeprom_writes) == count


def test_discovery_describes_who_answers(wire: VirtualBus, bus: Bus) -> None:
    wire.fault("temp:7:44")
    found = {info.id: info for info in bus.discover([1, 3, 7])}
    assert list(found) == [1, 7]
    assert {info.model for info in found.values()} == {wire.servos[0].model}
    assert found[7].temperature_c == 44.0
    assert found[1].torque is True
    assert found[1].voltage_v == pytest.approx(found[7].voltage_v)


def test_a_lost_port_is_counted_and_the_bus_starts_again_where_the_servos_are(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.2, 0.2, 0.2], 0.02)
    wire.fault("unplug:for=1s")
    with pytest.raises(PortLost):
        bus.read()
    assert not bus.is_open
    with pytest.raises(PortLost, match="is lost"):
        bus.write([0.0, 0.0, 0.0])
    wire.clock.sleep(1.5)
    bus.reconnect()
    assert bus.report().errors["port_lost"] == 1
    sent = bus.write([0.2, 0.2, 0.2])
    np.testing.assert_allclose(sent, 0.2, atol=0.03)


def test_replies_under_another_id_are_counted_as_stray(wire: VirtualBus, bus: Bus) -> None:
    assert bus.report().stray == 0
    wire.fault("wrongid:2:9:count=1")
    assert bus.discover([2]) == []
    assert bus.report().stray == 1
