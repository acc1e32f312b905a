"""Registers by short names that hold for every family, and those that lie together as one block of bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.tables.tables import ControlTable, Item

NAMES = {
    "position": ("Present Position",),
    "velocity": ("Present Velocity", "Present Speed"),
    "current": ("Present Current",),
    "load": ("Present Load",),
    "voltage": ("Present Input Voltage", "Present Voltage"),
    "temperature": ("Present Temperature",),
    "hardware": ("Hardware Error Status",),
    "moving": ("Moving",),
    "torque": ("Torque Enable",),
    "torque_limit": ("Torque Limit",),
    "watchdog": ("Bus Watchdog",),
    "goal": ("Goal Position",),
    "time": ("Goal Time",),
    "speed": ("Moving Speed", "Goal Velocity"),
    "accel": ("Goal Acceleration", "Acceleration"),
    "speed_limit": ("Profile Velocity", "Moving Speed"),
    "accel_limit": ("Profile Acceleration",),
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
}
"""Short names -> the makers' names of a register, which differ by family."""


def item_of(table: ControlTable, name: str) -> Item | None:
    """Register of a table by its short name; None where the model has none."""
    return next((table[vendor] for vendor in NAMES[name] if vendor in table), None)


@dataclass(frozen=True)
class Block:
    """Registers that lie together and are read in one go.

    Parameters
    ----------
    items : by short name (``"position"``, ``"velocity"``, ...).
    """

    items: Mapping[str, Item]

    @cached_property
    def address(self) -> int:
        """First address."""
        return min(item.address for item in self.items.values())

    @cached_property
    def size(self) -> int:
        """Bytes to read. Never as many as the answer to a greeting has, see ``Exchanges.hello``."""
        return max(item.end for item in self.items.values()) - self.address

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The block's bytes as a record."""
        return np.dtype(
            {
                "names": list(self.items),
                "formats": [format_of(item) for item in self.items.values()],
                "offsets": [item.address - self.address for item in self.items.values()],
                "itemsize": self.size,
            }
        )

    def decode(self, data: NDArray[np.uint8]) -> NDArray[np.void]:
        """Raw values of k servos from their replies ``(k, size)`` uint8; fields by name, shape ``(k,)``."""
        return np.ascontiguousarray(data).view(self.dtype)[:, 0]


def format_of(item: Item) -> str:
    """How numpy calls a register's bytes; a sign that is kept in a bit of its own is left there."""
    return f"{'>' if item.big_endian else '<'}{'i' if item.signed else 'u'}{item.size}"


def block_of(table: ControlTable, *names: str) -> Block:
    """The registers of these short names that a model has; empty where it has none."""
    return Block({name: item for name in names if (item := item_of(table, name)) is not None})
