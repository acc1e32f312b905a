"""drivers.sim.servos.requests: group packets taken apart."""

from __future__ import annotations

import pytest

from drivers.packets.packet import BROADCAST_ID, InstructionPacket
from drivers.sim.servos.requests import bulk_reads, bulk_writes, sync_reads, sync_writes, words


def packet(text: str, device: int = BROADCAST_ID) -> InstructionPacket:
    return InstructionPacket(device, 0x82, bytes.fromhex(text))


def test_words():
    assert words(bytes.fromhex("84010400")) == (0x184, 4)


def test_sync_read():
    assert sync_reads(packet("8400 0400 03 07 04")) == [(3, 132, 4), (7, 132, 4), (4, 132, 4)]


def test_bulk_read():
    assert bulk_reads(packet("01 9000 0200 02 9200 0100")) == [(1, 144, 2), (2, 146, 1)]


def test_sync_write_leaves_out_what_is_cut_short():
    assert sync_writes(packet("7400 0200 01 9600 02 AA00 03 00")) == [(1, 116, b"\x96\0"), (2, 116, b"\xaa\0")]


def test_bulk_write_leaves_out_what_is_cut_short():
    assert bulk_writes(packet("01 2000 0200 A000 02 1F00 0100 50 03 1F00 0200 50")) == [
        (1, 32, b"\xa0\0"),
        (2, 31, b"\x50"),
    ]


@pytest.mark.parametrize("read", [sync_reads, bulk_reads, sync_writes, bulk_writes])
def test_broken_or_not_broadcast_asks_for_nothing(read):
    assert read(packet("8400 04")) == []
    assert read(packet("01 8400 0400", device=1)) == []
