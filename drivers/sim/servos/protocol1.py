"""Simulated servos with Protocol 1.0 framing on one wire: Dynamixel AX and MX, Feetech STS and SCS.

The two makers differ: Dynamixel reports a refused instruction in its error flags and has a bulk read (MX only);
Feetech has a sync read (STS only), reports hardware errors only and ignores what it refuses.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from drivers.packets.packet import ALERT, ErrorNumber
from drivers.packets.packet1 import BROADCAST_ID, Error1, Packet1, Reader1, encode
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.protocol import Protocol, ReadRequest
from drivers.sim.wire.timing import Reply

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


class Protocol1(Protocol):
    """Servos that speak Protocol 1.0 framing on one wire."""

    NUMBER = 1
    WORD = 1
    MALFORMED_READ_LEVEL = 2

    @staticmethod
    def make_reader() -> Reader1:
        """A reader of packets. (A status packet looks like an instruction; servos receive only the host's bytes.)"""
        return Reader1()

    def size(self, packet: Packet1) -> int:
        return 6 + len(packet.params)

    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        return encode(device_id, error, data)

    def error_byte(self, servo: SimulatedServo, error: int) -> int:
        """Flags: latched hardware errors and, except from Feetech servos, why the instruction was refused."""
        flags = servo.hardware_error
        if servo.forced_alert:
            flags |= Error1.INPUT_VOLTAGE
        number = error & ~ALERT
        if number and not servo.is_feetech:
            flags |= _FLAGS[ErrorNumber(number)]
        return int(flags)

    def identity(self, servo: SimulatedServo) -> bytes:
        """None: a ping does not report the model."""
        return b""

    def factory_reset(self, servo: SimulatedServo, packet: Packet1, now_s: float) -> int:
        """Feetech keeps the id, Dynamixel does not."""
        return servo.factory_reset(1 if servo.is_feetech else 0xFF, now_s)

    def reboot(self, servo: SimulatedServo, now_s: float) -> int:
        """MX only; the others do not know it."""
        if not servo.table.model.startswith("mx"):
            return ErrorNumber.INSTRUCTION
        servo.reboot(now_s)
        return 0

    def _sync_read(self, packet: Packet1, now_s: float) -> list[Reply]:
        """STS only; SCS and Dynamixel servos stay silent."""
        return self._read_many(self._sync_requests(packet), now_s, "sync")

    def _bulk_read(self, packet: Packet1, now_s: float) -> list[Reply]:
        """MX only: 0, then (length, id, address) repeated; an id named twice is answered once, for the first."""
        params = packet.params[1:]
        if packet.id != BROADCAST_ID or len(params) % 3:
            return []
        requests: dict[int, ReadRequest] = {}
        for at in range(0, len(params), 3):
            length, device_id, address = params[at : at + 3]
            requests.setdefault(device_id, (device_id, address, length))
        return self._read_many(requests.values(), now_s, "bulk")

    def _read_many(self, requests: Iterable[ReadRequest], now_s: float, kind: str) -> list[Reply]:
        """One status each, in the requested order; servos after a silent one may not answer either."""
        replies: list[Reply] = []
        for device_id, address, length in requests:
            servo = self.find(device_id, now_s)
            answers: list[Reply] = []
            if servo is not None and servo.table.group_read == kind:
                act = partial(SimulatedServo.read, address=address, length=length, now_s=now_s)
                answers = self.answer(device_id, 1, now_s, act)
            replies += answers
            if not answers and self.chain_stop:
                break
        return replies
