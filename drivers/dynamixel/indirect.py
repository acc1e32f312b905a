"""Indirect addressing: registers that lie apart are mapped side by side, so that one read brings all of them.

X-series servos keep a row of pointers in RAM (Indirect Address); reading the bytes behind it (Indirect Data) reads
what the pointers point at. Where the row lies depends on model and firmware. It is RAM: nothing wears, and a servo
that reboots forgets it.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from drivers.dynamixel.layout import INDIRECT, item_of
from drivers.dynamixel.registers import Registers
from drivers.servos.layout import Block
from drivers.tables.tables import ControlTable

_TRIES = 2

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Pointers:
    """Registers side by side in the indirect area of a control table.

    Attributes
    ----------
    address : first pointer.
    values : the pointers' bytes.
    block : the registers where they can be read through the pointers.
    """

    address: int
    values: bytes
    block: Block


def pointers_of(table: ControlTable) -> Pointers | None:
    """What ``layout.INDIRECT`` names side by side, as far as the model has it; None where it cannot be mapped."""
    items = {name: item for name in INDIRECT if (item := item_of(table, name)) is not None}
    if not {"position", "temperature", "hardware", "torque"} <= set(items):
        return None
    targets = [at for item in items.values() for at in range(item.address, item.end)]
    first = table.get("Indirect Address 1")
    area = next((area for area in table.indirect if area[2] >= len(targets)), None)
    if area is None or first is None or not all((first.minimum or 0) <= at <= (first.maximum or 0) for at in targets):
        return None
    address, at, _ = area
    mapped = {}
    for name, item in items.items():
        mapped[name] = replace(item, address=at)
        at += item.size
    return Pointers(address, struct.pack(f"<{len(targets)}H", *targets), Block(mapped))


def set_up(registers: Registers, ids: Sequence[int]) -> dict[int, Block]:
    """Set the pointers of servos that can have them, and read them back.

    Returns
    -------
    dict : the block to read, by id; servos that have no indirect area, refuse or keep silent are left out.

    Raises
    ------
    PortLost : the port went away.
    """
    done: dict[int, Block] = {}
    groups: dict[tuple[int, int, bytes], tuple[Pointers, list[int]]] = {}
    for servo in ids:
        wanted = pointers_of(registers.tables[servo])
        if wanted is not None:
            key = wanted.address, wanted.block.address, wanted.values
            groups.setdefault(key, (wanted, []))[1].append(servo)
    for wanted, members in groups.values():
        done |= dict.fromkeys(_point(registers, members, wanted), wanted.block)
    refused = [servo for _, members in groups.values() for servo in members if servo not in done]
    if refused:
        log.warning("no indirect addressing for %s: read plainly", ", ".join(map(registers.label, refused)))
    return done


def _point(registers: Registers, ids: Sequence[int], wanted: Pointers) -> list[int]:
    """Write the pointers of servos with one packet, once more where they are not there; returns who has them."""
    packets, port, size = registers.packets, registers.port, len(wanted.values)
    done: list[int] = []
    for _ in range(_TRIES):
        left = [servo for servo in ids if servo not in done]
        if left:
            packets.write_group(port, wanted.address, size, b"".join(bytes((i,)) + wanted.values for i in left))
            got = packets.read_group(port, left, wanted.address, size).replies
            done += [servo for servo in left if servo in got and got[servo].params == wanted.values]
    return done
