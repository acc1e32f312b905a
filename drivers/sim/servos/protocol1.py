"""Protocol 1.0 framing on a wire of simulated servos: Dynamixel AX and MX, Feetech STS and SCS.

The two makers differ: Dynamixel reports a refused instruction in its error flags and has a bulk read (MX only);
Feetech has a sync read (STS only), reports hardware errors only and ignores what it refuses.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from drivers.packets.packet import ALERT, ErrorNumber
from drivers.packets.packet1 import BROADCAST_ID, Error1, Instruction1, Packet1, Reader1, encode
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.wire.replies import Reply

_FLAGS = {
    ErrorNumber.RESULT_FAIL: Error1.INSTRUCTION,
    ErrorNumber.INSTRUCTION: Error1.INSTRUCTION,
    ErrorNumber.CRC: Error1.CHECKSUM,
    ErrorNumber.DATA_RANGE: Error1.RANGE,
    ErrorNumber.DATA_LENGTH: Error1.RANGE,
    ErrorNumber.DATA_LIMIT: Error1.ANGLE_LIMIT,
    ErrorNumber.ACCESS: Error1.RANGE,
}
"""Error flag for each reason that a servo refuses an instruction."""


class Protocol1Chain(Chain):
    """Servos that speak Protocol 1.0 framing on one wire. See :class:`~drivers.sim.servos.chain.Chain`."""

    def make_reader(self) -> Reader1:
        """A reader of packets. (Nothing tells a status packet from an instruction; servos hear only the host.)"""
        self._handlers: dict[int, Callable[[Packet1, float], list[Reply]]] = {
            Instruction1.PING: self._ping,
            Instruction1.READ: self._read,
            Instruction1.WRITE: self._write,
            Instruction1.REG_WRITE: self._reg_write,
            Instruction1.ACTION: self._action,
            Instruction1.FACTORY_RESET: self._factory_reset,
            Instruction1.REBOOT: self._reboot,
            Instruction1.SYNC_READ: self._sync_read,
            Instruction1.SYNC_WRITE: self._sync_write,
            Instruction1.BULK_READ: self._bulk_read,
        }
        return Reader1()

    def size(self, packet: Packet1) -> int:
        """Bytes of an instruction packet on the wire."""
        return 6 + len(packet.params)

    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        """A status packet; `error` is already a byte of flags."""
        return encode(device_id, error, data)

    def carry_out(self, packet: Packet1, now_s: float) -> list[Reply]:
        """What an instruction packet does, and who answers. Feetech passes over what it does not know."""
        handler = self._handlers.get(packet.code)
        if handler:
            return handler(packet, now_s)
        return self._act(packet, now_s, lambda servo: ErrorNumber.INSTRUCTION)

    # ------------------------------------------------------------ answers
    def _act(self, packet: Packet1, now_s: float, act: Callable[[SimulatedServo], int]) -> list[Reply]:
        """Something every addressed servo does; one servo answers with an empty status, all with none."""
        if packet.id == BROADCAST_ID:
            for servo in self.everyone(now_s):
                act(servo)
            return []
        return self.answer(packet.id, 2, now_s, lambda servo: (error_flags(servo, act(servo)), b""))

    def _ping(self, packet: Packet1, now_s: float) -> list[Reply]:
        """Answered whatever the Status Return Level; the model is not told. Broadcast: everybody, in order of id."""
        ids = sorted(self.by_id) if packet.id == BROADCAST_ID else [packet.id]
        replies = []
        for device_id in ids:
            replies += self.answer(device_id, 0, now_s, lambda servo: (error_flags(servo, 0), b""))
        return replies

    def _read(self, packet: Packet1, now_s: float) -> list[Reply]:
        if packet.id == BROADCAST_ID or len(packet.params) != 2:
            return self._act(packet, now_s, lambda servo: ErrorNumber.DATA_LENGTH)
        address, length = packet.params
        return self.answer(packet.id, 1, now_s, lambda servo: read(servo, address, length, now_s))

    def _write(self, packet: Packet1, now_s: float) -> list[Reply]:
        address, data = packet.params[:1], packet.params[1:]
        if not data:
            return self._act(packet, now_s, lambda servo: ErrorNumber.DATA_LENGTH)
        return self._act(packet, now_s, lambda servo: servo.write(address[0], data, now_s))

    def _reg_write(self, packet: Packet1, now_s: float) -> list[Reply]:
        address, data = packet.params[:1], packet.params[1:]
        if not data:
            return self._act(packet, now_s, lambda servo: ErrorNumber.DATA_LENGTH)
        return self._act(packet, now_s, lambda servo: servo.reg_write(address[0], data))

    def _action(self, packet: Packet1, now_s: float) -> list[Reply]:
        return self._act(packet, now_s, lambda servo: servo.action(now_s))

    def _factory_reset(self, packet: Packet1, now_s: float) -> list[Reply]:
        """Feetech keeps the id, Dynamixel does not."""
        return self._act(packet, now_s, lambda servo: servo.factory_reset(1 if servo.is_feetech else 0xFF, now_s))

    def _reboot(self, packet: Packet1, now_s: float) -> list[Reply]:
        """MX only; the others do not know it."""

        def reboot(servo: SimulatedServo) -> int:
            if not servo.table.model.startswith("mx"):
                return ErrorNumber.INSTRUCTION
            servo.reboot(now_s)
            return 0

        return self._act(packet, now_s, reboot)

    # ------------------------------------------------------------ several servos
    def _sync_read(self, packet: Packet1, now_s: float) -> list[Reply]:
        """Feetech's: address, length, ids; SCS and Dynamixel servos stay silent."""
        if packet.id != BROADCAST_ID or len(packet.params) < 2:
            return []
        address, length, *ids = packet.params
        asked = [(device_id, address, length) for device_id in ids]
        return self._read_many(asked, now_s, lambda servo: servo.table.group_read == "sync")

    def _bulk_read(self, packet: Packet1, now_s: float) -> list[Reply]:
        """MX's: 0, then (length, id, address) repeated; an id named twice is answered once, for the first."""
        params = packet.params[1:]
        if packet.id != BROADCAST_ID or len(params) % 3:
            return []
        asked: dict[int, tuple[int, int, int]] = {}
        for at in range(0, len(params), 3):
            length, device_id, address = params[at : at + 3]
            asked.setdefault(device_id, (device_id, address, length))
        return self._read_many(list(asked.values()), now_s, lambda servo: servo.table.group_read == "bulk")

    def _read_many(
        self, asked: list[tuple[int, int, int]], now_s: float, knows: Callable[[SimulatedServo], bool]
    ) -> list[Reply]:
        """One status each, in the order asked for; a silent one may silence those behind it."""
        replies: list[Reply] = []
        for device_id, address, length in asked:
            servo = self.find(device_id, now_s)
            answers: list[Reply] = []
            if servo is not None and knows(servo):
                act = partial(read, address=address, length=length, now_s=now_s)
                answers = self.answer(device_id, 1, now_s, act)
            replies += answers
            if not answers and self.chain_stop:
                break
        return replies

    def _sync_write(self, packet: Packet1, now_s: float) -> list[Reply]:
        """Address, length, (id, data) repeated; an entry that is cut short is left out."""
        params = packet.params
        if packet.id != BROADCAST_ID or len(params) < 2:
            return []
        address, length = params[:2]
        for at in range(2, len(params) - length, length + 1):
            for servo in self.group(params[at], now_s):
                servo.write(address, params[at + 1 : at + 1 + length], now_s)
        return []


def read(servo: SimulatedServo, address: int, length: int, now_s: float) -> tuple[int, bytes]:
    """(error flags, data) of a read."""
    number, data = servo.read(address, length, now_s)
    return error_flags(servo, number), data


def error_flags(servo: SimulatedServo, error: int) -> int:
    """Error byte of Protocol 1.0 for a Protocol 2.0 one: latched hardware errors, and why it was refused.

    Feetech tells the hardware errors only.
    """
    flags = servo.hardware_error
    if servo.forced_alert:
        flags |= Error1.INPUT_VOLTAGE
    number = error & ~ALERT
    if number and not servo.is_feetech:
        flags |= _FLAGS[ErrorNumber(number)]
    return int(flags)
