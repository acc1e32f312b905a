"""drivers.sim.boards.board: brown-out, faults of answers, and pulses that move to their targets."""

from __future__ import annotations

import pytest

from drivers.base.errors import DriverError
from drivers.base.options import entries
from drivers.sim.boards.board import BROWN_OUT_V, RcChannel
from drivers.sim.boards.ssc32 import Ssc32
from drivers.sim.wire.simulator import simulator_of


def at(position: float) -> RcChannel:
    channel = RcChannel()
    channel.go(position, 0.0)
    return channel


def test_the_first_target_is_put_out_at_once_whatever_the_limits():
    channel = RcChannel()
    assert channel.position(0.0) == 0.0
    channel.go(1500.0, 1.0, speed=10.0, acceleration=10.0)
    assert channel.position(1.0) == 1500.0
    assert not channel.moving(1.0)


def test_without_limits_it_jumps():
    channel = at(1000.0)
    channel.go(2000.0, 1.0)
    assert channel.position(1.0) == 2000.0


def test_speed_and_acceleration():
    channel = at(1000.0)
    channel.go(1500.0, 1.0, speed=100.0)
    assert channel.position(2.0) == pytest.approx(1100.0)
    assert channel.moving(5.9)
    assert not channel.moving(6.1)
    channel = at(1000.0)
    channel.go(2000.0, 0.0, speed=100.0, acceleration=50.0)
    assert channel.position(1.0) == pytest.approx(1025.0)
    assert channel.position(3.0) == pytest.approx(1200.0)
    channel = at(1000.0)
    channel.go(1100.0, 0.0, acceleration=100.0)
    assert channel.position(1.0) == pytest.approx(1050.0)
    assert channel.position(2.0) == pytest.approx(1100.0)


def test_off_forgets_where_it_was():
    channel = at(1000.0)
    channel.go(0.0, 1.0, speed=1.0)
    assert (channel.position(2.0), channel.moving(2.0)) == (0.0, False)
    channel.go(1800.0, 2.0, speed=1.0)
    assert channel.position(2.0) == 1800.0


def test_a_move_in_a_given_time():
    channel = at(1000.0)
    channel.go_in(1500.0, 1.0, 2.0)
    assert channel.position(2.0) == pytest.approx(1250.0)
    channel.go_in(1000.0, 2.0, 0.0)
    assert channel.position(2.0) == 1000.0
    other = RcChannel()
    other.go_in(1500.0, 0.0, 9.0)
    assert other.position(0.0) == 1500.0
    other.go_in(0.0, 1.0, 9.0)
    assert other.position(1.0) == 0.0


def test_what_is_described_is_in_microseconds():
    channel = at(6000.0)
    channel.go(8000.0, 0.0, speed=1000.0)
    assert channel.describe(3, 1.0, 0.25) == {"id": 3, "pulse_us": 1750.0, "target_us": 2000.0}


def ask(board: Ssc32, line: bytes, now_s: float) -> bytes:
    return b"".join(reply.data for reply in board.feed(line, now_s))


def test_a_board_without_supply_is_deaf_and_starts_without_pulses():
    board = Ssc32()
    board.feed(b"#1P1500\r", 0.0)
    board.faults.add([f"volts:*:{BROWN_OUT_V}"], 1.0)
    assert ask(board, b"QP1\r", 1.0) == bytes((150,)), "just enough"
    board.faults.add(["volts:*:3.9:for=1s"], 2.0)
    assert ask(board, b"QP1\r#2P1000\r", 2.5) == b""
    assert ask(board, b"QP1\rQP2\r", 3.5) == b"\0\0"


def test_a_mute_board_keeps_its_pulses_until_both_faults_have_ended():
    board = Ssc32(faults=("mute:*", "mute:1"))
    board.feed(b"#1P1500\r", 0.0)
    assert board.channels[1].target == 0
    board.faults.clear("mute", 1.0)
    board.feed(b"#1P1500\r", 1.0)
    board.faults.add(["mute:*:for=1s"], 2.0)
    assert ask(board, b"QP1\r", 2.5) == b""
    assert ask(board, b"QP1\r", 3.5) == bytes((150,))


def test_answers_are_lost_late_or_cut():
    board = Ssc32(faults=("late:*:20ms", "short:2:0", "silent:3"))
    replies = board.feed(b"#1P1500\rQP1\rQP2\rQP3\r", 0.0)
    assert [(reply.data, reply.servo, reply.late_s) for reply in replies] == [
        (bytes((150,)), None, 0.02),
        (b"", None, 0.02),
    ]
    with pytest.raises(DriverError, match="only drop, echo"):
        board.faults.add(["crc:1"], 0.0)


def test_a_board_knows_the_faults_of_its_wire():
    board, seen = Ssc32(), []
    board.on_unplug = lambda fault, begins: seen.append(begins)
    board.faults.add(["echo", "slow-reader:1s", "unplug:for=1s"], 0.0)
    assert (board.echo, board.burst_s) == (True, 1.0)
    board.faults.advance(2.0)
    assert seen == [True, False]


@pytest.mark.parametrize("kind", ["dynamixel", "feetech", "maestro", "omote", "ssc32", "text"])
def test_no_bit_rate_is_below_300(kind: str):
    (baud,) = (entry for entry in entries(simulator_of(kind).options) if entry.name == "baud")
    assert baud.option.at_least == 300
    assert baud.default == (1_000_000 if kind in ("dynamixel", "feetech") else 115_200)
