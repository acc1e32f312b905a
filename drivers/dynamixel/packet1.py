"""Dynamixel Protocol 1.0 packets (AX, MX; Feetech uses them too) as pure functions.

Layout (ROBOTIS e-Manual, Protocol 1.0)::

    FF FF | ID | LEN | INST or ERR | PARAMETERS | CHK

LEN is the number of parameters + 2, CHK the inverted low byte of the sum from ID to the last parameter.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

HEADER = b"\xff\xff"
BROADCAST_ID = 0xFE
MAX_ID = 253


class Instruction1(IntEnum):
    """Instruction numbers; SYNC_READ is Feetech's own."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    BULK_READ = 0x92


class Error1(IntFlag):
    """Error byte of a status packet: flags, unlike Protocol 2.0."""

    NONE = 0
    INPUT_VOLTAGE = 0x01
    ANGLE_LIMIT = 0x02
    OVERHEATING = 0x04
    RANGE = 0x08
    CHECKSUM = 0x10
    OVERLOAD = 0x20
    INSTRUCTION = 0x40


class Packet1(NamedTuple):
    """One packet: `id`, `code` (the instruction, or the error byte of a status packet), `params`.

    Both directions look alike: which one it is follows from who sent it.
    """

    id: int
    code: int
    params: bytes


def checksum(body: bytes) -> int:
    """CHK of the bytes from ID to the last parameter."""
    return ~sum(body) & 0xFF


def encode(device_id: int, code: int, params: bytes = b"") -> bytes:
    """One packet of either direction.

    Parameters
    ----------
    device_id : 0 to 253, or `BROADCAST_ID`.
    code : an `Instruction1`, or the error byte of a status packet.
    params : up to 253 bytes.

    Raises
    ------
    ValueError : an id or a length that no packet can carry.
    """
    if not 0 <= device_id <= BROADCAST_ID:
        raise ValueError(f"device_id {device_id}: a packet carries 0-253, or 254 for all")
    if len(params) > 253:
        raise ValueError(f"params: {len(params)} bytes, a packet carries 253 at most")
    body = bytes((device_id, len(params) + 2, code)) + params
    return HEADER + body + bytes((checksum(body),))


class Reader1:
    """Cuts a byte stream into packets whose length and checksum are right, whatever lies between them.

    Attributes
    ----------
    noise_bytes : bytes thrown away because they belong to no valid packet.
    broken_frames : packets begun whose length or checksum was wrong.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.noise_bytes = 0
        self.broken_frames = 0

    @property
    def pending(self) -> int:
        """Bytes held back because the packet they begin is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Packet1]:
        """Add received bytes; return the packets completed by them."""
        self._buffer += data
        packets = []
        while (packet := self._next()) is not None:
            packets.append(packet)
        return packets

    def flush(self) -> list[Packet1]:
        """Give up on the incomplete packet (the sender paused); return valid ones found behind its header."""
        packets: list[Packet1] = []
        while self._buffer:
            self.broken_frames += self._buffer.startswith(HEADER)
            self._drop(1)
            packets += self.feed(b"")
        return packets

    def take_pending(self) -> bytes:
        """Remove and return the incomplete bytes."""
        data = bytes(self._buffer)
        self._buffer.clear()
        return data

    def _drop(self, count: int) -> None:
        self.noise_bytes += count
        del self._buffer[:count]

    def _next(self) -> Packet1 | None:
        buffer = self._buffer
        while True:
            at = buffer.find(HEADER)
            if at < 0:
                self._drop(len(buffer) - buffer.endswith(b"\xff"))
                return None
            self._drop(at)
            if len(buffer) < 4:
                return None
            if buffer[2] == 0xFF or buffer[3] < 2:
                self.broken_frames += buffer[2] != 0xFF
                self._drop(1)
                continue
            size = 4 + buffer[3]
            if len(buffer) < size:
                return None
            frame = bytes(buffer[:size])
            if frame[-1] == checksum(frame[2:-1]):
                del buffer[:size]
                return Packet1(frame[2], frame[4], frame[5:-1])
            self.broken_frames += 1
            self._drop(1)
