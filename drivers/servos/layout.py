"""Register layout of servos: registers by short name, blocks of registers, and groups of servos read together."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.tables.tables import ControlTable, Item

NAMES = {
    "position": ("Present Position",),
    "velocity": ("Present Velocity", "Present Speed"),
    "current": ("Present Current",),
    "load": ("Present Load",),
    "voltage": ("Present Input Voltage", "Present Voltage"),
    "temperature": ("Present Temperature", "Present Motor Temperature"),
    "hardware": ("Hardware Error Status", "Error Code"),
    "moving": ("Moving",),
    "torque": ("Torque Enable",),
    "torque_limit": ("Torque Limit",),
    "current_limit": ("Current Limit",),
    "goal_current": ("Goal Current",),
    "watchdog": ("Bus Watchdog",),
    "goal": ("Goal Position",),
    "time": ("Goal Time",),
    "speed": ("Moving Speed", "Goal Velocity"),
    "accel": ("Goal Acceleration", "Acceleration"),
    "speed_limit": ("Profile Velocity", "Moving Speed"),
    "accel_limit": ("Profile Acceleration",),
    "offset": ("Homing Offset",),
    "min_ticks": ("Min Position Limit", "CW Angle Limit"),
    "max_ticks": ("Max Position Limit", "CCW Angle Limit"),
    "min_voltage": ("Min Voltage Limit",),
    "mode": ("Operating Mode", "Control Mode"),
    "drive_mode": ("Drive Mode",),
    "phase": ("Phase",),
    "return_delay": ("Return Delay Time",),
    "startup": ("Startup Configuration",),
    "status_level": ("Status Return Level", "Response Level"),
    "shutdown": ("Shutdown",),
    "lock": ("Lock",),
    "state": ("Controller State",),
    "gear_numerator": ("Electronic GearRatio Numerator",),
    "gear_denominator": ("Electronic GearRatio Denominator",),
}
"""The makers' names of a register, which differ by family, by short name."""
SCALED = {"velocity": "rad/s", "current": "A", "load": "1", "voltage": "V", "temperature": "C"}
"""Registers that are converted from steps, by short name, and the units they are converted to."""


def item_of(table: ControlTable, name: str) -> Item | None:
    """Return the register of a table by its short name; None where the model does not have it."""
    return next((table[vendor] for vendor in NAMES[name] if vendor in table), None)


@dataclass(frozen=True)
class Block:
    """Adjacent registers that one request reads: `items` by short name (``"position"``, ``"velocity"``, ...)."""

    items: Mapping[str, Item]

    @cached_property
    def address(self) -> int:
        """First address."""
        return min(item.address for item in self.items.values())

    @cached_property
    def size(self) -> int:
        """Bytes to read. It never equals the size of a reply to a ping, see ``Exchanges.hello``."""
        return max(item.end for item in self.items.values()) - self.address

    @cached_property
    def key(self) -> tuple[object, ...]:
        """Equal for blocks that hold the same registers at the same addresses."""
        return self.address, self.size, tuple((name, item.big_endian) for name, item in self.items.items())

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """numpy type of the block's bytes, with a field for each register."""
        return np.dtype(
            {
                "names": list(self.items),
                "formats": [format_of(item) for item in self.items.values()],
                "offsets": [item.address - self.address for item in self.items.values()],
                "itemsize": self.size,
            }
        )

    def decode(self, data: NDArray[np.uint8]) -> dict[str, NDArray[np.int64]]:
        """Decode replies ``(k, size)`` uint8 of k servos to signed values by short name, ``(k,)`` each."""
        raw = np.ascontiguousarray(data).view(self.dtype)[:, 0]
        return {name: _signed(raw[name].astype(np.int64), item.sign_bit) for name, item in self.items.items()}


def _signed(raw: NDArray[np.int64], sign_bit: int | None) -> NDArray[np.int64]:
    """Convert numbers of which one bit is the sign and the lower bits are the magnitude; None: no such bit."""
    if sign_bit is None:
        return raw
    magnitude = raw & ((1 << sign_bit) - 1)
    return np.where(raw >> sign_bit & 1, -magnitude, magnitude)


def format_of(item: Item) -> str:
    """Return numpy's type code of a register; it does not decode a sign in a separate bit."""
    return f"{'>' if item.big_endian else '<'}{'i' if item.signed else 'u'}{item.size}"


def block_of(table: ControlTable, *names: str) -> Block:
    """Return a block of the registers with these short names that the model has."""
    return Block({name: item for name in names if (item := item_of(table, name)) is not None})


@dataclass(frozen=True)
class Layout:
    """Blocks of one control table that a bus reads and writes; servos whose layouts have equal keys share reads.

    goal : registers written every cycle.
    feedback : block read every cycle, or in turn where servos are read one by one.
    slow : blocks that are read in turn, with the registers that are not in ``feedback``.
    manner : how a group is read, see ``Exchanges.read_group``; empty: one servo after the other.
    indirect : ``feedback`` is read through indirect addresses, which a servo loses when it reboots.
    """

    goal: Block
    feedback: Block
    slow: tuple[Block, ...]
    manner: str = "sync"
    indirect: bool = False

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for layouts whose servos can share one transaction."""
        return self.manner, *(block.key for block in (self.goal, self.feedback, *self.slow))


class Group:
    """Servos that share one transaction because their registers lie at the same addresses.

    Parameters
    ----------
    ids : k servo ids.
    index : (k,) their indices in the arrays of the bus.
    tables, layout : k control tables, and the layout that they share.

    Attributes
    ----------
    scales : value of one step by short name, (k,) in the units of `SCALED`; NaN where a model has no such value.
    """

    def __init__(self, ids: Sequence[int], index: Sequence[int], tables: Sequence[ControlTable], layout: Layout):
        self.ids, self.index, self.layout = tuple(ids), np.array(index, np.int64), layout
        self.scales = {name: np.array([_scale(table, name) for table in tables]) for name in SCALED}
        self._slot = {servo: slot for slot, servo in enumerate(self.ids)}

    def slots(self, ids: Sequence[int]) -> slice | list[int]:
        """Positions of ids within the group; a slice for the whole group, which is faster."""
        return slice(None) if tuple(ids) == self.ids else [self._slot[servo] for servo in ids]


def _scale(table: ControlTable, name: str) -> float:
    item = item_of(table, name)
    return item.scale if item is not None and item.unit == SCALED[name] else np.nan


class ReadRequest(NamedTuple):
    """A block to read from some servos of a group."""

    group: Group
    block: Block
    ids: tuple[int, ...]

    def without(self, left_out: Collection[int]) -> ReadRequest:
        """Return the same request without some servos."""
        return self._replace(ids=tuple(servo for servo in self.ids if servo not in left_out))


def slow_requests(groups: Sequence[Group], size: int) -> list[ReadRequest]:
    """Return requests that read all slow blocks of all groups once, each from `size` servos; none where `size` is 0.

    Servos that are read one by one get a request each.
    """
    return [
        ReadRequest(group, block, group.ids[at : at + step])
        for group in groups
        for step in (size if group.layout.manner else min(size, 1),)
        for block in group.layout.slow
        for at in range(0, len(group.ids) if step else 0, max(step, 1))
    ]
