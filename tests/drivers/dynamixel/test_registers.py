"""drivers.dynamixel.registers: named registers, every answer checked, every failure with its servo."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers.base.errors import CorruptReply, NoReply, ServoRefused, merge_errors
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Packets
from drivers.servos.port import Port
from drivers.sim import SimulatedBus
from drivers.tables.tables import load_table
from tests.drivers.contract import SERVOS

IDS = [servo.id for servo in SERVOS]


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus(SERVOS) as simulated:
        yield simulated


@pytest.fixture
def registers(wire: SimulatedBus) -> Iterator[Registers]:
    port = Port(wire.path, margin_s=1.0)
    port.openPort()
    named = Registers(Packets(), port, SERVOS)
    named.tables = dict.fromkeys(IDS, load_table("xl330-m288"))
    yield named
    port.closePort()


def test_registers_are_read_and_written_by_name(wire: SimulatedBus, registers: Registers) -> None:
    registers.put(2, "speed_limit", 123)
    assert registers.get(2, "speed_limit") == wire.servo(2).register("Profile Velocity") == 123
    assert registers.get_all(IDS, "speed_limit") == {1: 0, 2: 123, 7: 0}
    registers.set_all({1: 5, 7: 9}, "speed_limit")
    assert registers.get_all(IDS, "speed_limit") == {1: 5, 2: 123, 7: 9}


def test_negative_values_keep_their_sign(wire: SimulatedBus, registers: Registers) -> None:
    wire.servo(2).put("Present Current", -1)
    wire.servo(2).place(0)
    assert registers.get(2, "position") == 0


def test_a_refusal_names_servo_register_and_reason(registers: Registers) -> None:
    registers.put(1, "torque", 1)
    with pytest.raises(ServoRefused, match=r'"jaw" \(id 1\) .* refused writing Operating Mode = 4: access') as caught:
        registers.put(1, "mode", 4)
    assert caught.value.servo_ids == (1,)
    assert caught.value.hint


def test_lost_answers_are_asked_for_again(wire: SimulatedBus, registers: Registers) -> None:
    registers.port.margin_s = 0.3
    wire.fault("drop:1:every=3")
    assert [registers.get(1, "torque") for _ in range(6)] == [0] * 6


@pytest.mark.slow
def test_silence_and_damage_are_told_apart(wire: SimulatedBus, registers: Registers) -> None:
    registers.port.margin_s = 0.1
    wire.fault("mute:1")
    with pytest.raises(NoReply, match=r'"jaw" \(id 1\) on .* at 1000000 baud did not answer reading Torque Enable'):
        registers.get(1, "torque")
    registers.port.margin_s = 0.3
    wire.fault("crc:2")
    with pytest.raises(CorruptReply, match='"brow"'):
        registers.get(2, "torque")


@pytest.mark.slow
def test_a_group_read_asks_the_missing_ones_again_and_names_all_that_fail(
    wire: SimulatedBus, registers: Registers
) -> None:
    wire.fault("drop:2:count=1")
    assert registers.get_all(IDS, "torque") == dict.fromkeys(IDS, 0)
    registers.port.margin_s = 0.1
    wire.fault("mute:1", "mute:7")
    with pytest.raises(NoReply, match="2 servos: ids 1, 7") as caught:
        registers.get_all(IDS, "torque")
    assert caught.value.servo_ids == (1, 7)


def test_models_without_a_register_are_left_out(registers: Registers) -> None:
    registers.tables[2] = load_table("xl320")
    assert registers.having(IDS, "watchdog") == [1, 7]
    assert set(registers.get_all(IDS, "watchdog")) == {1, 7}
    with pytest.raises(ServoRefused, match="xl320 has no Bus Watchdog"):
        registers.get(2, "watchdog")


def test_a_servo_without_a_name_is_called_by_its_id(registers: Registers) -> None:
    assert (registers.label(1), registers.label(99)) == ('"jaw" (id 1)', "id 99")


def test_errors_of_many_servos_become_one() -> None:
    one = NoReply("a", hint="h", port="p", servo_ids=(3,))
    assert merge_errors({3: one}) is one
    both = merge_errors({3: one, 1: CorruptReply("b", servo_ids=(1,))})
    assert isinstance(both, NoReply)
    assert (both.servo_ids, both.hint, both.port) == ((1, 3), "h", "p")
