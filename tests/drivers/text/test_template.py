"""drivers.text.template: lines with places for values, and values read out of answers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.base.errors import DriverError
from drivers.text.bus import check_texts
from drivers.text.template import NAMES, VALUES, AnswerPattern, Template

ALL = (*VALUES, *NAMES, "time_ms")
GIVEN = {"ch": 5, "id": 5, "name": "jaw", "us": 1499.6, "deg": -12.34, "deg10": -123.4, "angle": 77.7,
         "unit": 0.25, "time_ms": 20.0}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("#{ch}P{us}\r", "#5P1500\r"),
        ("#{ch}P{us:05d}T{time_ms}\r", "#5P01500T20\r"),
        ("{id}:{angle}\n", "5:78\n"),
        ("{name} {deg} {deg:.2f} {unit}\n", "jaw -12.3 -12.34 0.2500\n"),
        ("#{ch}D{deg10}\r", "#5D-123\r"),
        ("{{{ch}}}", "{5}"),
    ],
)
def test_values_are_put_in(text: str, line: str) -> None:
    assert Template("template", text, ALL).fill(GIVEN) == line


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("#{ch}P{uss}", "unknown placeholder {uss}, did you mean {us}?"),
        ("#{channel}", "unknown placeholder {channel}"),
        ("{us.real}", "unknown placeholder {us.real}"),
        ("{us[0]}", r"unknown placeholder {us\[0\]}"),
        ("{}", "unknown placeholder {}"),
        ("#{ch", "expected '}'"),
        ("{us!r}", "cannot have the format '!r'"),
        ("{us:900000000d}", "cannot have the format '900000000d'"),
        ("{us:0100d}", "cannot have the format '0100d'"),
        ("{us:x}", "cannot have the format 'x'"),
        ("{us:.2d}", "cannot have the format '.2d'"),
        ("{us:{ch}}", "cannot have the format"),
        ("{name:9}", "cannot have the format '9'"),
        ("{us}µ", "ASCII"),
    ],
)
def test_what_cannot_be_filled_is_told_when_it_is_made(text: str, message: str) -> None:
    with pytest.raises(DriverError, match=message) as caught:
        Template("template", text, ALL)
    assert str(caught.value).startswith("template: ")
    assert caught.value.hint


def test_answers_are_read_and_nothing_else() -> None:
    pattern = AnswerPattern("answer", "*{ch}QD{deg10}\r", ALL)
    assert pattern.read("*5QD-1300\r") == {"ch": 5, "deg10": -1300}
    assert pattern.read("*5QD 12.5\r") == {"ch": 5, "deg10": 12.5}
    for other in ("*5QD\r", "*5QD12", "x*5QD12\r", "*5QD12\r\r", "*5QD1e3\r", "*QD3\r"):
        assert pattern.read(other) is None
    with pytest.raises(DriverError, match="must end with text"):
        AnswerPattern("answer", "{ch}={us}", ALL)


@given(st.integers(0, 252), st.integers(64, 4080))
def test_what_a_template_writes_its_pattern_reads(channel: int, pulse: int) -> None:
    text = "a{ch},{us}\n"
    line = Template("template", text, ALL).fill({"ch": channel, "us": pulse})
    assert AnswerPattern("answer", text, ALL).read(line) == {"ch": channel, "us": pulse}


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ({"template": "#{ch}\r"}, "holds no value"),
        ({"template": "{us}", "end": "{us}"}, "end: unknown placeholder {us}"),
        ({"template": "{us}", "off": "{us}"}, "off: unknown placeholder {us}"),
        ({"template": "{us}", "query": "?\n"}, "query and answer go together"),
        ({"template": "{us}", "query": "?\n", "answer": "{us}\n"}, "must name its servo"),
    ],
)
def test_templates_of_a_board_fit_together(texts: dict[str, str], message: str) -> None:
    with pytest.raises(DriverError, match=message):
        check_texts(**texts)
