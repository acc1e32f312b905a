"""Indirect addressing of Dynamixel servos: registers that lie apart are mapped side by side and read as one block.

A servo has pointers (the registers Indirect Address); reading the register Indirect Data of a pointer reads the
register that it points at. The addresses of both depend on model and firmware. X-series servos keep their pointers in
RAM and lose them in a reboot. P- and Y-series keep them in permanent memory, which is not written.
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

_MAX_WRITES = 2

log = logging.getLogger(__name__)


class Pointers(NamedTuple):
    """Pointers to registers: `address` of the first pointer, their bytes, and the block that they make readable."""

    address: int
    values: bytes
    block: Block


def pointers_of(table: ControlTable) -> Pointers | None:
    """Pointers to the registers of ``layout.INDIRECT`` that the model has; None where they cannot be set."""
    items = {name: item for name in INDIRECT if (item := item_of(table, name)) is not None}
    if not {"position", "temperature", "hardware", "torque"} <= set(items):
        return None
    targets = [at for item in items.values() for at in range(item.address, item.end)]
    first = table.get("Indirect Address 1")
    in_ram = (area for area in table.indirect if not table.is_permanent(area[0]))  # permanent memory wears with writes
    area = next((area for area in in_ram if area[2] >= len(targets)), None)
    if area is None or first is None or not all((first.minimum or 0) <= at <= (first.maximum or 0) for at in targets):
        return None
    address, at, _ = area
    mapped = {}
    for name, item in items.items():
        mapped[name] = replace(item, address=at)
        at += item.size
    return Pointers(address, struct.pack(f"<{len(targets)}H", *targets), Block(mapped))


def set_up_pointers(registers: Registers, ids: Sequence[int]) -> dict[int, Block]:
    """Set the pointers of servos and read them back; return the block that they make readable, by servo id.

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
        log.warning(
            "no indirect addressing for %s: slow values are read in turn",
            ", ".join(map(registers.label, refused)),
        )
    return done


def _write_pointers(registers: Registers, ids: Sequence[int], wanted: Pointers) -> list[int]:
    """Write pointers with one packet, again to servos that read back others; return the servos that have them."""
    packets, port, size = registers.packets, registers.port, len(wanted.values)
    done: list[int] = []
    for _ in range(_MAX_WRITES):
        left = [servo for servo in ids if servo not in done]
        if left:
            packets.write_group(port, wanted.address, size, b"".join(bytes((i,)) + wanted.values for i in left))
            got = packets.read_group(port, left, wanted.address, size).replies
            done += [servo for servo in left if servo in got and got[servo].params == wanted.values]
    return done
