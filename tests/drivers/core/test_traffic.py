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
    assert both(Decoder2(), (False, v2.encode_status(9, 7))) == ["<- 9 refused: access"]


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
    assert both(Decoder2(), (False, b"\x01\x02" + v2.encode_status(1))) == ["<- 1 ok", "?? 2 bytes that are no packet"]


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
