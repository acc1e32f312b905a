"""Named registers of the servos with Protocol 2.0 on one port."""

from __future__ import annotations

from drivers.dynamixel.port import Port
from drivers.dynamixel.sdk import Packets
from drivers.packets.packet import ErrorNumber, Instruction, StatusPacket
from drivers.servos import registers
from drivers.servos.layout import NAMES
from drivers.tables.tables import Item

_REASONS = {number.value: number.name.lower().replace("_", " ") for number in ErrorNumber}


class Registers(registers.Registers[StatusPacket]):
    """Registers by servo id and short name; parameters as for :class:`~drivers.servos.registers.Registers`."""

    greeting = "a ping"
    packets: Packets
    port: Port

    def refusal(self, reply: StatusPacket) -> str:
        """Why a servo refused what it was asked; empty where it did not."""
        number = reply.error_number
        return _REASONS.get(number, f"error {number}") if number else ""

    def title(self, item: Item, name: str) -> str:
        """How messages call a register: as X-series do, also with an XL-320, which has other names for some."""
        return NAMES[name][0]

    def tell(self, servo: int, name: str, value: int) -> None:
        """Write one register without waiting for an answer."""
        item = self._known(servo, name)
        params = self.packets.number(item.address) + item.encode(value)
        self.packets.tell(self.port, self.packets.encode(servo, Instruction.WRITE, params))
