"""Dynamixel Protocol 2.0 packets: CRC-16, byte stuffing, encoding and decoding, stream readers.

Drivers and simulated servos share it. Layout (ROBOTIS e-Manual, Protocol 2.0)::

    FF FF FD 00 | ID | LEN_L LEN_H | INST [ERR] PARAMETERS | CRC_L CRC_H

LEN counts INST, ERR, the stuffed parameters and the CRC. The CRC covers every byte before it, as sent.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Sequence
from enum import IntEnum
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from drivers.packets.framing import FrameReader, P

HEADER = b"\xff\xff\xfd"
STUFFED = b"\xff\xff\xfd\xfd"
BROADCAST_ID = 0xFE
MAX_ID = 252
ALERT = 0x80
"""Bit of a status packet's error byte: the device has latched a hardware error. The data is still valid."""
MAX_LENGTH = 2048
"""Largest LEN a reader believes; a larger one is taken for damage."""

_PREFIX = HEADER + b"\x00"
_HEAD_SIZE = 7
_MAX_STATES = 3  # every further CRC state followed makes an accidental match likelier


class Instruction(IntEnum):
    """Instruction numbers (e-Manual, Protocol 2.0, section Instruction)."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REG_WRITE = 0x04
    ACTION = 0x05
    FACTORY_RESET = 0x06
    REBOOT = 0x08
    CLEAR = 0x10
    STATUS = 0x55
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83
    FAST_SYNC_READ = 0x8A
    BULK_READ = 0x92
    BULK_WRITE = 0x93
    FAST_BULK_READ = 0x9A


class ErrorNumber(IntEnum):
    """Bits 0-6 of a status packet's error byte: a number, not flags."""

    NONE = 0
    RESULT_FAIL = 1
    INSTRUCTION = 2
    CRC = 3
    DATA_RANGE = 4
    DATA_LENGTH = 5
    DATA_LIMIT = 6
    ACCESS = 7


class InstructionPacket(NamedTuple):
    """One instruction, unstuffed: `id`, `instruction` number, `params`."""

    id: int
    instruction: int
    params: bytes


class StatusPacket(NamedTuple):
    """One device's reply, unstuffed: `id`, `error` byte (number in bits 0-6, `ALERT`), `params`."""

    id: int
    error: int
    params: bytes

    @property
    def alert(self) -> bool:
        """Whether the device has latched a hardware error."""
        return bool(self.error & ALERT)

    @property
    def error_number(self) -> int:
        """Why the instruction failed; 0 when it did not."""
        return self.error & 0x7F


def _crc_table(shifts: int) -> array[int]:
    """CRC of every 16-bit state after so many zero bits: polynomial 0x8005, most significant bit first. (65536,).

    An array and not a list: 128 KiB stay in the processor's cache.
    """
    crc = np.arange(0x10000)
    for _ in range(shifts):
        crc = (crc << 1 ^ 0x8005 * (crc >> 15)) & 0xFFFF
    return array("H", crc.astype(np.uint16).tobytes())


_BYTES, _WORDS = _crc_table(8), _crc_table(16)


def crc16(data: bytes | bytearray | memoryview, crc: int = 0) -> int:
    """CRC-16 of `data`, continuing from `crc` (CRC-16/UMTS: 0x8005, initial 0, not reflected, no final xor).

    `crc16(b, crc16(a)) == crc16(a + b)`, so a joint packet's checksum can be carried from device to device.
    """
    words = _WORDS
    pairs, odd = divmod(len(data), 2)
    for word in struct.unpack_from(f">{pairs}H", data):
        crc = words[crc ^ word]
    if odd:
        crc = _BYTES[crc ^ data[-1] << 8]
    return crc


def stuff(body: bytes) -> bytes:
    """`body` (INST to last parameter) with FD added after each FF FF FD."""
    return body.replace(HEADER, STUFFED) if HEADER in body else body


def unstuff(body: bytes) -> bytes:
    """The inverse of `stuff`. Scans the bytes as received, so FF FF FD FF FD FD keeps its last FD."""
    return body.replace(STUFFED, HEADER) if HEADER in body else body


@lru_cache(maxsize=4096)
def _head(device_id: int, length: int, instruction: int) -> tuple[bytes, int]:
    """Bytes from the header to INST, and their CRC: the same for every packet of one device and length."""
    head = _PREFIX + bytes((device_id, length & 0xFF, length >> 8, instruction))
    return head, crc16(head)


def _encode(device_id: int, instruction: int, params: bytes) -> bytes:
    params = stuff(params)
    head, crc = _head(device_id, len(params) + 3, instruction)
    crc = crc16(params, crc)
    return head + params + bytes((crc & 0xFF, crc >> 8))


def encode_instruction(device_id: int, instruction: int, params: bytes = b"") -> bytes:
    """One instruction packet, stuffed and with its CRC; `params` are the bytes after INST, not stuffed.

    Raises ValueError: an id other than 0 to 252 and `BROADCAST_ID`.
    """
    if not 0 <= device_id <= BROADCAST_ID or device_id == 0xFD:
        raise ValueError(f"device_id {device_id}: a packet carries 0-252, or 254 for all")
    return _encode(device_id, instruction, params)


def encode_status(device_id: int, error: int = 0, params: bytes = b"") -> bytes:
    """One status packet of `device_id`: `error` byte, then `params` (not stuffed)."""
    return _encode(device_id, Instruction.STATUS, bytes((error,)) + params)


def encode_fast_head(lengths: Sequence[int]) -> bytes:
    """First bytes of a fast read's joint reply to reads of `lengths` bytes, up to INST; LEN counts the full reply."""
    length = 1 + sum(4 + length for length in lengths)
    return _PREFIX + bytes((BROADCAST_ID, length & 0xFF, length >> 8, Instruction.STATUS))


def encode_fast_part(device_id: int, error: int, data: bytes, crc: int) -> tuple[bytes, int]:
    """One device's part of a joint reply, unstuffed, and the CRC of the reply up to its end.

    `crc` is that of all bytes of the reply before this part, earlier devices' CRCs included.
    """
    part = bytes((error, device_id)) + data
    crc = crc16(part, crc)
    low, high = crc & 0xFF, crc >> 8
    return part + bytes((low, high)), _WORDS[crc ^ (low << 8 | high)]


def decode_fast(data: bytes, devices: Sequence[tuple[int, int]]) -> list[StatusPacket]:
    """Replies in a joint packet, decoded by position. It may be cut short or damaged in places.

    A device's CRC covers everything before it, so one damaged byte would fail all later devices. After a mismatch
    the decoder goes on from every CRC state that damage can explain (in the data, in the CRC at the device, or in
    the CRC on the wire), so only the damaged device is left out.

    data : received bytes; anything before the joint packet's header is skipped.
    devices : (id, bytes read) in request order; so are the replies, of devices whose id and CRC are right.
    """
    head = encode_fast_head([length for _, length in devices])
    start = data.find(head)
    if start < 0:
        return []
    at, states, replies = start + len(head), {crc16(head)}, []
    for device_id, length in devices:
        end = at + 2 + length
        if len(data) < end + 2:
            break
        part, tail = data[at:end], data[end : end + 2]
        sums, claimed = {crc16(part, state) for state in states}, tail[0] | tail[1] << 8
        if claimed in sums:
            sums = {claimed}
            if part[1] == device_id:
                replies.append(StatusPacket(device_id, part[0], part[2:]))
        else:
            sums = sums if len(sums) <= _MAX_STATES else set()
        states = {crc16(tail, total) for total in sums | {claimed}}
        states |= {crc16(bytes((total & 0xFF, total >> 8)), total) for total in sums}
        at = end + 2
    return replies


class PacketReader(FrameReader[P]):
    """Finds frames of Protocol 2.0, header to CRC, still stuffed."""

    MARK = _PREFIX

    def _seek_header(self) -> bool:
        """Drop what cannot begin a frame; True when a whole frame head lies at the start of the buffer."""
        buffer = self._buffer
        while True:
            at = buffer.find(HEADER)
            if at < 0:
                self._drop(len(buffer) - _header_tail(buffer))
                return False
            self._drop(at)
            if len(buffer) > 3 and buffer[3]:
                self._drop(3)
                continue
            if len(buffer) < _HEAD_SIZE:
                return False
            if 3 <= buffer[5] | buffer[6] << 8 <= MAX_LENGTH and buffer[4] not in (0xFD, 0xFF):
                return True
            self.broken_frames += 1
            self._drop(3)

    def _next(self) -> bytes | None:
        buffer = self._buffer
        while self._seek_header():
            size = _HEAD_SIZE + (buffer[5] | buffer[6] << 8)
            if len(buffer) < size:
                inner = self._inner_frame()
                if not inner:
                    return None
                self.broken_frames += 1
                self._drop(inner)
                continue
            frame = bytes(buffer[:size])
            if _checks(frame):
                del buffer[:size]
                return frame
            self.broken_frames += 1
            self._drop(3)
        return None

    def _inner_frame(self) -> int:
        """Where a complete valid frame begins inside an incomplete one (its LEN is damaged); 0 = nowhere."""
        buffer = self._buffer
        at = buffer.find(_PREFIX, 4)
        while at > 0 and len(buffer) - at >= _HEAD_SIZE:
            size = _HEAD_SIZE + (buffer[at + 5] | buffer[at + 6] << 8)
            if size >= 10 and len(buffer) - at >= size and _checks(buffer[at : at + size]):
                return at
            at = buffer.find(_PREFIX, at + 1)
        return 0


def _header_tail(buffer: bytearray) -> int:
    """How many bytes at the end could be the beginning of a header."""
    if buffer.endswith(b"\xff\xff"):
        return 2
    return 1 if buffer.endswith(b"\xff") else 0


def _checks(frame: bytes | bytearray) -> bool:
    return crc16(frame[:-2]) == frame[-2] | frame[-1] << 8


class InstructionReader(PacketReader[InstructionPacket]):
    """Finds the instructions in a byte stream; status packets are skipped."""

    def _decode(self, frames: list[bytes]) -> list[InstructionPacket]:
        return [
            InstructionPacket(frame[4], frame[7], unstuff(frame[8:-2]))
            for frame in frames
            if frame[7] != Instruction.STATUS
        ]


class StatusReader(PacketReader[StatusPacket]):
    """Finds the status packets in a byte stream; instruction packets (echoed by an adapter) are skipped.

    A joint reply of a fast read comes as one packet of id `BROADCAST_ID`, error 0, whose `params` are everything
    behind INST but the last CRC, not unstuffed. `decode_fast` also reads one that is damaged or cut short.
    """

    def _decode(self, frames: list[bytes]) -> list[StatusPacket]:
        replies = []
        for frame in frames:
            if frame[7] != Instruction.STATUS or len(frame) < 11:
                continue
            if frame[4] == BROADCAST_ID:
                replies.append(StatusPacket(BROADCAST_ID, 0, frame[8:-2]))
            else:
                replies.append(StatusPacket(frame[4], frame[8], unstuff(frame[9:-2])))
        return replies
