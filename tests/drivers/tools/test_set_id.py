"""drivers.tools.set_id over simulated servos: the id changes, or nothing does."""

from __future__ import annotations

import pytest

from drivers.base.bus import ServoInfo
from drivers.base.errors import CorruptReply, NoReply, ServoRefused
from drivers.packets.packet import MAX_ID
from drivers.servos import port
from drivers.sim import SimulatedBus
from drivers.tools import set_id as module
from drivers.tools.set_id import set_id

FAMILIES = [("xl330-m288", 2), ("xl320", 2), ("ax-12a", 1), ("sts3215", 1), ("scs0009", 1)]


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulated servo may answer late on a busy machine."""
    monkeypatch.setattr(port, "reply_margin_s", lambda path: 0.15)


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_a_servo_answers_under_its_new_id(model: str, protocol: int) -> None:
    with SimulatedBus([1, 5], model=model) as bus:
        info = set_id(bus.path, 1_000_000, protocol, 1, 7)
        assert (info.id, info.model) == (7, model)
        assert bus.servo(7).register("ID") == 7
        assert bus.servo(5).eeprom_writes == {}


def test_feetech_memory_is_closed_again() -> None:
    with SimulatedBus([1], model="sts3215") as bus:
        servo = bus.servo(1)
        servo.put("Lock", 1)
        set_id(bus.path, 1_000_000, 1, 1, 2)
        assert (servo.register("ID"), servo.register("Lock")) == (2, 1)


def test_feetech_memory_is_closed_again_where_the_id_was_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedBus([1], model="sts3215") as bus:
        bus.servo(1).put("Lock", 1)
        write = module._write

        def ignore_id(registers: object, servo: int, name: str, value: int) -> None:
            if name != "ID":
                write(registers, servo, name, value)

        monkeypatch.setattr(module, "_write", ignore_id)
        monkeypatch.setattr(module, "SETTLE_S", 0.1)
        with pytest.raises(ServoRefused, match="did not take the id 2"):
            set_id(bus.path, 1_000_000, 1, 1, 2)
        bus.sync()
        assert bus.servo(1).register("Lock") == 1


def test_an_id_stays_where_the_motor_does_not_switch_off(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedBus([1], model="sts3215") as bus:
        _switch_on(bus, "sts3215")
        write, names = module._write, []

        def ignore_torque(registers: object, servo: int, name: str, value: int) -> None:
            names.append(name)
            if name != "Torque Enable":
                write(registers, servo, name, value)

        monkeypatch.setattr(module, "_write", ignore_torque)
        with pytest.raises(ServoRefused, match="did not switch its motor off"):
            set_id(bus.path, 1_000_000, 1, 1, 2, release=True)
        assert names == ["Torque Enable"]


@pytest.mark.parametrize(("model", "protocol"), FAMILIES)
def test_a_taken_id_changes_nothing(model: str, protocol: int) -> None:
    with SimulatedBus([1, 5], model=model) as bus:
        with pytest.raises(ServoRefused, match=r"5 .* is taken"):
            set_id(bus.path, 1_000_000, protocol, 1, 5)
        assert bus.servo(1).eeprom_writes == {}


@pytest.mark.parametrize(("model", "protocol"), [("xl330-m288", 2), ("sts3215", 1)])
def test_a_servo_that_holds_is_left_alone_unless_it_may_be_released(model: str, protocol: int) -> None:
    with SimulatedBus([1], model=model) as bus:
        servo = bus.servo(1)
        _switch_on(bus, model)
        with pytest.raises(ServoRefused, match="holds with torque"):
            set_id(bus.path, 1_000_000, protocol, 1, 2)
        assert servo.torque
        assert set_id(bus.path, 1_000_000, protocol, 1, 2, release=True).torque is False
        assert servo.register("ID") == 2


def _switch_on(bus: SimulatedBus, model: str) -> None:
    """By a program that went away without switching off."""
    import serial

    from drivers.packets import packet, packet1

    v2 = packet.encode_instruction(1, 3, bytes((64, 0, 1)))
    v1 = packet1.encode(1, 3, bytes((40, 1)))
    with serial.Serial(bus.path, 1_000_000, timeout=10) as port:
        port.write(v1 if model.startswith("sts") else v2)
        assert port.read(6)


@pytest.mark.parametrize("protocol", [1, 2])
def test_nobody_there_is_told_with_the_next_step(protocol: int) -> None:
    with SimulatedBus([1]) as bus, pytest.raises(NoReply, match="no servo has the id 9") as caught:
        set_id(bus.path, 1_000_000, protocol, 9, 2)
    assert "omote scan" in caught.value.hint


@pytest.mark.parametrize(("model", "protocol"), [("xl330-m288", 2), ("sts3215", 1)])
def test_two_servos_with_the_old_id_are_left_alone(model: str, protocol: int) -> None:
    with SimulatedBus([3, 3], model=model) as bus:
        bus.servo(3).place(1200)
        with pytest.raises(CorruptReply) as caught:
            set_id(bus.path, 1_000_000, protocol, 3, 9)
        assert "two servos may have this id" in caught.value.hint
        assert bus.servo(3).eeprom_writes == {}


@pytest.mark.parametrize(("model", "protocol"), [("xl330-m288", 2), ("sts3215", 1), ("ax-12a", 1)])
def test_an_id_whose_servo_loses_replies_does_not_count_as_free(model: str, protocol: int) -> None:
    with SimulatedBus([1, 5], model=model) as bus:
        bus.fault("drop:5:count=2")
        with pytest.raises(ServoRefused, match=r"the id 5 on .* is taken by another"):
            set_id(bus.path, 1_000_000, protocol, 1, 5)
        assert bus.servo(1).eeprom_writes == {}


@pytest.mark.parametrize(("old", "new", "name"), [(-1, 2, "old"), (1, 253, "new"), (1, 254, "new")])
def test_ids_that_no_servo_may_have_are_refused(old: int, new: int, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        set_id("/dev/null", 1_000_000, 2, old, new)


def test_a_servo_that_keeps_its_id_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedBus([1, 5]) as bus:
        monkeypatch.setattr(module, "SETTLE_S", 0.0)
        with pytest.raises(ServoRefused, match=r"servo 1 .* did not take the id 7") as caught:
            set_id(bus.path, 1_000_000, 2, 1, 7)
        assert caught.value.servo_ids == (1,)
        monkeypatch.setattr(module, "_await", lambda registers, servo: ServoInfo(servo, 9999, "other", 1))
        with pytest.raises(ServoRefused, match=r"servo 5 .* did not take the id 8"):
            set_id(bus.path, 1_000_000, 2, 5, 8)


def test_the_memory_of_an_ax_which_opens_only_without_power_is_not_closed() -> None:
    with SimulatedBus([1], model="ax-12a") as bus:
        set_id(bus.path, 1_000_000, 1, 1, 2)
        assert bus.servo(2).register("Lock") == 0


def test_the_first_and_the_last_id_are_allowed_and_its_own_id_is_not_taken() -> None:
    with SimulatedBus([0, 251]) as bus:
        assert set_id(bus.path, 1_000_000, 2, 0, MAX_ID).id == MAX_ID
        assert set_id(bus.path, 1_000_000, 2, 251, 0).id == 0
        assert set_id(bus.path, 1_000_000, 2, 0, 0).id == 0
        assert bus.servo(0).register("ID") == 0


@pytest.mark.slow
@pytest.mark.parametrize(("model", "protocol"), [("xl330-m288", 2), ("sts3215", 1)])
def test_both_protocols_are_tried(model: str, protocol: int) -> None:
    with SimulatedBus([1, 5], model=model) as bus:
        assert set_id(bus.path, 1_000_000, None, 1, 7).model == model
        assert bus.servo(7).register("ID") == 7
        with pytest.raises(NoReply, match="no servo has the id 1 "):
            set_id(bus.path, 1_000_000, None, 1, 8)


def test_a_servo_of_each_protocol_with_the_old_id_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedBus([1], model="xl330-m288") as bus:
        monkeypatch.setattr(module, "_find", lambda registers, servo: ServoInfo(servo, 1200, "any", 1))
        with pytest.raises(ServoRefused, match=r"2\.0 and one of Protocol 1\.0 have the id 1") as caught:
            set_id(bus.path, 1_000_000, None, 1, 7)
        assert "--protocol" in caught.value.hint
        assert bus.servo(1).eeprom_writes == {}
