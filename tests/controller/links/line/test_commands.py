"""What the words of the line protocol mean."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS as P
from controller.links.line.commands import (
    COMMANDS,
    LISTS,
    MAX_DURATION_S,
    MAX_FADE_S,
    USAGE,
    Command,
    Expr,
    Gaze,
    GazeAt,
    GazeOff,
    Get,
    Grammar,
    Hello,
    Info,
    List,
    Live,
    Neutral,
    Ping,
    Release,
    Request,
    Set,
    Status,
    Subscribe,
    Unsubscribe,
)
from controller.links.line.protocol import Code, LineError, checksum
from controller.vocabulary.vocabulary import Vocabulary

VOCABULARY = Vocabulary.load(P)
GRAMMAR = Grammar(P, lambda name: VOCABULARY[name].name)
ALL = tuple(range(59))
JAW = P.index("jawOpen")


def parse(line: str) -> Command:
    request = GRAMMAR.parse(line.encode())
    assert request is not None
    return request.command


@st.composite
def settings_of_parameters(draw: st.DrawFn) -> Set:
    indices = draw(st.lists(st.integers(0, 58), min_size=1, max_size=15, unique=True))
    values = [draw(st.floats(float(P.low[i]), float(P.high[i]), allow_subnormal=False)) for i in indices]
    return Set(tuple(indices), tuple(values))


INDICES = st.just(ALL) | st.lists(st.integers(0, 58), min_size=1, max_size=10, unique=True).map(tuple)
NAME = st.sampled_from(VOCABULARY.names)
COMMAND = st.one_of(
    settings_of_parameters(),
    st.builds(Release, INDICES),
    st.builds(Get, INDICES),
    st.builds(Expr, NAME, st.floats(0, 1), st.none() | st.floats(0.05, MAX_DURATION_S)),
    st.builds(Gaze, st.floats(-95, 95), st.floats(-70, 70)),
    st.builds(GazeAt, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(2, 1e6)),
    st.builds(Neutral, st.floats(0, MAX_FADE_S)),
    st.builds(Live, st.floats(0, 1)),
    st.builds(Info, st.integers(0, 58)),
    st.builds(Subscribe, st.floats(0.1, 200), INDICES),
    st.builds(List, st.sampled_from(LISTS)),
    st.sampled_from([Hello(), Status(), Unsubscribe(), GazeOff(), Ping(), Ping("a b")]),
)


@settings(deadline=None)
@given(COMMAND, st.none() | st.integers(0, 10**9 - 1), st.booleans())
def test_format_and_parse_round_trip(command: Command, tag: int | None, checked: bool) -> None:
    request = Request(command, tag, checked)
    assert GRAMMAR.parse(GRAMMAR.format(request)[:-1]) == request


def test_examples() -> None:
    assert parse("SET jawOpen 0.8") == Set((JAW,), (0.8,))
    assert parse("set JawOpen .8 mouthsmile_l 1") == Set((JAW, P.index("mouthSmileLeft")), (0.8, 1.0))
    assert parse("FRAME " + "0.5 " * 59) == Set(ALL, (0.5,) * 59)
    assert parse("EXPR happy") == Expr("happiness", 1.0, None)
    assert parse("EXPR anger 0.5 2") == Expr("anger", 0.5, 2.0)
    assert parse("EXPR au1+2+5b 0.5") == Expr("AU1+2+5B", 0.5, None)
    assert parse("EXPR va:0.5,-.25") == Expr("VA:0.5,-0.25", 1.0, None)
    assert parse("GAZE -20 5.5") == Gaze(-20.0, 5.5)
    assert parse("GAZE at 100 0 600") == GazeAt(100.0, 0.0, 600.0)
    assert parse("GAZE off") == GazeOff()
    assert parse("NEUTRAL") == Neutral(0.5)
    assert parse("GET all") == Get(ALL)
    assert parse("SUB 25") == Subscribe(25.0, ALL)
    assert parse("SUB 25 jawOpen") == Subscribe(25.0, (JAW,))
    assert parse("version") == Hello()
    assert parse("LIST expressions") == List("EXPRESSIONS")


@pytest.mark.parametrize(
    ("line", "code", "part"),
    [
        ("STE jawOpen 1", Code.COMMAND, "did you mean 'SET'"),
        ("SET", Code.ARGUMENTS, "usage: SET name value"),
        ("SET jawOpen", Code.ARGUMENTS, "usage"),
        ("SET jawOpen 0.5 mouthFunnel", Code.ARGUMENTS, "a name without a value"),
        ("SET jawOpen 0.5 JAWOPEN 0.6", Code.ARGUMENTS, "jawOpen is named twice"),
        ("SET jawOpn 0.5", Code.NAME, "did you mean 'jawOpen'"),
        ("SET jawOpen 1.01", Code.RANGE, "jawOpen must be 0 to 1, not 1.01"),
        ("SET headYaw -2", Code.RANGE, "headYaw must be -1 to 1"),
        ("SET jawOpen nan", Code.NUMBER, "'nan' is not a finite number"),
        ("SET jawOpen inf", Code.NUMBER, "not a finite number"),
        ("SET jawOpen 1e999", Code.NUMBER, "not a finite number"),
        ("SET jawOpen 0x1", Code.NUMBER, "not a finite number"),
        ("SET jawOpen 1_0", Code.NUMBER, "not a finite number"),
        ("SET jawOpen 0,5", Code.NUMBER, "not a finite number"),
        ("FRAME 1 2 3", Code.ARGUMENTS, "3 values; FRAME needs all 59"),
        ("EXPR hapiness", Code.NAME, "did you mean 'happiness'"),
        ("EXPR AU1+99", Code.NAME, "unknown action unit '99'"),
        ("EXPR VA:0.5", Code.NAME, "VA: needs 2 numbers"),
        ("EXPR VAD:0,0,2", Code.NAME, "from -1 to 1"),
        ("EXPR anger 1.5", Code.RANGE, "intensity must be 0 to 1"),
        ("EXPR anger 1 0", Code.RANGE, "duration_s must be 0.05 to 3600"),
        ("EXPR anger 1 2 3", Code.ARGUMENTS, "usage"),
        ("GAZE 10", Code.ARGUMENTS, "usage"),
        ("GAZE OFF 1", Code.ARGUMENTS, "usage"),
        ("GAZE AT 1 2", Code.ARGUMENTS, "usage"),
        ("GAZE 120 0", Code.RANGE, "yaw must be -95 to 95"),
        ("GAZE 0 80", Code.RANGE, "pitch must be -70 to 70"),
        ("GAZE AT 0 0 0", Code.RANGE, "at least 1 mm"),
        ("NEUTRAL -1", Code.RANGE, "seconds must be 0 to 60"),
        ("LIFE 2", Code.RANGE, "amount must be 0 to 1"),
        ("GET", Code.ARGUMENTS, "usage"),
        ("SUB 0", Code.RANGE, "rate_hz must be 0.1 to 200"),
        ("SUB", Code.ARGUMENTS, "usage"),
        ("LIST THINGS", Code.NAME, "unknown list"),
        ("HELLO there", Code.ARGUMENTS, "usage"),
    ],
)
def test_refusals_say_why(line: str, code: Code, part: str) -> None:
    with pytest.raises(LineError) as caught:
        GRAMMAR.parse(b"#5 " + line.encode())
    assert (caught.value.code, caught.value.tag) == (code, 5)
    assert part in str(caught.value)


def test_a_checked_refusal_is_answered_checked() -> None:
    body = b"#5 SET jawOpen 2"
    with pytest.raises(LineError) as caught:
        GRAMMAR.parse(body + b"*%02X" % checksum(body))
    assert caught.value.checked and caught.value.tag == 5


SOUP = [*COMMANDS, "jawOpen", "headYaw", "anger", "ALL", "AT", "OFF", "0.5", "-1", "1e9", "x"]


@settings(deadline=None)
@given(st.lists(st.sampled_from(SOUP), max_size=8))
def test_any_words_are_a_command_or_a_refusal(words: list[str]) -> None:
    try:
        GRAMMAR.parse(" ".join(words).encode())
    except LineError as error:
        assert str(error)


def test_every_command_has_usage_and_is_in_the_specification(root: Path) -> None:
    text = (root / "docs" / "line-protocol.md").read_text(encoding="utf-8")
    assert set(USAGE) == set(COMMANDS)
    assert all(f"`{name}" in text for name in COMMANDS)
