"""drivers.sim.boards.textboard and drivers.sim.boards.linehead: simulated boards that read lines."""

from __future__ import annotations

import pytest

from drivers.omote.protocol import checksum
from drivers.sim.boards.linehead import MAX_LINE, LineHead
from drivers.sim.boards.maestro import Maestro
from drivers.sim.boards.textboard import TextBoard
from drivers.sim.wire.simulator import make_line

TEXTS = {"template": "#{ch}P{us}", "end": "T{time_ms}\r", "off": "#{ch}P0\r"}
ASKED = TEXTS | {"query": "?{ch}\r", "answer": "{ch}={us}\r"}


def say(board: TextBoard | LineHead, data: bytes, now_s: float = 0.0) -> bytes:
    return b"".join(reply.data for reply in board.feed(data, now_s))


def test_a_text_board_reads_what_its_template_writes_in_any_pieces() -> None:
    line = b"#1P1500#2P1600T20\r#1P0\r"
    for cut in range(len(line)):
        board = TextBoard(TEXTS, [1, 2], ["jaw", "brow"])
        say(board, line[:cut])
        say(board, line[cut:])
        assert (board.values, board.refused) == ({1: None, 2: 1600.0}, 0)


def test_a_text_board_answers_and_passes_over_what_it_does_not_know() -> None:
    board = TextBoard(ASKED, [1], ["jaw"])
    assert say(board, b"hello\r#1P1500T9\r#9P1500T9\r?1\r") == b"1=1500\r"
    assert board.refused == 2
    assert board.describe(0.0) == [{"id": 1, "name": "jaw", "us": 1500.0}]


def test_a_move_at_the_very_end_is_done_after_a_pause() -> None:
    board = TextBoard(TEXTS, [1], ["jaw"])
    say(board, b"#1P150")
    assert board.values == {1: None}
    for packet in board.reader.flush():
        board.handle(packet, 1.0)
    assert board.values == {1: 150.0}


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("HELLO", f"OK HELLO head protocol=1 parameters=2 max_line={MAX_LINE}"),
        ("#7 PING a b", "#7 OK PONG a b"),
        ("set jaw 0.5 brow -1", "OK SET 2"),
        ("GET jaw", "OK GET jaw=0"),
        ("RELEASE ALL", "OK RELEASE 2"),
        ("SET jaw", "ERR 21 SET name value [name value ...]"),
        ("SET jaw nan", "ERR 22 'nan' is not a number"),
        ("SET chin 1", "ERR 23 unknown name 'chin'"),
        ("DANCE", "ERR 20 there is no command 'DANCE' (there are HELLO, PING, SET, RELEASE, GET)"),
        ("PING*00", "ERR 13 wrong checksum"),
        ("x" * (MAX_LINE + 1), f"ERR 10 a line has at most {MAX_LINE} bytes"),
    ],
)
def test_a_line_head_answers_every_line(line: str, answer: str) -> None:
    head = LineHead(["jaw", "brow"])
    assert say(head, line.encode() + b"\r\n") == answer.encode() + b"\n"
    assert head.refused == answer.startswith("ERR")


def test_a_line_head_takes_all_or_nothing_and_answers_with_a_checksum() -> None:
    head = LineHead(["jaw", "brow"])
    say(head, b"SET jaw 0.5 chin 1\n")
    assert head.values == {"jaw": None, "brow": None}
    body = b"#3 SET jaw 0.5"
    answer = say(head, body + b"*%02X\n" % checksum(body))
    assert answer == b"#3 OK SET 1*%02X\n" % checksum(b"#3 OK SET 1")
    assert head.values["jaw"] == 0.5


def test_a_line_head_lets_go_after_silence() -> None:
    head = LineHead(["jaw"])
    say(head, b"SET jaw 1\n", 0.0)
    assert head.describe(0.9)[0]["value"] == 1.0
    assert head.describe(1.2)[0]["value"] is None


@pytest.mark.parametrize(
    ("highest", "board", "channels"), [(3, "micro", 6), (3, "mini", 12), (12, "mini", 18), (23, "mini", 24)]
)
def test_a_board_is_as_large_as_its_channels_need(highest: int, board: str, channels: int) -> None:
    line = make_line("maestro", [(0, "rc-90"), (highest, "rc-90")], 0.0, options={"board": board})
    assert isinstance(line, Maestro)
    assert len(line.channels) == channels
