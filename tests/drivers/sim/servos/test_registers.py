"""drivers.sim.servos.registers: what may be read and written, and the error numbers of what may not."""

from __future__ import annotations

import struct

import pytest

from drivers.packets.packet import ErrorNumber as E
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import load_table


@pytest.fixture
def registers() -> Registers:
    made = Registers(load_table("xl330-m288"))
    made.reset(0, made.table.size)
    return made


def le(value: int, size: int = 4) -> bytes:
    return (value & (1 << 8 * size) - 1).to_bytes(size, "little")


def test_reset_gives_every_item_its_initial_value(registers: Registers):
    for name, item in registers.table.items():
        assert registers.get(name) == item.initial, name


def test_reset_leaves_the_other_area_alone(registers: Registers):
    registers.put("ID", 7)
    registers.put("LED", 1)
    registers.reset(64, registers.table.size)
    assert (registers.get("ID"), registers.get("LED")) == (7, 0)


@pytest.mark.parametrize(
    ("address", "data", "error"),
    [
        (132, le(5), E.ACCESS),  # read-only
        (66, b"\x01", E.ACCESS),  # nothing there
        (117, le(5), E.ACCESS),  # the middle of an item
        (1000, b"\x01", E.ACCESS),  # behind the table
        (116, b"\x01\x02", E.DATA_LENGTH),
        (116, b"", E.DATA_LENGTH),
        (112, le(1) + b"\x02", E.DATA_LENGTH),  # a whole item and a piece of the next
        (116, le(1) + b"\x00" * 2, E.ACCESS),  # runs into Realtime Tick
        (11, b"\x02", E.DATA_RANGE),  # an operating mode that does not exist
        (7, b"\xfd", E.DATA_RANGE),
        (8, b"\x07", E.DATA_RANGE),  # 4.5M is not for this size
        (20, le(1_044_480), E.DATA_RANGE),
        (20, le(-1_044_480), E.DATA_RANGE),
        (64, b"\x02", E.DATA_RANGE),
        (98, b"\x80", E.DATA_RANGE),
        (108, le(32_768), E.DATA_RANGE),
        (116, le(4096), E.DATA_LIMIT),
        (116, le(-1), E.DATA_LIMIT),
        (104, le(446), E.DATA_LIMIT),
        (104, le(-446), E.DATA_LIMIT),
        (100, le(886, 2), E.DATA_LIMIT),
        (102, le(-1751, 2), E.DATA_LIMIT),
    ],
)
def test_refused_writes_and_their_numbers(registers: Registers, address: int, data: bytes, error: E):
    before = bytes(registers.memory)
    assert registers.parse(address, data) == error
    assert registers.memory == before


@pytest.mark.parametrize(
    ("address", "data", "changes"),
    [
        (116, le(4095), {"Goal Position": 4095}),
        (104, le(-445), {"Goal Velocity": -445}),
        (108, le(3) + le(4) + le(5), {"Profile Acceleration": 3, "Profile Velocity": 4, "Goal Position": 5}),
        (20, le(-1_044_479), {"Homing Offset": -1_044_479}),
        (12, b"\xff", {"Secondary(Shadow) ID": 255}),
    ],
)
def test_allowed_writes(registers: Registers, address: int, data: bytes, changes: dict[str, int]):
    parsed = registers.parse(address, data)
    assert {item.name: value for item, value in parsed} == changes
    for item, value in parsed:
        registers.store(item, value)
    assert registers.read(address, len(data)) == data


def test_one_bad_value_refuses_the_whole_write(registers: Registers):
    assert registers.parse(108, le(3) + le(4) + le(5000)) == E.DATA_LIMIT


def test_limits_are_registers(registers: Registers):
    registers.put("Min Position Limit", 1000)
    registers.put("Max Position Limit", 3000)
    assert registers.parse(116, le(999)) == registers.parse(116, le(3001)) == E.DATA_LIMIT
    assert registers.parse(116, le(1000)) != E.DATA_LIMIT
    registers.put("Velocity Limit", 100)
    assert registers.parse(104, le(101)) == E.DATA_LIMIT


def test_extended_position_has_a_range_of_its_own(registers: Registers):
    registers.extended = True
    assert registers.parse(116, le(1_048_576)) == registers.parse(116, le(-1_048_576)) == E.DATA_RANGE
    assert registers.parse(116, le(-1_048_575))[0][1] == -1_048_575


def test_torque_locks_the_eeprom_only(registers: Registers):
    registers.locked = True
    assert registers.parse(7, b"\x02") == registers.parse(63, b"\x00") == E.ACCESS
    assert registers.parse(65, b"\x01")[0][0].name == "LED"


def test_tripped_watchdog_locks_the_goals_only(registers: Registers):
    registers.goals_locked = True
    for address, size in ((100, 2), (102, 2), (104, 4), (116, 4)):
        assert registers.parse(address, bytes(size)) == E.DATA_RANGE
    assert registers.parse(112, bytes(4))[0][0].name == "Profile Velocity"


def test_reads_may_cross_gaps_but_not_leave_the_table(registers: Registers):
    assert registers.readable(0, 228)
    assert registers.read(66, 2) == b"\0\0"
    assert not registers.readable(0, 229)
    assert not registers.readable(228, 1)
    assert not registers.readable(0, 0)


def test_indirect_data_shows_and_writes_what_its_pointers_spell(registers: Registers):
    for slot, target in enumerate((132, 133, 134, 135, 65)):
        registers.memory[168 + 2 * slot : 170 + 2 * slot] = le(target, 2)
    for slot, target in enumerate((116, 117, 118, 119), start=8):
        registers.memory[168 + 2 * slot : 170 + 2 * slot] = le(target, 2)
    registers.remap()
    registers.memory[132:136] = struct.pack("<i", -2)
    registers.put("LED", 1)
    assert registers.read(208, 5) == le(-2) + b"\x01"
    assert registers.reached(208, 5) == [132, 133, 134, 135, 65]
    changes = registers.parse(216, le(1234))
    assert [(item.name, value) for item, value in changes] == [("Goal Position", 1234)]
    assert registers.parse(208, le(1)) == E.ACCESS  # Present Position stays read-only
    assert registers.parse(216, le(9999)) == E.DATA_LIMIT


def test_unmapped_indirect_data_is_plain_memory(registers: Registers):
    for item, value in registers.parse(210, b"\x11\x22"):
        registers.store(item, value)
    assert registers.read(210, 2) == b"\x11\x22"
    assert registers.reached(210, 2) == [210, 211]


def test_an_indirect_write_of_scattered_targets_takes_them_one_by_one(registers: Registers):
    registers.memory[168:172] = le(65, 2) + le(68, 2)
    registers.remap()
    assert [(item.name, value) for item, value in registers.parse(208, b"\x01\x01")] == [
        ("LED", 1),
        ("Status Return Level", 1),
    ]


@pytest.mark.parametrize("target", [63, 228])
def test_pointers_stay_in_their_range(registers: Registers, target: int):
    assert registers.parse(168, le(target, 2)) == E.DATA_RANGE


@pytest.mark.parametrize(
    ("model", "name", "data", "value"),
    [
        ("sts3215", "Homing Offset", "0A08", -10),
        ("sts3215", "Goal Velocity", "64 80", -100),
        ("scs0009", "Goal Position", "0102", 258),
    ],
)
def test_magnitudes_and_high_bytes_first(model: str, name: str, data: str, value: int):
    made = Registers(load_table(model))
    made.reset(0, made.table.size)
    item = made.table[name]
    ((parsed, number),) = made.parse(item.address, bytes.fromhex(data))
    assert (parsed.name, number) == (name, value)
    made.store(parsed, number)
    assert made.get(name) == value
    assert made.read(item.address, 2) == bytes.fromhex(data)


@pytest.mark.parametrize("model", ["xl330-m288", "xm430-w350", "xl320", "ax-12a", "mx1-28", "sts3215", "scs0009"])
def test_every_fixed_range_is_allowed_up_to_both_ends_and_no_further(model: str):
    made = Registers(load_table(model))
    made.reset(0, made.table.size)
    tried = 0
    for item in made.table.values():
        if not item.writable or item.upper:
            continue
        span = (1 << 8 * item.size) - 1
        for end, step in ((item.minimum, -1), (item.maximum, 1)):
            if end is None or item.minimum is None:
                continue
            if item.values is None:
                ((changed, value),) = made.parse(item.address, item.encode(end))
                assert (changed.name, value) == (item.name, end)
            beyond = end + step
            if item.decode(item.encode(beyond)) == beyond and -span <= beyond <= span:
                assert made.parse(item.address, item.encode(beyond)) == E.DATA_RANGE, item.name
                tried += 1
        if item.values is not None:
            assert not isinstance(made.parse(item.address, item.encode(item.values[-1])), E)
    assert tried > 3


def test_limit_registers_are_allowed_up_to_both_ends(registers: Registers):
    for address, value, size in ((104, 445, 4), (104, -445, 4), (100, 885, 2), (102, -1750, 2), (116, 0, 4)):
        assert registers.parse(address, le(value, size))[0][1] == value
    registers.put("Max Position Limit", 3000)
    assert registers.parse(116, le(3000))[0][1] == 3000


@pytest.mark.parametrize("goal", [1_048_575, -1_048_575])
def test_extended_positions_reach_256_turns_both_ways(registers: Registers, goal: int):
    registers.extended = True
    assert registers.parse(116, le(goal))[0][1] == goal
    assert registers.parse(104, le(446)) == E.DATA_LIMIT, "other goals keep their limits"


def test_the_lock_ends_where_the_ram_begins(registers: Registers):
    registers.locked = True
    end = registers.table.eeprom_end
    for item in registers.table.values():
        if item.writable and item.minimum is None and item.values is None and not item.upper:
            refused = registers.parse(item.address, bytes(item.size)) == E.ACCESS
            assert refused is (item.address < end), item.name


def test_a_pointer_to_its_own_slot_or_to_another_is_plain_memory(registers: Registers):
    registers.memory[168:172] = le(208, 2) + le(210, 2)
    registers.memory[172:174] = le(registers.table.size, 2)
    registers.remap()
    registers.memory[208:212] = b"\x11\x22\x33\x44"
    assert registers.read(208, 3) == b"\x11\x22\x33"


def test_each_slot_has_its_own_pointer_and_reads_may_begin_before_the_slots():
    made = Registers(load_table("xm430-w350"))
    made.reset(0, made.table.size)
    (first, second) = made.table.indirect
    for pointers, _, count in (first, second):
        made.memory[pointers + 2 * (count - 1) : pointers + 2 * count] = le(65, 2)
    made.remap()
    made.put("LED", 1)
    for _, data, count in (first, second):
        assert made.read(data + count - 2, 2) == b"\0\1"
        assert made.reached(data + count - 1, 1) == [65]
    _, data, count = first
    assert made.read(data - 1, 2) == bytes(made.memory[data - 1 : data + 1])
    assert made.reached(data - 1, 1) == [data - 1]
    assert made.parse(second[1] + second[2] - 1, b"\0")[0][0].name == "LED"


def test_an_indirect_write_is_refused_as_a_whole(registers: Registers):
    registers.memory[168:174] = le(65, 2) + le(132, 2) + le(10, 2)
    registers.remap()
    assert registers.parse(208, b"\x01\x00") == E.ACCESS
    assert [item.name for item, _ in registers.parse(208, b"\x01")] == ["LED"]
    assert registers.parse(208 + 27, b"\x01\x02") == E.ACCESS, "behind the last slot"


def test_repeated_writes_are_judged_again(registers: Registers):
    assert registers.parse(116, le(2000))[0][1] == 2000
    registers.put("Max Position Limit", 1000)
    assert registers.parse(116, le(2000)) == E.DATA_LIMIT
    assert registers.parse(117, le(1)) == registers.parse(117, le(1)) == E.ACCESS
