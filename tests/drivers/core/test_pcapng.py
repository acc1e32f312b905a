"""drivers.core.pcapng: against a reader made from the specification, one of another library, and damaged files."""

from __future__ import annotations

import io
import random
import struct

import pytest

from drivers.base.errors import DriverError
from drivers.core import pcapng
from drivers.core.pcapng import file_head, packet, read_pcapng
from drivers.core.trafficlog import Piece, Wire

WIRE = Wire("dynamixel", 57_600, {1: "xl330-m288"})
PIECES = (Piece(0.0, True, b"\xff\xff\xfd"), Piece(0.25, False, b"1234"), Piece(0.5, None, b"x"))
BEGUN_NS = 1_700_000_000_000_000_000
FILE = file_head(WIRE) + b"".join(packet(piece, BEGUN_NS) for piece in PIECES)


def blocks(data: bytes) -> list[tuple[int, bytes]]:
    """Type and body of each block, both lengths checked, as section 3.1 of the draft has them."""
    found, at = [], 0
    while at < len(data):
        kind, size = struct.unpack_from("<II", data, at)
        assert size % 4 == 0 and struct.unpack_from("<I", data, at + size - 4) == (size,)
        found.append((kind, data[at + 8 : at + size - 4]))
        at += size
    return found


def test_the_blocks_are_those_of_the_specification() -> None:
    section, interface, *packets = blocks(FILE)
    assert section == (0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    assert interface[0] == 1 and struct.unpack_from("<HHI", interface[1]) == (147, 0, 0)
    assert b"servos = 1:xl330-m288" in interface[1]
    assert [kind for kind, _ in packets] == [6, 6, 6]
    number, high, low, captured, original = struct.unpack_from("<IIIII", packets[1][1])
    assert (number, captured, original) == (0, 4, 4)
    assert (high << 32 | low) == 1_700_000_000_250_000_000
    assert packets[1][1][20:24] == b"1234"
    assert packets[1][1][24:] == struct.pack("<HHIHH", 2, 4, 1, 0, 0), "epb_flags: inbound, then the end of options"


def test_another_library_reads_it() -> None:
    dpkt = pytest.importorskip("dpkt", reason="dpkt, a reader of pcapng, is not installed")
    rows = list(dpkt.pcapng.Reader(io.BytesIO(FILE)))
    assert [bytes(data) for _, data in rows] == [piece.data for piece in PIECES]
    assert [round(float(stamp) - BEGUN_NS * 1e-9, 3) for stamp, _ in rows] == [0.0, 0.25, 0.5]


def test_it_comes_back() -> None:
    record = read_pcapng(FILE)
    assert record.wire == WIRE
    assert [piece[1:] for piece in record.pieces] == [piece[1:] for piece in PIECES]
    assert [piece.time_s for piece in record.pieces] == pytest.approx([0.0, 0.25, 0.5], abs=1e-6)


def test_files_of_other_programs_in_the_other_byte_order() -> None:
    """A capture in microseconds, the default, with a block of a kind that nobody knows."""

    def block(kind: int, body: bytes) -> bytes:
        return struct.pack(">II", kind, 12 + len(body)) + body + struct.pack(">I", 12 + len(body))

    data = block(0x0A0D0D0A, struct.pack(">IHHq", 0x1A2B3C4D, 1, 0, -1)) + block(1, struct.pack(">HHI", 147, 0, 0))
    data += block(99, b"1234")
    data += b"".join(block(6, struct.pack(">IIIII", 0, 0, micros, 2, 2) + b"ab\0\0") for micros in (5, 1_000_005))
    record = read_pcapng(data)
    assert record.wire == Wire()
    assert [piece.time_s for piece in record.pieces] == pytest.approx([0.0, 1.0])
    assert [piece[1:] for piece in record.pieces] == [(None, b"ab")] * 2


def test_damaged_files_are_one_message() -> None:
    rng = random.Random(5)
    for _ in range(300):
        damaged = bytearray(FILE)
        for _ in range(rng.randrange(1, 4)):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        try:
            read_pcapng(bytes(damaged[: rng.randrange(len(damaged) + 1)]))
        except DriverError as error:
            assert str(error)


def test_a_cut_file_is_told() -> None:
    with pytest.raises(DriverError, match="damaged after 2 packets"):
        read_pcapng(FILE[:-5])


def test_the_number_of_packets_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pcapng, "MAX_PIECES", 2)
    with pytest.raises(DriverError, match="at most 2 pieces"):
        read_pcapng(FILE)
