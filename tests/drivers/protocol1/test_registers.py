"""drivers.protocol1.registers: read windows unlike their request, and error flags that refuse or only warn."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers.base.bus import ServoSpec
from drivers.base.errors import ServoRefused
from drivers.packets.packet1 import Error1, Packet1
from drivers.protocol1 import HELLO, WINDOW
from drivers.protocol1.bus import Protocol1Bus
from drivers.protocol1.registers import Registers, window
from drivers.servos.layout import NAMES, item_of
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import load_table

MODELS = {"mx1-28": "dynamixel", "ax-12a": "dynamixel", "sts3215": "feetech", "scs0009": "feetech"}


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    servos = [ServoSpec(i, f"s{i}", request.param, -0.5, 0.5, 4.0, 40.0) for i in (1, 2)]
    return VirtualBus(servos, MODELS[request.param], driver={"margin_s": 0.05, "watchdog_ms": 0})


@pytest.fixture
def registers(wire: VirtualBus) -> Iterator[Registers]:
    with wire.bus() as bus:
        assert isinstance(bus, Protocol1Bus)
        yield bus._registers


@pytest.mark.parametrize("model", MODELS)
def test_a_window_holds_its_register_and_ends_inside_the_table(model: str) -> None:
    table = load_table(model)
    for name in NAMES:
        if (item := item_of(table, name)) is None:
            continue
        at, size = window(table, item)
        assert at <= item.address
        assert item.end <= at + size <= table.size
        assert size == (1 if item.size == 1 else WINDOW)
        assert size not in (HELLO, 2)


@pytest.mark.parametrize("model", ["ax-12a", "mx1-28", "sts3215"])
def test_the_window_of_the_last_register_ends_with_the_table(model: str) -> None:
    table = load_table(model)
    last = max((item for item in table.values() if item.size == 2), key=lambda item: item.end)
    at, size = window(table, last)
    assert at <= last.address < last.end <= at + size <= table.size


def test_the_last_register_of_two_bytes_is_read_with_those_before_it(wire: VirtualBus, registers: Registers) -> None:
    table = registers.tables[1]
    words = [(item.end, name) for name in NAMES if (item := item_of(table, name)) and item.size == 2]
    for _, name in sorted(words)[-3:]:
        item = item_of(table, name)
        assert item is not None
        assert registers.get(1, name) == wire.servo(1).register(item.name)


def test_flags_of_the_last_reply_are_kept_by_servo(wire: VirtualBus, registers: Registers) -> None:
    wire.fault("temp:2:95")
    wire.servo(2).put("Torque Enable", 1)
    wire.clock.sleep(1.0)
    registers.get_all([1, 2], "temperature")
    assert registers.hardware_error(1) == 0
    assert registers.hardware_error(2) == registers.tables[2].hardware_error["temperature"]


def test_only_flags_about_the_state_are_causes(registers: Registers) -> None:
    known = sum(registers.tables[1].hardware_error.values())
    assert registers.causes(1, 0xFF) == known
    assert registers.causes(1, 0xFF & ~known) == 0


def test_a_refusal_names_its_flags_and_data_is_never_one(registers: Registers) -> None:
    assert registers.refusal(Packet1(1, Error1.RANGE | Error1.OVERLOAD, b"\1")) == ""
    both = Packet1(1, Error1.RANGE | Error1.ANGLE_LIMIT | Error1.OVERLOAD, b"")
    dynamixel = bool(registers.packets.refusals)
    assert registers.refusal(both) == ("angle limit, range" if dynamixel else "")
    assert registers.is_damaged(Packet1(1, Error1.CHECKSUM, b"")) is dynamixel
    assert not registers.is_damaged(Packet1(1, Error1.RANGE, b""))


def test_a_value_out_of_range_is_refused_where_the_family_says_so(wire: VirtualBus, registers: Registers) -> None:
    if not registers.packets.refusals:
        return  # Feetech passes over what it does not take, and says nothing
    with pytest.raises(ServoRefused, match=r'"s1" \(id 1\) on virtual refused writing Return Delay Time = 255: range'):
        registers.put(1, "return_delay", 255)
