"""Registers of servos with Protocol 1.0 framing by name: read windows, error flags and reasons of refusal."""

from __future__ import annotations

from collections.abc import Iterable

from drivers.base.bus import ServoSpec
from drivers.packets.packet1 import Error1, Packet1
from drivers.protocol1 import WINDOW
from drivers.protocol1.exchange import Exchanges
from drivers.servos import registers
from drivers.servos.port import Port
from drivers.tables.tables import ControlTable, Item


class Registers(registers.Registers[Packet1]):
    """Registers by servo id and short name; `flags` holds the error byte of the last reply by id."""

    greeting = "a greeting"
    packets: Exchanges

    def __init__(self, packets: Exchanges, port: Port, servos: Iterable[ServoSpec]) -> None:
        super().__init__(packets, port, servos)
        self.flags: dict[int, int] = {}

    def causes(self, servo: int, flags: int) -> int:
        """Those of a reply's error flags that are about the servo's state: supply, heat, load."""
        return flags & sum(self.tables[servo].hardware_error.values())

    def hardware_error(self, servo: int) -> int:
        """Error flags of the last reply that are about the servo's state."""
        return self.causes(servo, self.flags[servo])

    def refusal(self, reply: Packet1) -> str:
        """Why a servo refused an instruction; empty where it did not."""
        if reply.params:  # flags about an earlier instruction come with data that is good
            return ""
        refusal = Error1(reply.code & self.packets.refusals)
        return ", ".join(flag.name.lower().replace("_", " ") for flag in refusal if flag.name)

    def span(self, table: ControlTable, item: Item) -> tuple[int, int, str]:
        """(address, size, manner) of the read that contains a register."""
        return (*window(table, item), table.group_read)

    def is_damaged(self, reply: Packet1) -> bool:
        """Whether a servo reports that the checksum of the request was wrong."""
        return bool(reply.code & self.packets.refusals & Error1.CHECKSUM)

    def note(self, servo: int, reply: Packet1) -> None:
        """Keep the flags."""
        self.flags[servo] = reply.code


def window(table: ControlTable, item: Item) -> tuple[int, int]:
    """(address, size) of the read that contains a register, with a reply unlike the request (see the package)."""
    if item.size == 1:
        return item.address, 1
    return min(item.address, table.size - WINDOW), WINDOW
