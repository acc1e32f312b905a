"""Dynamixel Protocol 1.0 packets, which Feetech servos use too: encoding, checksum and a stream reader.

Layout (ROBOTIS e-Manual, Protocol 1.0)::

    FF FF | ID | LEN | INST or ERR | PARAMETERS | CHK

LEN is the number of parameters + 2, CHK the inverted low byte of the sum from ID to the last parameter.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

from drivers.packets.framing import FrameReader

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

    Both directions have one format: only the sender distinguishes them.
    """

    id: int
    code: int
    params: bytes

    @property
    def error(self) -> int:
        """The error byte of a status packet."""
        return self.code


def checksum(body: bytes) -> int:
    """CHK of the bytes from ID to the last parameter."""
    return ~sum(body) & 0xFF


def encode(device_id: int, code: int, params: bytes = b"") -> bytes:
    """One packet of either direction; `code` is an `Instruction1`, or the error byte of a status packet.

    Raises ValueError: an id other than 0 to 253 and `BROADCAST_ID`, or more than 253 bytes of parameters.
    """
    if not 0 <= device_id <= BROADCAST_ID:
        raise ValueError(f"device_id {device_id}: a packet carries 0-253, or 254 for all")
    if len(params) > 253:
        raise ValueError(f"params: {len(params)} bytes, a packet carries 253 at most")
    body = bytes((device_id, len(params) + 2, code)) + params
    return HEADER + body + bytes((checksum(body),))


class Reader1(FrameReader[Packet1]):
    """Finds the packets of either direction in a byte stream."""

    MARK = HEADER

    def _decode(self, frames: list[bytes]) -> list[Packet1]:
        return [Packet1(frame[2], frame[4], frame[5:-1]) for frame in frames]

    def _next(self) -> bytes | None:
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
                return frame
            self.broken_frames += 1
            self._drop(1)
