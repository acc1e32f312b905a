"""drivers.dynamixel.frames: prepared packets and replies are those of the codec; anything unexpected is left to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from drivers.dynamixel.frames import GoalFrame, GroupRead, Run
from drivers.packets.packet import (
    BROADCAST_ID,
    Instruction,
    crc16,
    encode_fast_head,
    encode_fast_part,
    encode_instruction,
    encode_status,
)

RUNS = (Run((1, 7, 3), 132, 4), Run((9, 20), 37, 6))
LENGTHS = {servo: run.length for run in RUNS for servo in run.ids}
octets = st.integers(0, 255)
contents = st.tuples(*(st.tuples(octets, st.binary(min_size=n, max_size=n)) for n in LENGTHS.values()))
Contents = tuple[tuple[int, bytes], ...]


def plain(said: Contents) -> bytes:
    return b"".join(encode_status(servo, error, data) for servo, (error, data) in zip(LENGTHS, said, strict=True))


def joint(said: Contents) -> bytes:
    out = head = encode_fast_head(list(LENGTHS.values()))
    crc = crc16(head)
    for servo, (error, data) in zip(LENGTHS, said, strict=True):
        part, crc = encode_fast_part(servo, error, data, crc)
        out += part
    return out


def spoken(group: GroupRead, data: bytes) -> list[tuple[int, bytes]] | None:
    replies = group.decode(data)
    if replies is None:
        return None
    assert [(servo, reply.id) for servo, reply in replies.items()] == [(servo, servo) for servo in LENGTHS]
    return [(reply.error, reply.params) for reply in replies.values()]


@examples(deadline=None)
@given(contents)
def test_what_the_servos_said_comes_out(said: Contents) -> None:
    stuffed = len(plain(said)) != GroupRead(RUNS).size
    assert spoken(GroupRead(RUNS), plain(said)) == (None if stuffed else list(said))
    assert spoken(GroupRead(RUNS, fast=True), joint(said)) == list(said)
    assert len(joint(said)) == 8 + sum(4 + length for length in LENGTHS.values())


SAID: Contents = tuple((0x80, bytes(range(n))) for n in LENGTHS.values())


@pytest.mark.parametrize("fast", [False, True])
def test_one_wrong_bit_anywhere_is_seen(fast: bool) -> None:
    group, data = GroupRead(RUNS, fast), joint(SAID) if fast else plain(SAID)
    for at in range(len(data)):
        for bit in (1, 0x80):
            assert group.decode(data[:at] + bytes((data[at] ^ bit,)) + data[at + 1 :]) is None
    assert group.decode(data[:-1]) is None
    assert group.decode(b"\0" + data[:-1]) is None
    assert spoken(group, data) == list(SAID)


def test_replies_in_another_order_are_left_to_the_careful_reader() -> None:
    data = plain(SAID)
    assert GroupRead((Run((7, 1, 3), 132, 4), RUNS[1])).decode(data) is None


def test_the_request_is_a_sync_read_or_a_bulk_read_by_who_is_asked() -> None:
    words = b"\x84\x00\x04\x00"
    one = RUNS[:1]
    assert GroupRead(one).frame == encode_instruction(BROADCAST_ID, Instruction.SYNC_READ, words + b"\1\7\3")
    assert GroupRead(one, True).frame == encode_instruction(BROADCAST_ID, Instruction.FAST_SYNC_READ, words + b"\1\7\3")
    entries = b"".join(bytes((i, run.address, 0, run.length, 0)) for run in RUNS for i in run.ids)
    assert GroupRead(RUNS).frame == encode_instruction(BROADCAST_ID, Instruction.BULK_READ, entries)
    assert GroupRead(RUNS, True).frame == encode_instruction(BROADCAST_ID, Instruction.FAST_BULK_READ, entries)


@examples(deadline=None)
@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=2, max_size=2))
def test_goals_make_the_packet_that_the_codec_makes(goals: list[int]) -> None:
    frame = GoalFrame((5, 250), 116, 4, np.array([0, 1]))
    for values in (goals, [0, 0x00FDFFFF], goals[::-1]):
        rows = b"".join(
            bytes((i,)) + v.to_bytes(4, "little", signed=True) for i, v in zip((5, 250), values, strict=True)
        )
        expected = encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, b"\x74\0\4\0" + rows)
        assert frame.encode(np.array(values, np.int32)) == expected
    small = encode_instruction(BROADCAST_ID, Instruction.SYNC_WRITE, b"\x1e\0\2\0\5\x10\x02")
    assert GoalFrame((5,), 30, 2, np.array([1])).encode(np.array([7, 0x210], np.int32)) == small
