"""drivers.core.traffic: bytes become lines that name servos, registers and values."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.core.traffic import Decoder, Decoder1, Decoder2, HexDecoder, TextDecoder
from drivers.packets import packet as v2
from drivers.packets import packet1 as v1
from drivers.tables.tables import load_table

X = load_table("xl330-m288")
GOAL, POSITION = 116, 132


def ask(servo: int, code: int, params: bytes = b"") -> bytes:
    return v2.encode_instruction(servo, code, params)


def both(decoder: Decoder, *pieces: tuple[bool | None, bytes]) -> list[str]:
    return [line for sent, data in pieces for line in decoder.feed(sent, data)]


def test_a_ping_tells_the_model_and_names_registers_from_then_on() -> None:
    decoder = Decoder2()
    write = ask(3, 3, struct.pack("<HI", GOAL, 2048))
    lines = both(
        decoder,
        (True, write),
        (True, ask(3, 1)),
        (False, v2.encode_status(3, 0, struct.pack("<HB", X.number, 52))),
        (True, write),
        (False, v2.encode_status(3)),
    )
    assert lines == [
        "-> 3 write 4 bytes at 116: 00 08 00 00",
        "-> 3 ping",
        "<- 3 is xl330-m288, firmware 52",
        "-> 3 write Goal Position = 2048",
        "<- 3 ok",
    ]


def test_an_answer_whose_question_was_not_heard_is_told_as_its_bytes() -> None:
    assert both(Decoder2(), (None, v2.encode_status(3, 0, b"\1\2\3"))) == ["<- 3 01 02 03"]


@pytest.mark.parametrize("sent", [True, None])
def test_reads_are_told_with_names_and_values(sent: bool | None) -> None:
    decoder = Decoder2({1: X, 2: X})
    back = None if sent is None else False
    data = struct.pack("<hii", -5, -100, 2047)
    lines = both(
        decoder,
        (sent, ask(0xFE, v2.Instruction.SYNC_READ, struct.pack("<HH", 126, 10) + b"\x01\x02")),
        (back, v2.encode_status(1, 0, data)),
        (back, v2.encode_status(2, 0x80, data)),
    )
    assert lines[0] == "-> all sync read Present Current .. Present Position of 1, 2"
    assert lines[1] == "<- 1 Present Current = -5, Present Velocity = -100, Present Position = 2047"
    assert lines[2].startswith("<- 2 ALERT Present Current")
    assert decoder.heard[2].error == 0x80
    assert decoder.heard[1].values["Present Position"] == 2047


def test_a_refusal_is_told_by_name() -> None:
    names = ("result fail", "instruction", "crc", "data range", "data length", "data limit", "access")
    for number, name in enumerate(names, 1):
        assert both(Decoder2(), (False, v2.encode_status(9, number))) == [f"<- 9 refused: {name}"]


def test_group_writes_name_the_register_once() -> None:
    rows = b"".join(struct.pack("<BI", i, 2000 + i) for i in range(1, 12))
    line = both(Decoder2(dict.fromkeys(range(1, 12), X)), (True, ask(0xFE, 0x83, struct.pack("<HH", GOAL, 4) + rows)))[
        0
    ]
    assert line.startswith("-> all sync write Goal Position of 1: 2001, 2: 2002")
    assert line.endswith("and 3 more")


def test_a_joint_reply_is_taken_apart() -> None:
    decoder = Decoder2({1: X, 2: X})
    decoder.feed(True, ask(0xFE, v2.Instruction.FAST_SYNC_READ, struct.pack("<HH", POSITION, 4) + b"\x01\x02"))
    frame = v2.encode_fast_head([4, 4])
    crc = v2.crc16(frame)
    for servo in (1, 2):
        part, crc = v2.encode_fast_part(servo, 0, struct.pack("<i", 1000 * servo), crc)
        frame += part
    assert decoder.feed(False, frame) == ["<- 1 Present Position = 1000", "<- 2 Present Position = 2000"]


def test_noise_is_counted() -> None:
    noisy, decoder = b"\x01\x02" + v2.encode_status(1), Decoder2()
    for _ in range(2):
        assert both(decoder, (False, noisy)) == ["<- 1 ok", "?? 2 bytes that are no packet"]
    assert both(decoder, (False, v2.encode_status(1))) == ["<- 1 ok"]


@pytest.mark.parametrize("sent", [True, None])
def test_protocol_1_is_told_from_either_end(sent: bool | None) -> None:
    decoder = Decoder1({4: load_table("ax-12a")})
    back = None if sent is None else False
    lines = both(
        decoder,
        (sent, v1.encode(4, v1.Instruction1.READ, bytes((36, 2)))),
        (back, v1.encode(4, v1.Error1.OVERLOAD, b"\x00\x02")),
        (sent, v1.encode(4, v1.Instruction1.WRITE, bytes((30, 0, 1)))),
    )
    assert lines == [
        "-> 4 read Present Position",
        "<- 4 overload Present Position = 512",
        "-> 4 write Goal Position = 256",
    ]


def test_text_is_told_by_line_and_the_rest_as_bytes() -> None:
    text = TextDecoder()
    assert both(text, (True, b"#1P15"), (True, b"00\r"), (False, b"ok\r\n")) == ["-> #1P1500", "<- ok"]
    assert HexDecoder().feed(None, b"\xa1") == ["-- a1"]


@given(st.lists(st.binary(max_size=40), max_size=8), st.sampled_from([True, False, None]))
def test_no_bytes_break_a_decoder(pieces: list[bytes], sent: bool | None) -> None:
    for decoder in (Decoder2({1: X}), Decoder1({1: load_table("ax-12a")}), TextDecoder()):
        for piece in pieces:
            decoder.feed(sent, piece)


@given(st.sampled_from(list(v2.Instruction)), st.binary(max_size=20))
def test_no_packet_breaks_a_decoder(code: int, params: bytes) -> None:
    decoder = Decoder2({1: X})
    for servo in (1, 0xFE):
        assert decoder.feed(True, v2.encode_instruction(servo, code, params)) or code == v2.Instruction.STATUS
    assert Decoder1({1: load_table("ax-12a")}).feed(True, v1.encode(1, code, params))


def row(servo: int, address: int, size: int) -> bytes:
    return struct.pack("<BHH", servo, address, size)


def test_a_bulk_read_names_each_servo_and_its_register_and_so_do_the_answers() -> None:
    decoder = Decoder2({1: X, 2: X})
    rows = row(1, POSITION, 4) + row(2, GOAL, 4)
    lines = both(
        decoder,
        (True, ask(0xFE, v2.Instruction.BULK_READ, rows + b"\x03\x84\0")),
        (False, v2.encode_status(2, 0, struct.pack("<i", 7)) + v2.encode_status(1, 0, struct.pack("<i", -8))),
    )
    assert lines == [
        "-> all bulk read 1: Present Position, 2: Goal Position",
        "<- 2 Goal Position = 7",
        "<- 1 Present Position = -8",
    ]
    assert {servo: heard.packets for servo, heard in decoder.heard.items()} == {1: 1, 2: 1}
    frame, crc = v2.encode_fast_head([4, 4]), 0
    decoder.feed(True, ask(0xFE, v2.Instruction.FAST_BULK_READ, rows))
    crc = v2.crc16(frame)
    for servo in (1, 2):
        part, crc = v2.encode_fast_part(servo, 0, struct.pack("<i", servo), crc)
        frame += part
    assert decoder.feed(False, frame) == ["<- 1 Present Position = 1", "<- 2 Goal Position = 2"]
    assert decoder.feed(False, frame) == [f"<- joint reply of {len(frame)} bytes"], "nobody has asked for it"


@pytest.mark.parametrize(
    ("code", "params", "line"),
    [
        (4, struct.pack("<HI", GOAL, 5), "-> 1 reg write Goal Position = 5"),
        (3, struct.pack("<H", GOAL), "-> 1 write 74 00"),
        (2, struct.pack("<HHB", POSITION, 4, 0), "-> 1 read 84 00 04 00 00"),
        (2, struct.pack("<HH", POSITION, 4), "-> 1 read Present Position"),
        (2, struct.pack("<HH", POSITION, 3), "-> 1 read 3 bytes at 132"),
        (0x82, struct.pack("<HH", POSITION, 4), "-> 1 sync read 84 00 04 00"),
        (0x83, struct.pack("<HH", GOAL, 4), "-> 1 sync write 74 00 04 00"),
        (5, b"", "-> 1 action"),
        (0x33, b"\x09", "-> 1 number 51 09"),
    ],
)
def test_every_instruction_is_told_as_far_as_it_makes_sense(code: int, params: bytes, line: str) -> None:
    assert Decoder2({1: X}).feed(True, ask(1, code, params)) == [line]
    assert Decoder2(default=X).feed(True, ask(1, code, params)) == [line]


def test_eight_servos_are_named_and_the_others_counted() -> None:
    for count, end in ((8, "6, 7, 8"), (9, "6, 7, 8 and 1 more")):
        ids = bytes(range(1, count + 1))
        (line,) = Decoder2(default=X).feed(True, ask(0xFE, 0x82, struct.pack("<HH", POSITION, 4) + ids))
        assert line == f"-> all sync read Present Position of 1, 2, 3, 4, 5, {end}"


def test_errors_alerts_and_unknown_models() -> None:
    decoder = Decoder2({9: X})
    assert decoder.feed(False, v2.encode_status(9, 0x87)) == ["<- 9 refused: access ALERT"]
    assert decoder.feed(False, v2.encode_status(9, 0x50)) == ["<- 9 refused: number 80"]
    assert decoder.feed(False, v2.encode_status(9, 0x80, b"\x01")) == ["<- 9 ALERT 01"]
    assert (decoder.heard[9].packets, decoder.heard[9].error) == (3, 0x80)
    decoder.feed(True, ask(9, 2, struct.pack("<HH", POSITION, 4)))
    assert decoder.feed(False, v2.encode_status(9, 4)) == ["<- 9 refused: data range"]
    assert decoder.feed(False, v2.encode_status(9, 0, b"\1\0\0\0")) == ["<- 9 01 00 00 00"], "it was answered"
    decoder.feed(True, ask(5, 1))
    assert decoder.feed(False, v2.encode_status(5, 0, struct.pack("<HB", 9999, 7))) == [
        "<- 5 is model 9999, firmware 7"
    ]
    decoder.feed(True, ask(5, 5))
    assert decoder.feed(False, v2.encode_status(5, 0, b"\1\2\3")) == ["<- 5 01 02 03"], "no ping"
    decoder.feed(True, ask(9, 1))
    decoder.feed(True, ask(9, 2, struct.pack("<HH", 144, 3)))
    assert "firmware" not in decoder.feed(False, v2.encode_status(9, 0, b"\1\2\3"))[0], "it was asked to read"


def test_on_a_wire_that_is_only_heard_the_order_tells_answers_from_questions() -> None:
    ax = load_table("ax-12a")
    decoder = Decoder1({1: ax, 2: ax})
    feed = lambda *packet: decoder.feed(None, v1.encode(*packet))  # noqa: E731
    assert feed(0xFE, v1.Instruction1.SYNC_READ, bytes((36, 2, 1, 2))) == ["-> all sync read Present Position of 1, 2"]
    assert feed(2, 0, b"\1\0") == ["<- 2 Present Position = 1"]
    assert feed(1, 0, b"\2\0") == ["<- 1 Present Position = 2"]
    assert feed(1, v1.Instruction1.PING) == ["-> 1 ping"]
    assert feed(0xFE, v1.Instruction1.SYNC_WRITE, bytes((30, 2, 1, 9, 0))) == [
        "-> all sync write Goal Position of 1: 9"
    ]
    assert feed(1, v1.Error1.OVERLOAD | v1.Error1.INPUT_VOLTAGE) == ["<- 1 input voltage overload ok"]
    assert feed(1, v1.Instruction1.WRITE, bytes((24, 1))) == ["-> 1 write Torque Enable = 1"]
    assert {servo: heard.packets for servo, heard in decoder.heard.items()} == {1: 2, 2: 1}


def test_the_arrows_of_text_and_bytes_and_ends_of_lines_in_pieces() -> None:
    text, raw = TextDecoder(), HexDecoder()
    assert [text.feed(sent, b"a\n")[0] for sent in (True, False, None)] == ["-> a", "<- a", "-- a"]
    assert [raw.feed(sent, b"\1\2")[0] for sent in (True, False, None)] == ["-> 01 02", "<- 01 02", "-- 01 02"]
    assert text.feed(True, b"b") == [] and text.feed(False, b"c\rd\r\n\n") == ["<- c", "<- d"]
    assert text.feed(True, b"\xff\n") == ["-> b\\xff"]
