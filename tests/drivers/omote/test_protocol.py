"""drivers.omote.protocol: every line it writes is one that omote's own parser takes, and the other way round."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS
from controller.links.line import protocol as lineprotocol
from drivers.omote import protocol

WORDS = st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E, exclude_characters="*#"), min_size=1, max_size=9)


def test_checksum_of_the_documentation() -> None:
    assert protocol.checksum(b"123456789") == 0xF4
    assert protocol.line(["PING"], 7, True) == b"#7 PING*%02X\n" % lineprotocol.checksum(b"#7 PING")


@given(st.lists(WORDS, min_size=1, max_size=20), st.integers(1, protocol.MAX_TAG), st.booleans())
def test_the_parser_takes_every_line(words: list[str], tag: int, checked: bool) -> None:
    assume(not words[0].startswith("@"))  # that names a head: this driver never does
    line = protocol.line(words, tag, checked)
    assert line.endswith(b"\n")
    assert lineprotocol.parse_words(line[:-1]) == lineprotocol.Words(tuple(words), tag, checked)


@given(st.floats(-4000, 4000))
def test_numbers_are_written_as_the_protocol_has_them(value: float) -> None:
    assert protocol.number(value) == lineprotocol.number(value)


@given(st.one_of(st.none(), st.integers(0, protocol.MAX_TAG)), st.booleans(), st.lists(WORDS, max_size=5))
def test_answers_are_read_as_they_are_written(tag: int | None, checked: bool, words: list[str]) -> None:
    text = " ".join(words)
    line = lineprotocol.format_ok(text, tag=tag, checked=checked)[:-1]
    assert protocol.read_answer(line) == protocol.Answer(tag, True, 0, text)
    error = lineprotocol.LineError(lineprotocol.Code.NAME, "no " + text, tag=tag, checked=checked)
    answer = protocol.read_answer(lineprotocol.format_error(error)[:-1])
    assert answer == protocol.Answer(tag, False, 23, f"no {text}".strip())


@pytest.mark.parametrize("line", [b"P 12 jawOpen=1", b"", b"OKAY", b"#x OK", b"OK*00", b"ERR what", b"\xff\xff"])
def test_what_is_no_answer_is_none(line: bytes) -> None:
    assert protocol.read_answer(line) is None


def test_words_are_parted_so_that_every_line_fits() -> None:
    for room in (20, 64, 1000):
        groups = protocol.split_to_fit(PARAMETERS.names, room)
        assert [name for group in groups for name in group] == list(PARAMETERS.names)
        assert all(sum(len(name) + 1 for name in group) <= max(room, 17) for group in groups)


def test_words_that_cannot_stand_in_a_line() -> None:
    assert protocol.is_word("jawOpen")
    assert not any(map(protocol.is_word, ("", "jaw open", "a*", "#jaw", "mündung")))
