"""drivers.sim.boards.linehead: a simulated head that takes the omote line protocol."""

from __future__ import annotations

import pytest

from drivers.omote.protocol import checksum
from drivers.sim.boards.linehead import SILENCE_S, SIMULATOR, HeadOptions, LineHead
from drivers.sim.wire.simulator import Setting

MAX_LINE = 200
"""What a head reports in its answer to HELLO."""


def say(head: LineHead, data: bytes, now_s: float = 0.0) -> bytes:
    return b"".join(reply.data for reply in head.feed(data, now_s))


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


def test_silence_is_counted_from_the_last_line_and_begins_beyond_a_second() -> None:
    head = LineHead(["jaw"])
    say(head, b"SET jaw 1\n", 0.0)
    assert say(head, b"GET jaw\n", SILENCE_S) == b"OK GET jaw=1\n"
    assert say(head, b"GET jaw\n", 2 * SILENCE_S) == b"OK GET jaw=1\n"
    assert say(head, b"GET jaw\n", 3 * SILENCE_S + 0.001) == b"OK GET jaw=0\n"


def test_lines_in_pieces_with_any_end_and_one_that_is_as_long_as_allowed() -> None:
    head = LineHead(["jaw"])
    assert say(head, b"PI") == b""
    assert (head.reader.pending, head.reader.flush()) == (2, [])
    assert say(head, b"NG\r\n \n\rPING\r") == b"OK PONG\nOK PONG\n"
    assert say(head, b"PING ".ljust(MAX_LINE, b"x") + b"\n") == b"OK PONG " + b"x" * (MAX_LINE - 5) + b"\n"
    assert say(head, b"x" * 3 * MAX_LINE) == b""
    assert head.reader.pending == MAX_LINE + 1
    assert say(head, b"\n").startswith(b"ERR 10")
    say(head, b"PI")
    assert head.reader.take_pending() == b"PI"
    assert head.size(b"PING") == len(b"PING\n")


def test_a_wrong_or_padded_checksum() -> None:
    head = LineHead(["jaw"])
    good = b"PING*%02x \n" % checksum(b"PING")
    assert say(head, good) == b"OK PONG*%02X\n" % checksum(b"OK PONG")
    assert say(head, b"#4 PING*0\n") == b"ERR 13 wrong checksum\n"
    assert head.refused == 1


def test_a_simple_head_knows_no_get() -> None:
    head = LineHead(["jaw"], simple=True)
    assert say(head, b"GET jaw\n") == b"ERR 20 there is no command 'GET' (there are HELLO, PING, SET, RELEASE)\n"
    assert say(head, b"#2\n").startswith(b"#2 ERR 20 there is no command ''")


def test_single_outputs_are_released_and_unknown_ones_refused() -> None:
    head = LineHead(["jaw", "brow"])
    say(head, b"SET jaw 0.5 brow 1\n")
    assert say(head, b"RELEASE jaw\n") == b"OK RELEASE 1\n"
    assert head.values == {"jaw": None, "brow": 1.0}
    assert say(head, b"RELEASE brow chin\n") == b"ERR 23 unknown name 'chin'\n"
    assert head.values == {"jaw": None, "brow": 1.0}
    assert say(head, b"SET\n").startswith(b"ERR 21")


def test_the_names_of_the_command_line_or_all_parameters() -> None:
    setting = Setting(now_s=0.0, baud=115_200, names=("a", "b", "c"))
    for names, expected in ((" jaw, brow ,", ["jaw", "brow"]), ("", ["a", "b", "c"])):
        head = SIMULATOR.alone(HeadOptions(names=names), setting)
        assert [row["name"] for row in head.describe(0.0)] == expected
    far_end = SIMULATOR.far_end([(0, "unit")], {"names": ["jaw"], "simple": True}, setting)
    assert (far_end.simple, far_end.describe(0.0)) == (True, [{"id": 0, "name": "jaw", "value": None}])


def test_power_on_releases_everything() -> None:
    head = LineHead(["jaw"])
    say(head, b"SET jaw 1\n")
    head.faults.add(["volts:*:3"], 0.1)
    assert head.describe(0.1)[0]["value"] is None
