"""Framing, checksums and replies of the line protocol."""

from __future__ import annotations

import re
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from controller.links.line.protocol import (
    MAX_LINE,
    MAX_REPLY,
    Code,
    LineDecoder,
    LineError,
    Reply,
    Words,
    checksum,
    format_error,
    format_frame,
    format_ok,
    format_pairs,
    format_words,
    is_stop,
    number,
    parse_reply,
    parse_words,
)

WORD = st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E, exclude_characters="*#"), min_size=1, max_size=20)
TAG = st.none() | st.integers(0, 999_999_999)


def test_checksum_is_crc8_smbus() -> None:
    assert checksum(b"123456789") == 0xF4
    assert checksum(b"") == 0


ASCII = st.lists(st.integers(0x20, 0x7E), min_size=2, max_size=60).map(bytes)


@settings(deadline=None)
@given(ASCII, st.data())
def test_checksum_sees_swapped_neighbours_and_short_bursts(data: bytes, draw: st.DataObject) -> None:
    i = draw.draw(st.integers(0, len(data) - 2))
    swapped = data[:i] + data[i + 1 : i + 2] + data[i : i + 1] + data[i + 2 :]
    assert (checksum(swapped) == checksum(data)) == (swapped == data)
    burst = bytes([data[i] ^ draw.draw(st.integers(1, 255))])
    assert checksum(data[:i] + burst + data[i + 1 :]) != checksum(data)


@settings(deadline=None)
@given(st.lists(WORD, min_size=1, max_size=8), TAG, st.booleans(), st.sampled_from(["", "maple", "all"]))
def test_words_round_trip(words: list[str], tag: int | None, checked: bool, to: str) -> None:
    assume(not words[0].startswith("@"))  # that is whom a line is for
    line = format_words([f"@{to}", *words] if to else words, tag=tag, checked=checked)
    assert line.endswith(b"\n")
    assert parse_words(line[:-1]) == Words(tuple(words), tag, checked, to)


@settings(deadline=None)
@given(st.binary(max_size=1100))
def test_any_bytes_are_words_or_a_refusal(data: bytes) -> None:
    try:
        found = parse_words(data)
    except LineError as error:
        assert error.code in set(Code) and str(error)
    else:
        assert found is None or found.words


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"PING*00", Code.CHECKSUM),
        (b"PING*", Code.CHECKSUM),
        (b"PING*G1", Code.CHECKSUM),
        (b"PING * x", Code.CHECKSUM),
        (b"P*ING*" + b"%02X" % checksum(b"P*ING"), Code.CHECKSUM),
        (b"#x PING", Code.TAG),
        (b"#1234567890 PING", Code.TAG),
        (b"#12", Code.COMMAND),
        (b"\x80PING", Code.BINARY),
        (b"PING \xff", Code.NOT_ASCII),
        (b"PI\x00NG", Code.NOT_ASCII),
        (b"x" * (MAX_LINE + 1), Code.TOO_LONG),
    ],
)
def test_refused_lines(line: bytes, code: Code) -> None:
    with pytest.raises(LineError) as caught:
        parse_words(line)
    assert caught.value.code == code


def test_what_has_no_checksum_says_so() -> None:
    assert Words(("PING",)) == Words(("PING",), None, False) == parse_words(b"PING")
    assert Reply("OK") == Reply("OK", "", None, None, False) == parse_reply(b"OK")
    plain = LineError(Code.TAG, "why")
    assert (plain.tag, plain.checked) == (None, False)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"PING*0f", f"checksum is 0F but the line sums up to {checksum(b'PING'):02X}"),
        (b"x" * 1025, "a line has at most 1024 bytes"),
        (b"*", "two hexadecimal digits at the end"),
    ],
)
def test_refusals_say_what_is_wrong(line: bytes, message: str) -> None:
    with pytest.raises(LineError, match=message):
        parse_words(line)


def test_lines_and_tags_have_their_longest_length() -> None:
    assert parse_words(b"x" * 1024) == Words(("x" * 1024,))
    assert parse_words(b"#123456789 PING") == Words(("PING",), 123456789)
    long = format_ok("y" * 3000, checked=True)
    assert len(long) == 2048 + 1 and parse_reply(long[:-1]) == Reply("OK", "y" * 2042, checked=True)
    assert len(format_ok("y" * 3000)) == 2048 - 3 + 1
    with pytest.raises(LineError, match=r"not a reply: b'z{32}'$"):
        parse_reply(b"z" * 40)


def test_blank_lines_are_nothing() -> None:
    assert parse_words(b"") is None and parse_words(b" \t ") is None


def test_a_bad_checksum_is_answered_with_one_and_without_the_tag() -> None:
    with pytest.raises(LineError) as caught:
        parse_words(b"#7 PING*00")
    reply = parse_reply(format_error(caught.value)[:-1])
    assert reply is not None and (reply.kind, reply.code, reply.tag, reply.checked) == ("ERR", 13, None, True)


@settings(deadline=None)
@given(st.text(st.characters(max_codepoint=0x2FF), max_size=40), TAG, st.booleans())
def test_replies_round_trip_whatever_the_text(text: str, tag: int | None, checked: bool) -> None:
    line = format_ok(text, tag=tag, checked=checked)
    assert line.count(b"\n") == 1 and re.fullmatch(rb"[\x20-\x7e]*\n", line)
    reply = parse_reply(line[:-1])
    assert reply is not None and reply.ok and (reply.tag, reply.checked) == (tag, checked or "*" in text)
    assert reply.text == re.sub(r"[^ -~]", "?", text)


def test_an_error_of_several_lines_is_one_line_that_shows_what_was_typed() -> None:
    error = LineError(Code.BUSY, "a.toml: 2 faults:\n  x: 2*3 is no number\n  y: missing\n")
    body = b"ERR 30 a.toml: 2 faults: x: 2*3 is no number; y: missing"
    assert format_error(error) == body + b"*%02X\n" % checksum(body)
    reply = parse_reply(format_error(error)[:-1])
    assert reply is not None and reply.text == "a.toml: 2 faults: x: 2*3 is no number; y: missing"
    for damaged in (body, body + b"*00"):
        with pytest.raises(LineError):
            parse_reply(damaged)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (b"PING\x85", "byte 5 of the line is 0x85"),
        (b"\x00PING", "byte 1 of the line is 0x00"),
        (b"SET a*b 0*5A", "more than one * in the line"),
        (b"SET jawOpen 0*5", "* must be followed by two hexadecimal digits"),
    ],
)
def test_a_refusal_shows_what_was_typed(line: bytes, text: str) -> None:
    with pytest.raises(LineError) as caught:
        parse_words(line)
    assert text in str(caught.value) and text.encode() in format_error(caught.value)


@pytest.mark.parametrize(
    "line",
    [b"STOP", b"stop", b"STOP*00", b"STOP *", b"STOP now", b"#1 STOP", b"# STOP", b"#12345678901 STOP",
     b" \t STOP", b"\xff\x00STOP", b"STOP\xff", b"STOP\x00", b"#4\x80STOP*", b"STOP " + b"x" * 2000],
)  # fmt: skip
def test_a_line_that_begins_with_stop_is_one_whatever_else_is_in_it(line: bytes) -> None:
    assert is_stop(line)


@pytest.mark.parametrize(
    "line", [b"", b"STOPPED", b"SHOW STOP", b"PING STOP", b"START", b"XSTOP", b"STO", b"#1 PING STOP"]
)
def test_other_lines_are_not(line: bytes) -> None:
    assert not is_stop(line)


def test_error_reply() -> None:
    error = LineError(Code.RANGE, "jawOpen must be 0 to 1, not 2", tag=12)
    assert format_error(error) == b"#12 ERR 24 jawOpen must be 0 to 1, not 2\n"
    assert parse_reply(format_error(error)[:-1]) == Reply("ERR", "jawOpen must be 0 to 1, not 2", 12, 24)


def test_damaged_replies_are_refused() -> None:
    for line in (b"ERR x", b"HUH", b"OK*00", b"#3"):
        with pytest.raises(LineError):
            parse_reply(line)
    assert parse_reply(b"") is None


def test_streams() -> None:
    assert format_frame(1500, np.array([0.0, 0.5, -0.25])) == b"F 1500 0 0.5 -0.25\n"
    assert format_pairs(20, [("jawOpen", 0.8)]) == b"P 20 jawOpen=0.8\n"
    everything = format_frame(10**9, np.full(59, -0.1234), checked=True)
    assert len(everything) <= MAX_REPLY
    assert parse_reply(everything[:-1]) is not None


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (-0.00001, "0"), (1.0, "1"), (0.12345, "0.1235"), (-0.5, "-0.5"), (100.0, "100")]
)
def test_number(value: float, text: str) -> None:
    assert number(value) == text


def test_decoder_cuts_lines_at_cr_lf_and_both() -> None:
    decoder = LineDecoder()
    assert decoder.feed(b"A\nB\rC\r\n\n\r\nD") == [b"A", b"B", b"C"]
    assert decoder.feed(b"E\n") == [b"DE"]
    decoder.feed(b"half")
    decoder.clear()
    assert decoder.feed(b"whole\n") == [b"whole"]


def test_decoder_reports_an_overlong_line_once_and_recovers() -> None:
    decoder = LineDecoder(limit=8)
    assert decoder.feed(b"x" * 100_000) == []
    lines = decoder.feed(b"xxx\nPING\n")
    assert [len(line) for line in lines] == [9, 4] and lines[1] == b"PING"
    assert decoder.feed(b"12345678\n") == [b"12345678"]


@settings(deadline=None)
@given(st.binary(max_size=300), st.lists(st.integers(1, 40), max_size=30))
def test_decoder_gives_the_same_lines_however_the_bytes_arrive(data: bytes, cuts: list[int]) -> None:
    whole = LineDecoder(64).feed(data + b"\n")
    decoder, got, rest = LineDecoder(64), [], data + b"\n"
    for cut in cuts:
        got += decoder.feed(rest[:cut])
        rest = rest[cut:]
    assert got + decoder.feed(rest) == whole


def test_the_examples_in_the_specification_have_right_checksums(root: Path) -> None:
    text = (root / "docs" / "line-protocol.md").read_text(encoding="utf-8")
    examples = re.findall(r"^(?:[<>] )?([^\n*|`]+)\*([0-9A-F]{2})$", text, re.MULTILINE)
    assert len(examples) >= 5
    for body, digits in examples:
        if digits != "00":  # the one that shows a wrong checksum
            assert f"{checksum(body.encode()):02X}" == digits, body


def test_every_error_code_is_in_the_specification(root: Path) -> None:
    text = (root / "docs" / "line-protocol.md").read_text(encoding="utf-8")
    assert {int(code) for code in re.findall(r"^\| (\d\d) \|", text, re.MULTILINE)} == set(map(int, Code))


def test_records_cannot_be_changed() -> None:
    for record in (Words, Reply):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1


@pytest.mark.parametrize(
    ("line", "checked"),
    [(b"PING*00", True), (b"PING*", True), (b"PING*G1", True), (b"#12", False), (b"\x80PING", False)],
)
def test_a_refusal_of_a_line_with_a_checksum_has_one(line: bytes, checked: bool) -> None:
    with pytest.raises(LineError) as caught:
        parse_words(line)
    assert caught.value.checked == checked
    for damaged in (b"#x PING", b"#12", b""):
        if damaged:
            with pytest.raises(LineError) as caught:
                parse_words(damaged + b"*%02X" % checksum(damaged))
            assert caught.value.checked
