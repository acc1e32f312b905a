"""Indirect addressing of Dynamixel servos: registers that lie apart are mapped side by side and read in one go.

X-series servos keep pointers in RAM (Indirect Address); those of P- and Y-series are permanent, and are left alone.
Reading the bytes behind them (Indirect Data) reads the registers that they point at. Their address depends on model and
firmware. A servo that reboots loses them.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from drivers.dynamixel.layout import INDIRECT, item_of
from drivers.dynamixel.registers import Registers
from drivers.servos.layout import Block
from drivers.tables.tables import ControlTable

_TRIES = 2

log = logging.getLogger(__name__)


class Pointers(NamedTuple):
    """Pointers to registers: `address` of the first, their bytes, and the block that is read through them."""

    address: int
    values: bytes
    block: Block


def pointers_of(table: ControlTable) -> Pointers | None:
    """Pointers to the registers of ``layout.INDIRECT`` that the model has; None where they cannot be mapped."""
    items = {name: item for name in INDIRECT if (item := item_of(table, name)) is not None}
    if not {"position", "temperature", "hardware", "torque"} <= set(items):
        return None
    targets = [at for item in items.values() for at in range(item.address, item.end)]
    first = table.get("Indirect Address 1")
    in_ram = (area for area in table.indirect if not table.is_permanent(area[0]))  # else each start would wear it
    area = next((area for area in in_ram if area[2] >= len(targets)), None)
    if area is None or first is None or not all((first.minimum or 0) <= at <= (first.maximum or 0) for at in targets):
        return None
    address, at, _ = area
    mapped = {}
    for name, item in items.items():
        mapped[name] = replace(item, address=at)
        at += item.size
    return Pointers(address, struct.pack(f"<{len(targets)}H", *targets), Block(mapped))


def set_up(registers: Registers, ids: Sequence[int]) -> dict[int, Block]:
    """Set the pointers of servos and read them back; returns the block to read by id.

    Servos that have no indirect area, refuse or do not answer are left out. Raises PortLost.
    """
    done: dict[int, Block] = {}
    groups: dict[tuple[object, ...], list[int]] = {}
    pointers = {servo: found for servo in ids if (found := pointers_of(registers.tables[servo]))}
    for servo, wanted in pointers.items():
        groups.setdefault((wanted.address, wanted.block.address, wanted.values), []).append(servo)
    for members in groups.values():
        wanted = pointers[members[0]]
        done |= dict.fromkeys(_write_pointers(registers, members, wanted), wanted.block)
    refused = [servo for members in groups.values() for servo in members if servo not in done]
    if refused:
        log.warning("no indirect addressing for %s: read plainly", ", ".join(map(registers.label, refused)))
    return done


def _write_pointers(registers: Registers, ids: Sequence[int], wanted: Pointers) -> list[int]:
    """Write pointers with one packet, again where they do not read back; returns the servos that have them."""
    packets, port, size = registers.packets, registers.port, len(wanted.values)
    done: list[int] = []
    for _ in range(_TRIES):
        left = [servo for servo in ids if servo not in done]
        if left:
            packets.write_group(port, wanted.address, size, b"".join(bytes((i,)) + wanted.values for i in left))
            got = packets.read_group(port, left, wanted.address, size).replies
            done += [servo for servo in left if servo in got and got[servo].params == wanted.values]
    return done
