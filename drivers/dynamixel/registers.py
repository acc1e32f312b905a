"""Registers of servos with Protocol 2.0 by name: reasons of refusal, and writes without a reply."""

from __future__ import annotations

from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import ErrorNumber, Instruction, StatusPacket
from drivers.servos import registers
from drivers.servos.layout import NAMES
from drivers.servos.port import Port
from drivers.tables.tables import Item

_REASONS = {number.value: number.name.lower().replace("_", " ") for number in ErrorNumber}


class Registers(registers.Registers[StatusPacket]):
    """Registers by servo id and short name; parameters as for :class:`~drivers.servos.registers.Registers`."""

    greeting = "a ping"
    packets: Packets
    port: Port

    def refusal(self, reply: StatusPacket) -> str:
        """Why a servo refused an instruction; empty where it did not."""
        number = reply.error_number
        return _REASONS.get(number, f"error {number}") if number else ""

    def title(self, item: Item, name: str) -> str:
        """The X-series' name of a register, also for an XL-320, which has other names for some."""
        return NAMES[name][0]

    def hardware_error(self, servo: int) -> int:
        """Hardware error bits of a servo."""
        return self.get(servo, "hardware")

    def put_unanswered(self, servo: int, name: str, value: int) -> None:
        """Write one register without waiting for a reply."""
        item = self._known(servo, name)
        params = self.packets.number(item.address) + item.encode(value)
        self.packets.send_only(self.port, self.packets.encode(servo, Instruction.WRITE, params))
