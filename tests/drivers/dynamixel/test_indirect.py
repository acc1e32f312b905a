"""drivers.dynamixel.indirect: one read brings everything, byte by byte what the registers hold, or it is not used."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.dynamixel.indirect import pointers_of
from drivers.dynamixel.layout import INDIRECT, item_of
from drivers.packets.packet import Instruction
from drivers.sim import SimulatedBus
from drivers.tables.tables import ControlTable, Item, load_table
from tests.drivers.contract import SERVOS, read_until, settle

CALM = {"margin_s": 1.0, "watchdog_ms": 0}


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus(SERVOS) as simulated:
        yield simulated


@pytest.mark.parametrize(
    ("model", "firmware", "address", "data"),
    [
        ("xl330-m288", 52, 168, 208),
        ("xl330-m288", 50, 168, 224),
        ("xm430-w350", None, 168, 224),
        ("mx-28", None, 168, 224),
    ],
)
def test_where_the_pointers_lie_depends_on_model_and_firmware(
    model: str, firmware: int | None, address: int, data: int
) -> None:
    table = load_table(model, firmware)
    found = pointers_of(table)
    assert found is not None
    assert (found.address, found.block.address) == (address, data)
    items = [item for name in INDIRECT if (item := item_of(table, name)) is not None]
    targets = [at for item in items for at in range(item.address, item.end)]
    assert struct.unpack(f"<{len(targets)}H", found.values) == tuple(targets)
    assert found.block.size == len(targets) != 3
    assert min(targets) >= table.eeprom_end, "nothing but RAM is looked at"


def test_a_model_without_indirect_addressing_is_left_out() -> None:
    assert pointers_of(load_table("xl320")) is None


def test_everything_comes_with_one_read_and_nothing_permanent_is_written(wire: SimulatedBus) -> None:
    with open_bus("dynamixel", SERVOS, port=wire.path, slow_group=0, **CALM) as bus:
        bus.start()
        written = {servo.id: wire.servo(servo.id).eeprom_writes for servo in SERVOS}
        state = settle(bus, [0.2, 0.1, 0.3])
        before = wire.chain.packets
        state = bus.read()
        assert wire.chain.packets == before + 1
        assert state.torque.all()
        assert np.isfinite(state.temperature_c).all()
        assert np.isfinite(state.current_a).all()
        assert {servo.id: wire.servo(servo.id).eeprom_writes for servo in SERVOS} == written
        wire.servo(2).latch(0x20)
        state = bus.read()
        assert (state.hardware_error.tolist(), state.torque.tolist()) == ([0, 0x20, 0], [True, False, True])


@pytest.mark.parametrize("model", ["xl330-m288", "xm430-w350"])
def test_indirect_data_is_byte_for_byte_what_the_pointers_point_at(model: str) -> None:
    servo = ServoSpec(1, "jaw", model, -1.0, 1.0, 5.0, 50.0)
    with SimulatedBus([servo]) as wire, open_bus("dynamixel", [servo], port=wire.path, **CALM) as bus:
        bus.start()
        found = pointers_of(load_table(model))
        assert found is not None
        registers = wire.chain.servos[0].registers
        for name, item in found.block.items.items():
            real = item_of(load_table(model), name)
            assert real is not None
            assert registers.read(item.address, item.size) == registers.read(real.address, real.size), name


def test_a_servo_that_refuses_pointers_is_read_plainly(
    wire: SimulatedBus, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuser = wire.chain.servo(2)
    store = type(refuser)._store

    def deaf(self: object, item: object, value: int, now_s: float) -> None:
        if self is not refuser or not item.name.startswith("Indirect"):
            store(self, item, value, now_s)

    monkeypatch.setattr(type(refuser), "_store", deaf)
    with caplog.at_level(logging.WARNING), open_bus("dynamixel", SERVOS, port=wire.path, **CALM) as bus:
        bus.start()
        assert 'no indirect addressing for "brow" (id 2): slow values are read in turn' in caplog.text
        state = settle(bus, [0.2, 0.2, 0.2])
        assert state.fresh.all()
        assert read_until(bus, lambda s: bool(np.isfinite(s.temperature_c).all())).torque.all()
        assert bus.report().errors == {}


def test_mixed_models_are_read_with_one_bulk_read(monkeypatch: pytest.MonkeyPatch) -> None:
    servos = [SERVOS[0], ServoSpec(2, "eye", "xl320", -0.5, 0.5, 5.0, 100.0)]
    seen = []
    with SimulatedBus(servos) as wire, open_bus("dynamixel", servos, port=wire.path, slow_group=0, **CALM) as bus:
        bus.start()
        handle = wire.chain.handle
        monkeypatch.setattr(
            wire.chain, "handle", lambda packet, now_s: (seen.append(packet[1]), handle(packet, now_s))[1]
        )
        assert bus.read().fresh.all()
    assert [packet.instruction for packet in seen[:1]] == [Instruction.BULK_READ]
    reads = {Instruction.SYNC_READ, Instruction.BULK_READ, Instruction.FAST_SYNC_READ}
    assert [packet.instruction in reads for packet in seen[:2]] != [True, True], "and no second one"


def test_pointers_need_room_for_all_registers_and_must_reach_them() -> None:
    table = load_table("xl330-m288")
    needed = sum(item.size for name in INDIRECT if (item := item_of(table, name)) is not None)
    for room, fits in ((needed - 1, False), (needed, True), (needed + 1, True)):
        smaller = copy(table)
        smaller.indirect = ((168, 208, room),)
        assert (pointers_of(smaller) is not None) is fits
    smaller.indirect = ((1, 2, needed - 1), (168, 208, needed))
    found = pointers_of(smaller)
    assert found is not None and found.address == 168, "the first area with room"
    items = dict(table)
    targets = [at for name in INDIRECT if (item := item_of(table, name)) for at in range(item.address, item.end)]
    first = table["Indirect Address 1"]
    for low, high, reached in (
        (min(targets), max(targets), True),
        (min(targets) + 1, max(targets), False),
        (min(targets), max(targets) - 1, False),
    ):
        items["Indirect Address 1"] = replace(first, minimum=low, maximum=high)
        assert (pointers_of(_with(table, items)) is not None) is reached
    del items["Indirect Address 1"]
    assert pointers_of(_with(table, items)) is None


def _with(table: ControlTable, items: dict[str, Item]) -> ControlTable:
    changed = copy(table)
    changed.items_by_name = items
    return changed
