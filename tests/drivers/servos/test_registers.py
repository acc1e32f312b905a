"""drivers.servos.registers: registers by name in every protocol: retries, refusals, errors about many servos."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from drivers.base.bus import Bus
from drivers.base.errors import CorruptReply, NoReply, PortLost, ServoRefused
from drivers.servos.registers import MAX_TRIES, Registers
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import load_table
from tests.drivers.contract import SERVOS

MODELS = {"xl330-m288": "dynamixel", "mx1-28": "dynamixel", "ax-12a": "dynamixel", "sts3215": "feetech"}
IDS = [servo.id for servo in SERVOS]


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    servos = [replace(servo, model=request.param) for servo in SERVOS]
    return VirtualBus(servos, MODELS[request.param], driver={"margin_s": 0.05, "watchdog_ms": 0})


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with wire.bus() as opened:
        yield opened


@pytest.fixture
def registers(bus: Bus) -> Registers[Any]:
    return bus._registers


def test_what_is_written_is_in_the_servo_and_read_again(wire: VirtualBus, registers: Registers[Any]) -> None:
    registers.put(2, "goal", 900)
    assert registers.get(2, "goal") == wire.servo(2).register("Goal Position") == 900
    registers.put_unanswered(7, "goal", 901)
    assert registers.get(7, "goal") == wire.servo(7).register("Goal Position") == 901
    registers.set_all({1: 800, 7: 850}, "goal")
    assert registers.get_all(IDS, "goal") == {1: 800, 2: 900, 7: 850}


def test_a_write_that_did_not_arrive_is_written_again(
    wire: VirtualBus, registers: Registers[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registers, "put_all", lambda values, name: None)
    registers.set_all({1: 800, 7: 850}, "goal")
    assert [wire.servo(i).register("Goal Position") for i in (1, 7)] == [800, 850]


def test_a_register_that_a_model_lacks_is_left_out_or_refused(registers: Registers[Any]) -> None:
    assert registers.item(1, "lock") is None or registers.item(1, "watchdog") is None
    name = "watchdog" if registers.item(1, "watchdog") is None else "phase"
    assert registers.having(IDS, name) == []
    assert registers.get_all(IDS, name) == {}
    assert registers.frames({1: 1}, name) == []
    with pytest.raises(ServoRefused, match=f"{registers.tables[1].model} has no") as caught:
        registers.get(1, name)
    assert caught.value.servo_ids == (1,)


def test_a_register_is_asked_for_a_few_times_and_no_more(wire: VirtualBus, registers: Registers[Any]) -> None:
    wire.fault(f"drop:2:count={MAX_TRIES - 1}")
    assert registers.get(2, "voltage") > 0
    wire.clear()
    wire.fault("drop:2")
    with pytest.raises(NoReply) as caught:
        registers.get(2, "voltage", tries=2)
    assert caught.value.servo_ids == (2,)
    assert '"brow" (id 2)' in str(caught.value)
    assert "did not answer reading" in str(caught.value)
    assert "cable" in caught.value.hint


def test_damage_is_told_from_silence(wire: VirtualBus, registers: Registers[Any]) -> None:
    wire.fault("crc:2")
    with pytest.raises(CorruptReply, match="damaged answer") as caught:
        registers.get(2, "voltage")
    assert "two servos may have this id" in caught.value.hint


def test_many_that_fail_are_one_error_of_the_first_ones_kind(wire: VirtualBus, registers: Registers[Any]) -> None:
    wire.fault("drop:2", "drop:7")
    with pytest.raises(NoReply) as caught:
        registers.get_all(IDS, "voltage")
    assert caught.value.servo_ids == (2, 7)
    asked: list[int] = []
    with pytest.raises(NoReply):
        registers.each(IDS, lambda servo: asked.append(servo) or registers.get(servo, "voltage", tries=1))
    assert asked == IDS, "one that fails does not keep the others from their turn"


def test_a_servo_without_a_name_is_called_by_its_id(registers: Registers[Any]) -> None:
    assert registers.label(9) == "id 9"
    assert registers.label(1) == '"jaw" (id 1)'


def test_a_servo_is_described(wire: VirtualBus, registers: Registers[Any]) -> None:
    table = registers.tables[1]
    wire.fault("temp:1:41")
    info = registers.info(1, table.number, 3, lambda: table)
    assert (info.id, info.model, info.firmware, info.temperature_c) == (1, table.model, 3, 41.0)
    assert info.voltage_v == pytest.approx(table.voltage / 10, abs=0.11)
    assert (info.hardware_error, info.torque) == (0, False)
    registers.put(1, "torque", 1)
    assert registers.info(1, table.number, 3, lambda: table).torque is True


def test_a_servo_of_an_unknown_model_or_that_stops_answering_keeps_its_identity(
    wire: VirtualBus, registers: Registers[Any]
) -> None:
    unknown = registers.info(1, 4321, 3, lambda: load_table(4321))
    assert (unknown.model_number, unknown.model, unknown.voltage_v, unknown.torque) == (4321, "model 4321", None, None)
    wire.fault("mute:1")
    table = registers.tables[1]
    assert registers.info(1, table.number, 3, lambda: table).voltage_v is None
    wire.fault("unplug")
    with pytest.raises(PortLost):
        registers.info(1, table.number, 3, lambda: table)
