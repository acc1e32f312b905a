"""Register memory of a simulated servo: reads, and whether a write is allowed or with which error it is refused.

The effects of a write are in ``device``.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple

from drivers.packets.packet import ErrorNumber
from drivers.tables.tables import ControlTable, Item, from_magnitude, to_magnitude

EXTENDED_RANGE = 1_048_575
"""Goal Position in modes 4 and 5: 256 turns either way (e-Manual, Goal Position)."""
GOALS = frozenset({"Goal PWM", "Goal Current", "Goal Velocity", "Goal Position"})

Change = tuple[Item, int]

_CODES = {1: "B", 2: "H", 4: "I"}
"""Format of an unsigned item by its size, for ``struct``; in small letters signed."""


class _Field(NamedTuple):
    """An item in the data of a write.

    unpack_from, at, sign_bit : how its value is read, from which byte on. permanent, is_goal : what closes it to
    writes. low, high : its fixed range.
    """

    item: Item
    unpack_from: Any
    at: int
    sign_bit: int | None
    permanent: bool
    is_goal: bool
    low: float
    high: float


class Registers:
    """Bytes of a control table.

    memory : (table.size,) bytes as a host reads them, except for the indirect area.
    locked : nothing below ``table.eeprom_end`` may be written (torque is on, or Lock is set).
    goals_locked : the bus watchdog has tripped, so goals may not be written.
    extended : Goal Position may leave one turn (operating modes 4 and 5).
    on_remap : called when reads may reach other addresses than before.
    """

    def __init__(self, table: ControlTable) -> None:
        self.table = table
        self.memory = bytearray(table.size)
        self.locked = self.goals_locked = self.extended = False
        self._cells = {name: (_format(item), item.address, item.sign_bit) for name, item in table.items()}
        self.on_remap: Callable[[], None] = lambda: None
        self._layouts: dict[tuple[int, int], tuple[_Field, ...] | ErrorNumber] = {}
        self._gathering: dict[tuple[int, int], Callable[[bytearray], tuple[int, ...]]] = {}
        self._pointers: dict[int, int] = {}
        self._slots = frozenset(address for _, data, count in table.indirect for address in range(data, data + count))
        self._first_slot = min(self._slots, default=table.size)

    def reset(self, first: int, end: int) -> None:
        """Initial values for all items from address `first` up to `end`."""
        for item in self.table.values():
            if first <= item.address < end:
                self.memory[item.address : item.end] = item.encode(item.initial)
        self.remap()

    def reset_ram(self) -> None:
        """Initial values for all that does not outlast the supply."""
        self.reset(self.table.eeprom_end, self.table.size)
        for first, end in self.table.ram:
            self.reset(first, end)

    def get(self, name: str) -> int:
        """Value of an item in memory; KeyError where the model has none of that name."""
        cell, address, sign_bit = self._cells[name]
        value: int = cell.unpack_from(self.memory, address)[0]
        return value if sign_bit is None else from_magnitude(value, sign_bit)

    def put(self, name: str, value: int) -> None:
        """Set an item whatever its access and range."""
        item = self.table[name]
        self.memory[item.address : item.end] = item.encode(value)

    # ------------------------------------------------------------ reading
    def readable(self, address: int, length: int) -> bool:
        """Whether all `length` bytes lie in the table (gaps between items read as 0)."""
        return length > 0 and address + length <= self.table.size

    def read(self, address: int, length: int) -> bytes:
        """Bytes as a host reads them: Indirect Data shows what its pointer points at."""
        if not self._pointers or address + length <= self._first_slot:
            return bytes(self.memory[address : address + length])
        gather = self._gathering.get((address, length))
        if gather is None:  # one more than is read, since itemgetter makes no tuple of a single byte
            gather = self._gathering[address, length] = itemgetter(*self.reached(address, length), 0)
        return bytes(gather(self.memory)[:-1])

    def reached(self, address: int, length: int) -> list[int]:
        """The address of each byte that a read shows, through the pointers."""
        return [self._pointers.get(at, at) for at in range(address, address + length)]

    # ------------------------------------------------------------ writing
    def parse(self, address: int, data: bytes) -> list[Change] | ErrorNumber:
        """The items a write changes, or why it is refused. Nothing is changed here.

        A write is refused as a whole: with Access (7) where it reaches no item, a read-only one or a locked
        one, with Data Length (5) where it ends inside an item, with Data Range (4) or Data Limit (6) for a value.
        """
        if not data:
            return ErrorNumber.DATA_LENGTH
        if self._slots and address in self._slots:
            return self._parse_indirect(address, data)
        layout = self._layout(address, len(data))
        if isinstance(layout, ErrorNumber):
            return layout
        changes = []
        for field in layout:
            value = field.unpack_from(data, field.at)[0]
            if field.sign_bit is not None:
                value = from_magnitude(value, field.sign_bit)
            error = self._refusal(field, value)
            if error:
                return error
            changes.append((field.item, value))
        return changes

    def store(self, item: Item, value: int) -> None:
        """Put a value that `parse` allowed."""
        cell, address, sign_bit = self._cells[item.name]
        cell.pack_into(self.memory, address, value if sign_bit is None else to_magnitude(value, sign_bit))

    def _layout(self, address: int, length: int) -> tuple[_Field, ...] | ErrorNumber:
        """The items that a write of this size at this address covers; cached, as hosts repeat themselves."""
        layout = self._layouts.get((address, length))
        if layout is None:
            layout = self._layouts[address, length] = self._walk(address, length)
        return layout

    def _walk(self, address: int, length: int) -> tuple[_Field, ...] | ErrorNumber:
        begin, fields, end = address, [], address + length
        while address < end:
            item = self.table.by_address.get(address)
            if item is None or not item.writable:
                return ErrorNumber.ACCESS
            if item.end > end:
                return ErrorNumber.DATA_LENGTH
            fields.append(self._field(item, item.address - begin))
            address = item.end
        return tuple(fields)

    def _field(self, item: Item, at: int) -> _Field:
        cell, _, sign_bit = self._cells[item.name]
        low, high = -math.inf, math.inf
        if item.minimum is not None and item.maximum is not None:
            low, high = item.minimum, item.maximum
        permanent = self.table.is_permanent(item.address)
        return _Field(item, cell.unpack_from, at, sign_bit, permanent, item.name in GOALS, low, high)

    def _refusal(self, field: _Field, value: int) -> ErrorNumber:
        """Why a value may not be written now; NONE where it may."""
        if self.locked and field.permanent:
            return ErrorNumber.ACCESS
        if (self.goals_locked and field.is_goal) or not field.low <= value <= field.high:
            return ErrorNumber.DATA_RANGE
        item = field.item
        if item.values is not None and value not in item.values:
            return ErrorNumber.DATA_RANGE
        return self._beyond_limit(item, value) if item.upper else ErrorNumber.NONE

    def _beyond_limit(self, item: Item, value: int) -> ErrorNumber:
        if self.extended and item.name == "Goal Position":
            inside = -EXTENDED_RANGE <= value <= EXTENDED_RANGE
            return ErrorNumber.NONE if inside else ErrorNumber.DATA_RANGE
        high = self.get(item.upper or "")
        low = self.get(item.lower) if item.lower else -high
        return ErrorNumber.NONE if low <= value <= high else ErrorNumber.DATA_LIMIT

    # ------------------------------------------------------------ indirect area
    def remap(self) -> None:
        """Take over the pointers; one that points at its own slot makes the slot plain memory."""
        self._pointers, self._gathering = {}, {}
        for pointers, data, count in self.table.indirect:
            for k in range(count):
                at = pointers + 2 * k
                target = self.memory[at] | self.memory[at + 1] << 8
                if target != data + k and target < self.table.size and target not in self._slots:
                    self._pointers[data + k] = target
        self.on_remap()

    def _parse_indirect(self, address: int, data: bytes) -> list[Change] | ErrorNumber:
        """A write to Indirect Data is a write to the addresses that its pointers name, run by run."""
        changes: list[Change] = []
        targets = self.reached(address, len(data))
        start = 0
        for k in range(1, len(targets) + 1):
            if k < len(targets) and targets[k] == targets[k - 1] + 1:
                continue
            part = self._parse_run(targets[start], data[start:k])
            if isinstance(part, ErrorNumber):
                return part
            changes += part
            start = k
        return changes

    def _parse_run(self, address: int, data: bytes) -> list[Change] | ErrorNumber:
        if address not in self._slots:
            return self.parse(address, data)
        items = [self.table.by_address.get(at) for at in range(address, address + len(data))]
        if any(item is None or item.address not in self._slots for item in items):
            return ErrorNumber.ACCESS
        return [(item, byte) for item, byte in zip(items, data, strict=True) if item]


def _format(item: Item) -> struct.Struct:
    code = _CODES[item.size]
    return struct.Struct("<>"[item.big_endian] + (code.lower() if item.signed else code))
