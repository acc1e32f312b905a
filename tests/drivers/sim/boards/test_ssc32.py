"""drivers.sim.boards.ssc32: moves, groups and queries in text."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
import serial

from drivers.sim import Ssc32
from drivers.sim.boards.ssc32 import SIMULATOR, VERSION, LineReader
from drivers.sim.serving.serve import serve
from drivers.sim.wire.simulator import Setting

MAX_LINE = 2048


def send(board: Ssc32, text: str, now_s: float = 0.0) -> bytes:
    return b"".join(reply.data for reply in board.feed(text.encode(), now_s))


def pulse(board: Ssc32, channel: int, now_s: float = 0.0) -> float:
    return board.channels[channel].position(now_s)


def test_a_move_in_any_spelling():
    for text in ("#5P1600\r", "#5 p1600 \r", "#5P\n1600\r", "#5P1600T1000\r"):
        board = Ssc32()
        assert send(board, text) == b""
        assert pulse(board, 5) == 1600
        assert board.refused == 0


def test_a_group_starts_and_ends_together():
    board = Ssc32()
    send(board, "#5P1500#10P1500\r")
    send(board, "#5P1600#10P750T2500\r", 1.0)
    assert (pulse(board, 5, 2.25), pulse(board, 10, 2.25)) == (1550, 1125)
    assert send(board, "Q\r", 3.4) == b"+"
    assert send(board, "Q\r", 3.6) == b"."


def test_the_slowest_member_sets_the_time():
    board = Ssc32()
    send(board, "#5P1500#10P1500\r")
    send(board, "#5P1600S100#10P1700S100\r", 0.0)
    assert (pulse(board, 5, 1.0), pulse(board, 10, 1.0)) == (1550, 1600)


def test_queries():
    board = Ssc32()
    send(board, "#3P1500\r")
    assert send(board, "QP3\r") == bytes((150,))
    assert send(board, "qp4\r") == b"\0"
    assert send(board, "VER\r") == VERSION


@pytest.mark.parametrize(
    "line", ["#5P400", "#5P2501", "#32P1500", "QP32", "QPx", "P1500", "#5P1500X", "hello", "#5P15#T5"]
)
def test_what_it_does_not_understand_it_passes_over(line: str):
    board = Ssc32()
    assert send(board, line + "\r") == b""
    assert (board.refused, pulse(board, 5)) == (1, 0)


def test_lines_in_pieces_and_endless_ones():
    reader = LineReader()
    assert reader.feed(b"#5P1") == []
    assert (reader.pending, reader.flush()) == (4, [])
    assert reader.feed(b"600\r\rQ\rV") == ["#5P1600", "Q"]
    assert reader.take_pending() == b"V"
    assert reader.feed(b"x" * (MAX_LINE + 1)) == []
    assert reader.pending == 0


def test_states_and_sizes():
    board = Ssc32()
    send(board, "#2P1500\r")
    assert board.describe(0.0)[2] == {"id": 2, "pulse_us": 1500.0, "target_us": 1500.0}
    assert board.size("#2P1500") == 8


def test_served_to_a_serial_program(tmp_path: Path):
    ready, paths = threading.Event(), []
    reading, writing = os.pipe()
    thread = threading.Thread(
        target=serve,
        args=(Ssc32(), tmp_path / "ssc", lambda path: (paths.append(path), ready.set())),
        kwargs={"stop": reading, "baud": 115_200, "wire": True},
    )
    thread.start()
    try:
        assert ready.wait(30)
        with serial.Serial(paths[0], 115_200, timeout=10) as port:
            port.write(b"#7P1230\rQP7\r")
            assert port.read(1) == bytes((123,))
    finally:
        os.close(writing)
        thread.join(30)
        os.close(reading)
    assert os.listdir(tmp_path) == []


def test_the_longest_line_is_kept_and_a_longer_one_dropped():
    reader = LineReader()
    assert reader.feed(b"x" * MAX_LINE) == []
    assert reader.pending == MAX_LINE
    assert reader.feed(b"\r") == ["X" * MAX_LINE]
    assert reader.feed(b"y" * (MAX_LINE + 1) + b"\rQ\r") == ["Y" * (MAX_LINE + 1), "Q"]


def test_escape_forgets_the_line_that_has_begun():
    reader = LineReader()
    assert reader.feed(b"#1P15") == []
    assert reader.feed(b"00\x1b#2P16") == []
    assert reader.feed(b"00\r") == ["#2P1600"]


def test_stop_ends_a_move_where_it_is():
    board = Ssc32()
    send(board, "#1P1000\r")
    send(board, "#1P2000T1000\r", 1.0)
    send(board, "STOP1\r", 1.25)
    assert (pulse(board, 1, 1.25), pulse(board, 1, 5.0)) == (1250, 1250)
    assert send(board, "Q\r", 1.3) == b"."


def test_the_last_channel_and_the_ends_of_a_pulse():
    board = Ssc32()
    for line, channel, expected in (("#31P500", 31, 500), ("#31P2500", 31, 2500), ("#0P1500", 0, 1500), ("#0P0", 0, 0)):
        send(board, line + "\r")
        assert pulse(board, channel) == expected
    for line in ("#31P499", "#32P1500", "STOP32", "QP32"):
        send(board, line + "\r")
    assert (board.refused, pulse(board, 31)) == (4, 2500)
    board.faults.add(["silent:3"], 0.0)
    assert send(board, "QP3\rQP4\r") == b"\0"


def test_a_speed_counts_only_where_it_is_slower_than_the_time():
    board = Ssc32()
    send(board, "#1P1000#2P1000\r")
    send(board, "#1P2000S2000#2P1500T4000\r", 0.0)
    assert (pulse(board, 1, 2.0), pulse(board, 2, 2.0)) == (1500, 1250)


def test_it_is_served_alone_and_to_a_driver_alike():
    setting = Setting(now_s=0.0, baud=115_200, seed=4)
    for board in (SIMULATOR.alone(SIMULATOR.options(), setting), SIMULATOR.far_end([], {}, setting)):
        board.faults.add(["noise:*:3"], 0.0)
        expected = Ssc32(seed=4, faults=("noise:*:3",))
        assert send(board, "Q\r") == send(expected, "Q\r") != b"."


def test_escape_forgets_only_the_line_that_has_begun() -> None:
    board = Ssc32()
    assert send(board, "#3P1500\r#4P1500\x1bQP3\r") == bytes((150,))
    assert (pulse(board, 3), pulse(board, 4)) == (1500, 0)
    send(board, "#5P15")
    send(board, "\x1b#6P1600\r")
    assert (pulse(board, 5), pulse(board, 6)) == (0, 1600)


@pytest.mark.parametrize("line", ["#1P1500T{}", "#1P1500S{}", "#{}P1500", "#1P{}", "QP{}", "STOP{}"])
@pytest.mark.parametrize("digits", [400, 1900])
def test_numbers_that_no_board_could_hold_are_refused(line: str, digits: int) -> None:
    board = Ssc32()
    send(board, "#1P1000\r")
    assert send(board, line.format("9" * digits) + "\r") == b""
    assert (pulse(board, 1), board.refused) == (1000, 1)


def test_a_channel_without_pulses_takes_no_time_of_its_group() -> None:
    """It is where it is told at once, and so is one whose pulses end."""
    board = Ssc32()
    send(board, "#1P1500\r#3P2000\r")
    send(board, "#1P1600S100#2P1500S100#3P0S100\r")
    assert (pulse(board, 1, 0.5), pulse(board, 1, 1.0)) == (1550, 1600)
    assert (pulse(board, 2), pulse(board, 3)) == (1500, 0)
