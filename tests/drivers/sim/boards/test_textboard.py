"""drivers.sim.boards.textboard: a simulated board that parses the lines of a template."""

from __future__ import annotations

from drivers.sim.boards.textboard import SIMULATOR, Message, TextBoard, TextOptions
from drivers.sim.wire.simulator import Setting

MAX_LINE = 4096
TEXTS = {"template": "#{ch}P{us}", "end": "T{time_ms}\r", "off": "#{ch}P0\r"}
ASKED = TEXTS | {"query": "?{ch}\r", "answer": "{ch}={us}\r"}


def say(board: TextBoard, data: bytes, now_s: float = 0.0) -> bytes:
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


def test_each_placeholder_that_names_a_servo_is_understood() -> None:
    by_name = TextBoard({"template": "{name}={deg}\n", "off": "{name} off\n"}, [4, 5], ["jaw", "brow"])
    say(by_name, b"brow=-12.5\njaw=3\nchin=9\n")
    assert (by_name.values, by_name.refused) == ({4: 3.0, 5: -12.5}, 1)
    say(by_name, b"brow off\n")
    assert by_name.values == {4: 3.0, 5: None}
    by_id = TextBoard({"template": "{id}:{us}\n"}, [4, 5], ["jaw", "brow"])
    say(by_id, b"5:1500\n6:1500\n")
    assert (by_id.values, by_id.refused) == ({4: None, 5: 1500.0}, 1)
    alone = TextBoard({"template": "P{us}\n"}, [9], ["jaw"])
    say(alone, b"P900\n")
    assert alone.values == {9: 900.0}


def test_a_servo_that_is_off_answers_zero_and_a_brown_out_switches_all_off() -> None:
    board = TextBoard(ASKED, [1], ["jaw"])
    assert say(board, b"?1\r") == b"1=0\r"
    say(board, b"#1P1500T9\r")
    board.faults.add(["volts:*:3:for=1s"], 1.0)
    assert board.values == {1: None}
    assert say(board, b"?1\r", 1.5) == b""
    assert say(board, b"?1\r", 2.5) == b"1=0\r"


def test_texts_before_between_and_behind_moves_are_no_noise() -> None:
    texts = {"template": "{ch}:{us}", "begin": "<", "separator": ",", "end": ">\n"}
    board = TextBoard(texts, [1, 2], ["jaw", "brow"])
    say(board, b"<1:1000,2:2000>\n")
    assert (board.values, board.refused) == ({1: 1000.0, 2: 2000.0}, 0)


def test_what_is_unknown_is_passed_over_by_the_line_or_where_it_is_too_long_by_the_byte() -> None:
    board = TextBoard(TEXTS, [1], ["jaw"])
    assert board.reader.feed(b"nonsense\r#") == [Message("noise", {}, 9)]
    assert board.reader.pending == 1
    assert board.reader.flush() == [Message("noise", {}, 1)]
    assert board.reader.feed(b"x" * MAX_LINE) == []
    assert board.reader.feed(b"x") == [Message("noise", {}, 1)]
    assert board.reader.pending == MAX_LINE
    assert board.reader.take_pending() == b"x" * MAX_LINE
    assert board.reader.pending == 0


def test_the_size_of_a_message_is_that_of_its_bytes() -> None:
    board = TextBoard(TEXTS, [1], ["jaw"])
    (move, end) = board.reader.feed(b"#1P1500T20\r")
    assert (board.size(move), board.size(end)) == (7, 4)
    assert move == Message("move", {"ch": "1", "us": "1500"}, 7)


def test_options_of_the_command_line_write_line_ends_as_in_a_robot_file() -> None:
    options = TextOptions(template=r"S{ch},{us}\n", off=r"D{ch}\r", ids="3,5-6")
    board = SIMULATOR.alone(options, Setting(now_s=0.0, baud=115_200))
    say(board, b"S5,1500\nS6,900\nD5\r")
    assert board.values == {3: None, 5: None, 6: 900.0}
    assert [row["name"] for row in board.describe(0.0)] == ["servo3", "servo5", "servo6"]
    far_end = SIMULATOR.far_end([(3, "rc-180")], {"texts": TEXTS, "names": ["jaw"]}, Setting(now_s=0.0, baud=115_200))
    assert far_end.describe(0.0) == [{"id": 3, "name": "jaw", "us": None}]


def test_numbers_that_no_sketch_could_hold_are_counted_and_passed_over() -> None:
    board = TextBoard(ASKED, [1], ["jaw"])
    say(board, b"#1P1500T9\r")
    for count, line in enumerate((f"#1P{'9' * 400}", f"#{'9' * 4000}P1500", f"?{'1' * 4000}\r"), 1):
        assert say(board, line.encode() + b"T9\r") == b""
        assert (board.values, board.refused >= count) == ({1: 1500.0}, True)
    assert say(board, b"?1\r") == b"1=1500\r"
    long = TextBoard({"template": "{ch}:{us}\n"}, [1], ["jaw"])
    assert say(long, b"9" * 5000 + b":1500\n1:1500\n") == b""
    assert long.values == {1: 1500.0}
