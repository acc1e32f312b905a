"""Records of the traffic on a bus in the pcapng format, for Wireshark and other network analysers.

Source: IETF draft "PCAP Now Generic (pcapng) Capture File Format": Section Header Block (4.1), Interface Description
Block (4.2), Enhanced Packet Block (4.3), options (3.5). The bytes of the wire are the packets, of link type 147
(LINKTYPE_USER0, for private use); bits 0 and 1 of ``epb_flags`` say whether they came in (1) or went out (2). The
comment of the interface holds the head of a text log (:mod:`drivers.core.trafficlog`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

from drivers.base.errors import DriverError
from drivers.core.trafficlog import MAX_PIECES, Piece, TrafficRecord, Wire, read_head, read_keys

MAGIC = b"\x0a\x0d\x0d\x0a"
"""First bytes of every file."""
_SECTION, _INTERFACE, _PACKET = 0x0A0D0D0A, 1, 6
_BYTE_ORDER = 0x1A2B3C4D
_USER0 = 147
_END, _COMMENT, _FLAGS, _RESOLUTION = 0, 1, 2, 9
_NANO = 9
_DIRECTION: dict[bool | None, int] = {None: 0, False: 1, True: 2}
_SENT = {bits: sent for sent, bits in _DIRECTION.items()}


def file_head(wire: Wire) -> bytes:
    """The first blocks of a file."""
    section = struct.pack("<IHHq", _BYTE_ORDER, 1, 0, -1)
    options = _option(_COMMENT, wire.head().encode()) + _option(_RESOLUTION, bytes((_NANO,))) + _option(_END, b"")
    return _block(_SECTION, section) + _block(_INTERFACE, struct.pack("<HHI", _USER0, 0, 0) + options)


def packet(piece: Piece, begun_ns: int) -> bytes:
    """The block of a piece of traffic. begun_ns : time of the beginning, nanoseconds since 1970."""
    stamp = begun_ns + round(piece.time_s * 1e9)
    size = len(piece.data)
    body = struct.pack("<IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, size, size) + _padded(piece.data)
    flags = struct.pack("<I", _DIRECTION[piece.sent])
    return _block(_PACKET, body + _option(_FLAGS, flags) + _option(_END, b""))


def _block(kind: int, body: bytes) -> bytes:
    size = 12 + len(body)
    return struct.pack("<II", kind, size) + body + struct.pack("<I", size)


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + _padded(value)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


# ------------------------------------------------------------ reading
class _Block(NamedTuple):
    kind: int
    body: bytes
    order: str


def read_pcapng(data: bytes) -> TrafficRecord:
    """A file that omote wrote, or another with packets of bytes on a wire. Raises DriverError: it is damaged."""
    wire, pieces = Wire(), []
    seconds, first = 1e-6, None
    try:
        for block in _blocks(data):
            if block.kind == _INTERFACE:
                options = dict(_options(block.body[8:], block.order))
                wire = read_head(read_keys(options.get(_COMMENT, b"").decode("utf-8", "replace")))
                seconds = _resolution(options.get(_RESOLUTION, b"\x06"))
            elif block.kind == _PACKET:
                stamp, piece = _read_packet(block, seconds)
                first = stamp if first is None else first
                pieces.append(piece._replace(time_s=max((stamp - first) * seconds, 0.0)))
                if len(pieces) > MAX_PIECES:
                    raise DriverError(f"a record has at most {MAX_PIECES} pieces", hint="cut it into parts")
    except (struct.error, IndexError) as error:
        raise DriverError(f"it is damaged after {len(pieces)} packets", hint="record it again") from error
    return TrafficRecord(wire, tuple(pieces))


def _blocks(data: bytes) -> Iterator[_Block]:
    order, at = "<", 0
    while at < len(data):
        if data[at : at + 4] == MAGIC:
            order = "<" if data[at + 8 : at + 12] == struct.pack("<I", _BYTE_ORDER) else ">"
        kind, size = struct.unpack_from(order + "II", data, at)
        if size < 12 or size % 4 or at + size > len(data):
            raise struct.error("wrong size of a block")
        yield _Block(kind, data[at + 8 : at + size - 4], order)
        at += size


def _options(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(data):
        code, size = struct.unpack_from(order + "HH", data, at)
        if code == _END:
            return
        yield code, data[at + 4 : at + 4 + size]
        at += 4 + size + -size % 4


def _resolution(value: bytes) -> float:
    """Seconds of one step of a time stamp: a power of ten, or with the high bit one of two."""
    exponent = value[0] & 0x7F
    return 2.0**-exponent if value[0] & 0x80 else 10.0**-exponent


def _read_packet(block: _Block, seconds: float) -> tuple[int, Piece]:
    _, high, low, size, _ = struct.unpack_from(block.order + "IIIII", block.body)
    if 20 + size > len(block.body):
        raise struct.error("a packet is longer than its block")
    options = dict(_options(block.body[20 + size + -size % 4 :], block.order))
    flags = options.get(_FLAGS, bytes(4))
    (bits,) = struct.unpack(block.order + "I", flags)
    return high << 32 | low, Piece(0.0, _SENT.get(bits & 3), block.body[20 : 20 + size])
