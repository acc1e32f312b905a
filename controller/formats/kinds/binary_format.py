"""Format of omote's binary frame: a whole face in 139 bytes, for microcontrollers and radio links.

It is specified in docs/links.md. 59 parameters at 60 Hz need 83,400 of 115,200 baud. COBS (Cheshire and Baker,
"Consistent Overhead Byte Stuffing", 1999) reserves zero bytes for the end of a frame, and CRC-16/CCITT-FALSE detects
damage.
"""

from __future__ import annotations

import binascii
import struct

import numpy as np

from controller.base.parameters import Parameters
from controller.formats.format import API, Format, base_only
from controller.formats.frame import Frame, Refusals

VERSION = 1
UNIT = 16_384
"""Integer that stands for a value of 1, so that signed 16 bits hold nearly -2 to 2."""
LARGEST = 32_767
"""Largest integer of a value."""

_HEAD = struct.Struct("<BHIBB")  # version, sequence, milliseconds, flags, count
_CRC = struct.Struct("<H")
_FACE_FLAG = 1
_TIME_FLAG = 2
_MILLISECONDS = 1 << 32


class BinaryDecoder:
    """Decodes frames with or without the zero byte that ends them, which programs may also send in a datagram."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._size, self._base = len(parameters), parameters.base
        self._wraps, self._last = 0, 0

    def feed(self, message: bytes) -> list[Frame]:
        """Return the undamaged frames of a message."""
        return [frame for stuffed in message.strip(b"\0").split(b"\0") for frame in self._read(stuffed)]

    def _read(self, stuffed: bytes) -> list[Frame]:
        try:
            return [self._frame(unstuff(stuffed))]
        except (ValueError, struct.error) as error:
            self.refused.add(str(error) if isinstance(error, ValueError) else "too short")
            return []

    def _frame(self, data: bytes) -> Frame:
        body, crc = data[: -_CRC.size], data[-_CRC.size :]
        if len(body) < _HEAD.size or _CRC.pack(binascii.crc_hqx(body, 0xFFFF)) != crc:
            raise ValueError("a wrong checksum")
        version, sequence, milliseconds, flags, count = _HEAD.unpack_from(body)
        if version != VERSION:
            raise ValueError(f"version {version}; this omote reads version {VERSION}")
        offset = _HEAD.size + (count + 7) // 8
        bits = np.frombuffer(body[_HEAD.size : offset], np.uint8)
        given = np.unpackbits(bits, bitorder="little")[:count].astype(bool)
        if len(body) != offset + 2 * int(given.sum()):
            raise ValueError("a wrong length")
        values, mask = np.zeros(max(self._size, count)), np.zeros(max(self._size, count), dtype=bool)
        values[:count][given] = np.frombuffer(body, "<i2", offset=offset) / UNIT
        mask[: min(count, self._base)] = given[: self._base]  # only parameters of the base vocabulary have numbers
        time_s = milliseconds / 1000.0 if flags & _TIME_FLAG else None
        face = bool(flags & _FACE_FLAG)
        return Frame(values[: self._size], mask[: self._size], time_s, self._unwrap(sequence), face)

    def _unwrap(self, sequence: int) -> int:
        """Return the number of a frame, which continues to increase where its 16 bits wrap round."""
        if sequence < self._last and self._last - sequence > 1 << 15:
            self._wraps += 1
        self._last = sequence
        return self._wraps << 16 | sequence


class BinaryEncoder:
    """Encodes frames without the zero byte that ends them; values are clipped to about -2..2."""

    def __init__(self, parameters: Parameters) -> None:
        self._sequence, self._base = 0, parameters.base

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message."""
        flags = _FACE_FLAG * frame.face | (_TIME_FLAG if frame.time_s is not None else 0)
        milliseconds = round((frame.time_s or 0.0) * 1000.0) % _MILLISECONDS
        mask = (frame.mask if frame.face else np.zeros_like(frame.mask))[: self._base]
        head = _HEAD.pack(VERSION, self._sequence, milliseconds, flags, len(mask))
        self._sequence = self._sequence + 1 & 0xFFFF
        values = np.clip(np.rint(frame.values[: self._base][mask] * UNIT), -LARGEST, LARGEST).astype("<i2")
        body = head + np.packbits(mask, bitorder="little").tobytes() + values.tobytes()
        return [stuff(body + _CRC.pack(binascii.crc_hqx(body, 0xFFFF)))]


def stuff(data: bytes) -> bytes:
    """Return the COBS encoding of bytes, which has no zero: blocks of up to 254 other bytes follow their length."""
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
        out.append(len(block) + 1)
        out += block
    return bytes(out)


def unstuff(data: bytes) -> bytes:
    """Return the bytes that :func:`stuff` encoded. Raises ValueError: they are not a COBS encoding."""
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        block = data[at + 1 : at + code]
        if code == 0 or len(block) != code - 1 or 0 in block:
            raise ValueError("not stuffed")
        out += block
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


FORMAT = Format(
    api=API,
    kind="binary",
    title="omote's binary frame",
    transports=("serial", "udp", "tcp"),
    port=9401,
    decoder=BinaryDecoder,
    encoder=BinaryEncoder,
    carries=base_only,
    delimiter=b"\0",
    most=1024,
    takes_token=True,
)
