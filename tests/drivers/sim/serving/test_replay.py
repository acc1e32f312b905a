"""drivers.sim.serving.replay: a recorded bus answers as it did."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.core.trafficlog import Piece, TrafficRecord, Wire
from drivers.packets.packet import Instruction, encode_instruction, encode_status
from drivers.packets.packet1 import encode
from drivers.sim.serving.replay import Replay
from drivers.sim.wire.timing import Reply

SERVOS = Wire("dynamixel", 1_000_000, {1: "xl330-m288"})
READ = encode_instruction(1, Instruction.READ, b"\x84\0\4\0")
WRITE = encode_instruction(1, Instruction.WRITE, b"\x74\0\0\1\0\0")
FIRST, SECOND = encode_status(1, 0, b"\1\0\0\0"), encode_status(1, 0, b"\2\0\0\0")
ROWS = (Piece(0.0, True, READ), Piece(0.002, False, FIRST), Piece(1.0, True, WRITE + READ[:5]),
        Piece(1.1, True, READ[5:]), Piece(1.103, False, SECOND[:4]), Piece(1.104, False, SECOND[4:]))  # fmt: skip


def data(replies: list[Reply]) -> bytes:
    return b"".join(reply.data for reply in replies)


def test_each_request_gets_its_answers_in_order_and_then_the_last() -> None:
    replay = Replay(TrafficRecord(SERVOS, ROWS))
    assert data(replay.feed(b"noise" + READ[:3], 0.0)) == b""
    assert data(replay.feed(READ[3:], 0.0)) == FIRST
    assert [reply.late_s for reply in replay.feed(READ, 0.0)] == pytest.approx([0.003, 0.001])
    assert data(replay.feed(READ + WRITE, 0.0)) == SECOND
    assert replay.describe(0.0) == [{"requests": 4, "not recorded": 0}]


def test_what_was_not_recorded_gets_no_answer() -> None:
    replay = Replay(TrafficRecord(SERVOS, ROWS))
    assert replay.feed(encode_instruction(2, Instruction.PING), 0.0) == []
    assert (replay.requests, replay.unknown) == (1, 1)


def test_a_wire_that_was_only_listened_to_is_told_apart_by_its_packets() -> None:
    rows = [Piece(piece.time_s, None, piece.data) for piece in ROWS]
    replay = Replay(TrafficRecord(Wire(model="xl330-m288"), tuple(rows)))
    assert [data(replay.feed(READ, 0.0)) for _ in range(3)] == [FIRST, SECOND, SECOND]
    with pytest.raises(DriverError, match="does not say what the host sent"):
        Replay(TrafficRecord(Wire(model="sts3215"), tuple(rows)))


def test_protocol_1_and_text() -> None:
    ping, pong = encode(1, 1), bytes.fromhex("FFFF010200FC")
    wire = Wire("feetech", servos={1: "sts3215"})
    replay = Replay(TrafficRecord(wire, (Piece(0, True, ping), Piece(0, False, pong))))
    assert data(replay.feed(ping, 0.0)) == pong
    rows = (Piece(0, True, b"Q\r"), Piece(0, False, b"."), Piece(0, True, b"QP 1\r"), Piece(0, False, b"\x96"))
    board = Replay(TrafficRecord(Wire("ssc32"), rows))
    assert data(board.feed(b"xQP", 0.0)) == b"" and board.reader.pending == 2
    assert data(board.feed(b" 1\rQ\r", 0.0)) == b"\x96."
    assert data(board.feed(b"QX", 0.0)) == b"" and board.reader.pending == 0


def test_a_record_without_requests_is_told() -> None:
    with pytest.raises(DriverError, match="no request"):
        Replay(TrafficRecord(SERVOS, (Piece(0.0, False, FIRST),)))
