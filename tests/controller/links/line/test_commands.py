"""What the words of the line protocol mean."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS as P
from controller.links.line.commands import COMMANDS, Command, Grammar, Request
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


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("SET jawOpen 0.8", Command("SET", (JAW,), (0.8,))),
        ("set JawOpen .8 mouthsmile_l 1", Command("SET", (JAW, P.index("mouthSmileLeft")), (0.8, 1.0))),
        ("SET jawOpen 0 headYaw -1", Command("SET", (JAW, P.index("headYaw")), (0.0, -1.0))),
        ("SET jawOpen +5e-1", Command("SET", (JAW,), (0.5,))),
        ("FRAME " + "0.5 " * 59, Command("SET", ALL, (0.5,) * 59)),
        ("RELEASE jawOpen headYaw", Command("RELEASE", (JAW, P.index("headYaw")))),
        ("RELEASE ALL", Command("RELEASE", ALL)),
        ("EXPR happy", Command("EXPR", (), (1.0,), ("happiness",))),
        ("EXPR anger 0.5 2", Command("EXPR", (), (0.5, 2.0), ("anger",))),
        ("EXPR anger 0 3600", Command("EXPR", (), (0.0, 3600.0), ("anger",))),
        ("EXPR anger 1 0.05", Command("EXPR", (), (1.0, 0.05), ("anger",))),
        ("EXPR au1+2+5b 0.5", Command("EXPR", (), (0.5,), ("AU1+2+5B",))),
        ("EXPR au12:0.35+au6:.5", Command("EXPR", (), (1.0,), ("AU12:0.35+AU6:.5",))),
        ("EXPR viseme:AA 0.4", Command("EXPR", (), (0.4,), ("VISEME:aa",))),
        ("VISEME aa", Command("VISEME", (), (1.0,), ("aa",))),
        ("viseme pp 0.8", Command("VISEME", (), (0.8,), ("PP",))),
        ("VISEME oh 0.5 I 0.25", Command("VISEME", (), (0.5, 0.25), ("O", "I"))),
        ("HELP", Command("HELP")),
        ("help set", Command("HELP", words=("SET",))),
        ("LIST shows", Command("LIST", words=("SHOWS",))),
        ("EXPR va:0.5,-.25", Command("EXPR", (), (1.0,), ("VA:0.5,-0.25",))),
        ("GAZE -20 5.5", Command("GAZE", (), (-20.0, 5.5))),
        ("GAZE -95 70", Command("GAZE", (), (-95.0, 70.0))),
        ("GAZE at 100 0 600", Command("GAZE AT", (), (100.0, 0.0, 600.0))),
        ("GAZE AT 0 1 0", Command("GAZE AT", (), (0.0, 1.0, 0.0))),
        ("GAZE off", Command("GAZE OFF")),
        ("GAZE room 0 0 0", Command("GAZE ROOM", (), (0.0, 0.0, 0.0))),
        ("GAZE Head maple", Command("GAZE HEAD", words=("maple",))),
        ("TO all", Command("TO", words=("all",))),
        ("TURN Maple", Command("TURN", words=("Maple",))),
        ("AUTH s3cret", Command("AUTH", words=("s3cret",))),
        ("VISEME " + 15 * "aa 0.5 ", Command("VISEME", (), (0.5,) * 15, ("aa",) * 15)),
        ("NEUTRAL", Command("NEUTRAL", (), (0.5,))),
        ("NEUTRAL 60", Command("NEUTRAL", (), (60.0,))),
        ("LIFE 0.25", Command("LIFE", (), (0.25,))),
        ("LIFE 1 listen", Command("LIFE", (), (1.0,), ("LISTEN",))),
        ("LIFE 0 AUTO", Command("LIFE", (), (0.0,), ("AUTO",))),
        ("SHOW tour", Command("SHOW", words=("tour",))),
        ("SHOW play", Command("SHOW", words=("PLAY",))),
        ("SHOW seek Chorus", Command("SHOW", words=("SEEK", "Chorus"))),
        ("GET all", Command("GET", ALL)),
        ("GET headYaw", Command("GET", (P.index("headYaw"),))),
        ("MEASURED jawOpen", Command("MEASURED", (JAW,))),
        ("READ units", Command("READ", words=("UNITS",))),
        ("READ MOOD measured", Command("READ", words=("MOOD", "MEASURED"))),
        ("INFO jawOpen", Command("INFO", (JAW,))),
        ("SUB 25", Command("SUB", (), (25.0,), (), Command("GET", ALL))),
        ("SUB 0.1 all", Command("SUB", (), (0.1,), (), Command("GET", ALL))),
        ("SUB 200 jawOpen", Command("SUB", (), (200.0,), (), Command("GET", (JAW,)))),
        ("SUB 5 measured", Command("SUB", (), (5.0,), (), Command("MEASURED", ALL))),
        ("SUB 5 MEASURED jawOpen", Command("SUB", (), (5.0,), (), Command("MEASURED", (JAW,)))),
        ("SUB 5 READ VISEMES", Command("SUB", (), (5.0,), (), Command("READ", words=("VISEMES",)))),
        ("version", Command("HELLO")),
        ("HELLO Checksum=LATCHED", Command("HELLO", words=("latched",))),
        ("STOP", Command("STOP")),
        ("stop at once", Command("STOP")),
        ("START", Command("START")),
        ("PING a B", Command("PING", words=("a", "B"))),
        ("STATUS", Command("STATUS")),
        ("UNSUB", Command("UNSUB")),
        ("LIST expressions", Command("LIST", words=("EXPRESSIONS",))),
    ],
)
def test_examples(line: str, command: Command) -> None:
    assert parse(line) == command


def test_tag_and_checksum_are_kept() -> None:
    body = b"#7 PING"
    request = GRAMMAR.parse(body + b"*%02X" % checksum(body))
    assert request is not None and (request.tag, request.checked) == (7, True)
    request = GRAMMAR.parse(b"PING")
    assert request is not None and (request.tag, request.checked) == (None, False)
    assert GRAMMAR.parse(b" \t") is None


def test_only_measured_and_read_measured_ask_for_the_servos() -> None:
    asking = ("MEASURED ALL", "READ MOOD MEASURED")
    assert all(parse(line).measured for line in asking)
    assert not any(parse(line).measured for line in ("GET ALL", "READ MOOD", "PING MEASURED", "PING a MEASURED"))


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
        ("SET jawOpen 1.00000001", Code.RANGE, "jawOpen must be 0 to 1, not 1.00000001"),
        ("SET jawOpen a\\b'c", Code.NUMBER, "jawOpen: 'a\\b'c' is not a finite number"),
        ("SET jawOpen " + 40 * "x", Code.NUMBER, f"jawOpen: '{32 * 'x'}...' is not a finite number"),
        ("FRAME 1", Code.ARGUMENTS, "1 value; FRAME needs all 59"),
        ("HELLO checksum=never", Code.ARGUMENTS, "usage: HELLO [checksum=optional|latched|required]"),
        ("HELLO latched", Code.ARGUMENTS, "usage: HELLO [checksum="),
        ("START now", Code.ARGUMENTS, "1 argument; usage: START"),
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
        ("GAZE HEAD", Code.ARGUMENTS, "usage: GAZE"),
        ("GAZE HEAD a b", Code.ARGUMENTS, "usage: GAZE"),
        ("GAZE ROOM 1 2", Code.ARGUMENTS, "usage: GAZE"),
        ("GAZE 1 2 3", Code.ARGUMENTS, "usage: GAZE"),
        ("VISEME aa 0.5 I", Code.ARGUMENTS, "a viseme without a weight; usage: VISEME"),
        ("VISEME aa 1.1", Code.RANGE, "weight must be 0 to 1"),
        ("VISEME xx", Code.NAME, "xx"),
        ("GAZE OFF 1", Code.ARGUMENTS, "usage"),
        ("GAZE AT 1 2", Code.ARGUMENTS, "usage"),
        ("GAZE 120 0", Code.RANGE, "yaw must be -95 to 95"),
        ("GAZE 0 80", Code.RANGE, "pitch must be -70 to 70"),
        ("GAZE AT 0 0 0", Code.RANGE, "at least 1 mm"),
        ("GAZE AT 0 0 0.99", Code.RANGE, "at least 1 mm"),
        ("GAZE AT 0 1000001 0", Code.RANGE, "y must be -1e+06 to 1e+06"),
        ("GAZE 95.1 0", Code.RANGE, "yaw must be"),
        ("NEUTRAL 60.1", Code.RANGE, "seconds must be 0 to 60"),
        ("SUB 201", Code.RANGE, "rate_hz must be 0.1 to 200"),
        ("EXPR anger 1 3601", Code.RANGE, "duration_s must be 0.05 to 3600"),
        ("SHOW SEEK", Code.ARGUMENTS, "usage: SHOW name"),
        ("READ MOOD MEASURED x", Code.ARGUMENTS, "3 arguments; usage: READ"),
        ("SHOW SEEK a b", Code.ARGUMENTS, "3 arguments; usage: SHOW"),
        ("GAZE AT 1 2 3 4", Code.ARGUMENTS, "5 arguments; usage: GAZE"),
        ("NEUTRAL 1 2", Code.ARGUMENTS, "2 arguments; usage: NEUTRAL"),
        ("LIFE", Code.ARGUMENTS, "0 arguments; usage: LIFE"),
        ("LIFE 1 dance", Code.NAME, "unknown manner 'dance'; usage: LIFE"),
        ("INFO jawOpen headYaw", Code.ARGUMENTS, "2 arguments; usage: INFO"),
        ("LIST LAYERS COMMANDS", Code.ARGUMENTS, "2 arguments; usage: LIST"),
        ("SET jawOpen", Code.ARGUMENTS, "1 argument; usage: SET"),
        ("STATUS now", Code.ARGUMENTS, "1 argument; usage: STATUS"),
        ("UNSUB now", Code.ARGUMENTS, "1 argument; usage: UNSUB"),
        ("SHOW tour end", Code.ARGUMENTS, "usage: SHOW name"),
        ("READ TEA", Code.ARGUMENTS, "usage: READ UNITS"),
        ("READ UNITS NOW", Code.ARGUMENTS, "usage: READ UNITS"),
        ("SUB 5 READ", Code.ARGUMENTS, "usage: READ UNITS"),
        ("SUB 5 jawOpen jawOpen", Code.ARGUMENTS, "jawOpen is named twice"),
        ("INFO nothing", Code.NAME, "unknown parameter 'nothing'"),
        ("RELEASE ALL jawOpen", Code.NAME, "unknown parameter 'ALL'"),
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


def test_a_script_may_stop_the_servos_and_not_start_them() -> None:
    scripted = Grammar(P, lambda name: VOCABULARY[name].name, scripted=True)
    request = scripted.parse(b"STOP")
    assert request is not None and request.command == Command("STOP")
    with pytest.raises(LineError, match="START is not for scripts") as caught:
        scripted.parse(b"#3 START")
    assert (caught.value.code, caught.value.tag) == (Code.BUSY, 3)


@pytest.mark.parametrize(
    "name", sorted({*COMMANDS} - {"HELLO", "VERSION", "PING", "NEUTRAL", "STATUS", "UNSUB", "STOP", "START", "HELP"})
)
def test_commands_that_need_arguments_say_so(name: str) -> None:
    with pytest.raises(LineError, match=f"0 arguments; usage: {name}") as caught:
        GRAMMAR.parse(name.encode())
    assert caught.value.code == Code.ARGUMENTS


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("HELLO", 1), ("VERSION", 0), ("EXPR", 3), ("GAZE", 4), ("NEUTRAL", 1), ("LIFE", 2), ("SHOW", 2), ("READ", 2),
        ("INFO", 1), ("STATUS", 0), ("UNSUB", 0), ("LIST", 1), ("VISEME", 30), ("TO", 1), ("TURN", 1), ("AUTH", 1),
        ("HELP", 1), ("START", 0),
    ],
)  # fmt: skip
def test_commands_refuse_more_arguments_than_they_have(name: str, most: int) -> None:
    with pytest.raises(LineError, match=f"{most + 1} arguments?; usage: {name}"):
        GRAMMAR.parse((name + (most + 1) * " x").encode())


def test_a_request_has_no_tag_and_no_checksum_unless_it_says_so() -> None:
    assert Request(Command("PING")) == Request(Command("PING"), None, False) == GRAMMAR.parse(b"PING")


def test_long_words_are_cut_in_refusals() -> None:
    for line, shown in (("%s", "'%s'"), ("LIFE %s", "'%s' is not a finite number"), ("LIST %s", "unknown list '%s'")):
        with pytest.raises(LineError) as caught:
            GRAMMAR.parse((line % ("Q" * 33)).encode())
        assert shown % ("Q" * 32 + "...") in str(caught.value)


def test_points_may_be_as_far_as_the_limit() -> None:
    assert parse("GAZE AT 1000000 -1000000 0") == Command("GAZE AT", (), (1e6, -1e6, 0.0))


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


def test_every_command_is_in_the_specification(root: Path) -> None:
    text = (root / "docs" / "line-protocol.md").read_text(encoding="utf-8")
    assert all(f"`{name}" in text for name in COMMANDS)


def test_records_cannot_be_changed() -> None:
    for record in (Command, Request):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
