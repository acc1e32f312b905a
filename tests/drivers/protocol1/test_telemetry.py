"""drivers.protocol1.telemetry: blocks and rows of each model, and who is read when servos answer one by one."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.base.bus import ServoSpec
from drivers.packets.packet import ALERT
from drivers.packets.packet1 import Instruction1, Packet1, Reader1
from drivers.protocol1.telemetry import GoalRows, layout_of
from drivers.servos.layout import Group
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import load_table
from tests.drivers.contract import read_until

CALM = {"margin_s": 0.05, "watchdog_ms": 0}


def bus_of(model: str, ids: range, family: str = "dynamixel", **options: object) -> VirtualBus:
    servos = [ServoSpec(i, f"s{i}", model, -0.5, 0.5, 4.0, 40.0) for i in ids]
    return VirtualBus(servos, family, driver=CALM | options)


@pytest.mark.parametrize(
    ("model", "goal", "full", "position", "slow"),
    [
        ("ax-12a", (30, 4), (36, 8), (36, 4), [(24, 12), (40, 4)]),
        ("mx1-28", (30, 4), (36, 8), (36, 4), [(24, 12), (40, 4)]),
        ("sts3215", (42, 6), (56, 15), (56, 4), [(40, 10), (60, 7)]),
        ("scs0009", (42, 6), (56, 11), (56, 4), [(40, 1), (60, 7)]),
    ],
)
def test_blocks_are_those_of_the_makers_tables(
    model: str, goal: tuple[int, int], full: tuple[int, int], position: tuple[int, int], slow: list[tuple[int, int]]
) -> None:
    table = load_table(model)
    layout, short = layout_of(table), layout_of(table, "position")
    assert (layout.goal.address, layout.goal.size) == goal
    assert (layout.feedback.address, layout.feedback.size) == full
    assert (short.feedback.address, short.feedback.size) == position
    assert [(block.address, block.size) for block in short.slow] == slow
    assert [(block.address, block.size) for block in layout.slow] == slow[:1]
    assert layout.manner == table.group_read


@pytest.mark.parametrize(("model", "order"), [("sts3215", "little"), ("scs0009", "big")])
def test_rows_hold_goal_time_and_speed_of_the_servos_that_are_driven(model: str, order: str) -> None:
    tables = [load_table(model)] * 2
    rows = GoalRows(Group([4, 9], [2, 0], tables, layout_of(tables[0])), [300, 400])

    def row(servo: int, goal: int, speed: int) -> bytes:
        words = (goal, 0, speed)
        return bytes((servo,)) + b"".join(word.to_bytes(2, order) for word in words)  # type: ignore[arg-type]

    ticks = np.array([1000, 5, 700], np.int32)
    assert rows.encode(ticks, np.array([True, True, True])) == row(4, 700, 300) + row(9, 1000, 400)
    assert rows.encode(ticks, np.array([True, True, False])) == row(9, 1000, 400)
    assert rows.encode(ticks, np.array([False, True, False])) == b""


def asked(wire: VirtualBus) -> tuple[list[int], Reader1]:
    """Ids that are read from now on, one after the other."""
    ids: list[int] = []
    reader = Reader1()

    def tap(sent: bool, data: bytes) -> None:
        packets: list[Packet1] = reader.feed(data) if sent else []
        ids.extend(packet.id for packet in packets if packet.code == Instruction1.READ and packet.params[0] == 36)

    wire.link.tap = tap
    return ids, reader


def test_servos_that_answer_one_by_one_are_read_a_few_at_a_time() -> None:
    wire = bus_of("ax-12a", range(1, 6), singles=2, slow_group=0)
    with wire.bus() as bus:
        bus.start()
        ids, _ = asked(wire)
        fresh = [bus.read().fresh.tolist() for _ in range(5)]
        assert ids == [1, 2, 3, 4, 5, 1, 2, 3, 4, 5]
        assert fresh[2] == [True, False, False, False, True]


def test_a_silent_servo_has_no_turn_and_takes_none_from_the_others() -> None:
    wire = bus_of("ax-12a", range(1, 6), singles=2, slow_group=0)
    with wire.bus() as bus:
        bus.start()
        wire.fault("mute:3")
        for _ in range(4):
            bus.read()
        ids, _ = asked(wire)
        for _ in range(4):
            bus.read()
        assert 3 not in ids
        assert sorted(ids) == [1, 1, 2, 2, 4, 4, 5, 5]
        wire.clear()


def test_a_single_is_the_least_that_is_read() -> None:
    wire = bus_of("ax-12a", range(1, 4), singles=0, slow_group=0)
    with wire.bus() as bus:
        bus.start()
        assert bus.read().fresh.sum() == 1


MODELS = [("ax-12a", "dynamixel"), ("mx1-28", "dynamixel"), ("sts3215", "feetech")]


@pytest.mark.parametrize(("model", "family"), MODELS)
def test_no_goal_goes_to_a_servo_that_switched_off(model: str, family: str) -> None:
    wire = bus_of(model, range(1, 4), family)
    with wire.bus() as bus:
        bus.start()
        before = wire.servo(2).register("Goal Position")
        wire.servo(2).put("Torque Enable", 0)
        read_until(bus, lambda state: not state.torque[1])
        for _ in range(10):
            bus.write([0.2, 0.2, 0.2])
            wire.clock.sleep(0.05)
        assert wire.servo(2).register("Goal Position") == before
        assert not wire.servo(2).torque
        assert wire.servo(1).register("Goal Position") != before


@pytest.mark.parametrize(("model", "family"), [("ax-12a", "dynamixel"), ("sts3215", "feetech")])
def test_a_torque_limit_of_zero_is_a_shutdown(model: str, family: str) -> None:
    wire = bus_of(model, range(1, 3), family)
    with wire.bus() as bus:
        bus.start()
        wire.servo(2).put("Torque Limit", 0)
        state = read_until(bus, lambda state: not state.torque[1])
        assert state.torque.tolist() == [True, False]
        assert bus.report().errors == {"torque_lost": 1}


def test_flags_that_refuse_an_instruction_are_no_alert() -> None:
    wire = bus_of("ax-12a", range(1, 3))
    with wire.bus() as bus:
        bus.start()
        bus._telemetry._note_errors((1, 2), np.array([0, 1]), np.array([0x48, 0x24], np.uint8))
        state = bus._telemetry.state(bus.scale, wire.clock())
        assert state.error.tolist() == [0, ALERT]
        assert state.hardware_error.tolist() == [0, 0x24]
        bus._telemetry._note_errors((2,), np.array([1]), np.array([0], np.uint8))
        state = bus._telemetry.state(bus.scale, wire.clock())
        assert state.hardware_error.tolist() == [0, 0]
        assert bus.report().errors == {"alert": 1}
