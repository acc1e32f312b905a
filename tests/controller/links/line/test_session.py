"""One conversation in the line protocol, without a port."""

from __future__ import annotations

import itertools
from importlib.metadata import version

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS as P
from controller.base.version import package_version
from controller.layers.commands import CommandState
from controller.links.line.protocol import KNOWN_LINES, MAX_LINE, MAX_REPLY, Reply, checksum, format_words, parse_reply
from controller.links.line.script import Script
from controller.links.line.session import LineSession
from controller.links.line.show import Shows
from controller.vocabulary.vocabulary import Vocabulary

SECOND = 10**9
JAW = P.index("jawOpen")


class Talk:
    """A session over a real command state."""

    def __init__(self) -> None:
        self.state = CommandState(P)
        self.session = LineSession(self.state, SECOND)
        self.now = SECOND
        self.values = P.neutral()

    def say(self, line: str) -> Reply:
        replies = self.session.feed(line.encode() + b"\n", self.now).splitlines()
        assert len(replies) == 1
        reply = parse_reply(replies[0])
        assert reply is not None
        return reply

    def run(self, seconds: float) -> np.ndarray:
        for _ in range(round(seconds * 100)):
            self.now += SECOND // 100
            self.state.tick(self.now, 0.01, self.values)
        return self.values


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_set_moves_the_face_and_is_stamped_with_its_arrival(talk: Talk) -> None:
    assert talk.say("#3 SET jawOpen 0.8") == Reply("OK", "SET 1", 3)
    assert talk.state.tick(talk.now + 10, 0.01, talk.values) == talk.now
    assert talk.run(1.0)[JAW] == pytest.approx(0.8, abs=1e-3)
    assert talk.say("GET jawOpen").text == "GET jawOpen=0.8"
    assert talk.say("INFO JawOpen").text == "INFO jawOpen value=0.8 low=0 high=1 region=jaw layer=manual"
    assert talk.say("INFO headYaw").text.endswith("region=head layer=expression full_scale_deg=60")


def test_every_command_is_acknowledged(talk: Talk) -> None:
    talk.run(0.05)
    answers = {
        "HELLO": "HELLO omote", "PING a b": "PONG a b", "PING": "PONG", "FRAME " + "0.5 " * 59: "SET 59",
        "RELEASE jawOpen": "RELEASE 1", "RELEASE ALL": "RELEASE 59", "EXPR Happy .5 2": "EXPR happiness 0.5",
        "GAZE 10 -5": "GAZE", "GAZE AT 0 0 500": "GAZE", "GAZE OFF": "GAZE", "NEUTRAL 1": "NEUTRAL",
        "LIFE .5": "LIFE 0.5", "LIFE .7 listen": "LIFE 0.7 LISTEN", "LIFE 0": "LIFE 0",
        "GET ALL": "GET ALL 0", "STATUS": "STATUS expression=neutral", "SUB 20": "SUB 20 59", "UNSUB": "UNSUB",
        "LIST PARAMETERS": "LIST PARAMETERS eyeBlinkLeft", "LIST EXPRESSIONS": "LIST EXPRESSIONS neutral",
        "LIST LAYERS": "LIST LAYERS expression", "LIST HOLDERS": "LIST HOLDERS expression",
        "LIST COMMANDS": "LIST COMMANDS HELLO", "LIST VISEMES": "LIST VISEMES sil PP", "LIST SHOWS": "LIST SHOWS",
        "HELP": "HELP [command]: HELLO", "HELP list": "HELP LIST COMMANDS",
    }  # fmt: skip
    for line, text in answers.items():
        reply = talk.say(line)
        assert reply.ok and reply.text.startswith(text), line
    assert talk.session.accepted == len(answers)


def test_gaze_and_expression_arrive(talk: Talk) -> None:
    talk.say("GAZE 20 0")
    talk.say("EXPR happiness 1")
    values = talk.run(2.0)
    assert values[P.index("headYaw")] * 60 + values[P.index("leftEyeYaw")] * 35 == pytest.approx(20, abs=0.1)
    assert values[P.index("mouthSmileLeft")] == pytest.approx(0.9, abs=1e-3)
    talk.say("NEUTRAL 0")
    assert np.abs(talk.run(2.0)).max() < 1e-3


def test_a_refused_line_changes_nothing(talk: Talk) -> None:
    talk.say("SET jawOpen 0.5")
    talk.run(1.0)
    for line in ("SET jawOpen 0.9 mouthFunnel 1.1", "SET jawOpen 0.9 nothing 1", "SET jawOpen 0.9 mouthFunnel nan",
                 "SET jawOpen 0.9*00", "EXPR anger 2", "GAZE 0 100", "NEUTRAL -1", "FRAME 1"):  # fmt: skip
        reply = talk.say(line)
        assert reply.kind == "ERR" and reply.text
    values = talk.run(1.0)
    assert values[JAW] == pytest.approx(0.5, abs=1e-3)
    assert np.abs(np.delete(values, JAW)).max() < 1e-9
    assert talk.session.refused.total() == 8


def test_checksums_are_answered_with_checksums(talk: Talk) -> None:
    assert talk.session.feed(format_words(["PING"], tag=9, checked=True), 0) == b"#9 OK PONG*%02X\n" % checksum(
        b"#9 OK PONG"
    )
    talk.say("SUB 10 jawOpen")
    assert b"*" not in talk.session.stream(talk.now)
    talk.session.feed(format_words(["SUB", "10", "jawOpen"], checked=True), talk.now)
    reply = parse_reply(talk.session.stream(talk.now).strip())
    assert reply is not None and reply.checked and reply.text == "0 jawOpen=0"


def test_stream_keeps_its_rate_and_leaves_missed_lines_out(talk: Talk) -> None:
    assert talk.session.due_ns() is None and talk.session.stream(talk.now) == b""
    talk.say("SUB 10 jawOpen headYaw")
    lines = []
    for step in range(101):  # one second in steps of 10 ms
        lines += talk.session.stream(talk.now + step * SECOND // 100).splitlines()
    assert len(lines) == 11 and lines[3] == b"P 300 jawOpen=0 headYaw=0"
    assert len(talk.session.stream(talk.now + 60 * SECOND).splitlines()) == 1
    assert talk.session.due_ns() == talk.now + 60 * SECOND + SECOND // 10
    talk.say("SUB 10 ALL")
    assert talk.session.stream(talk.now).startswith(b"F 0 0 0 ")
    talk.say("UNSUB")
    assert talk.session.stream(talk.now + 99 * SECOND) == b""


def test_a_dropped_line_forgets_its_half_and_keeps_its_stream(talk: Talk) -> None:
    talk.say("SUB 10")
    talk.session.feed(b"SET jaw", 0)
    talk.session.drop()
    assert talk.session.due_ns() == talk.now
    assert talk.session.feed(b"PING\n", 0) == b"OK PONG\n"


def test_what_the_sink_refuses_is_a_busy_reply(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise ControllerError("a take is playing")

    monkeypatch.setattr(talk.state, "neutral", refuse)
    assert talk.say("#2 NEUTRAL") == Reply("ERR", "a take is playing", 2, 30)


NOISE = st.binary(max_size=120) | st.sampled_from(
    [b"SET jawOpen 2", b"SET jawOpen", b"EXPR nothing 1", b"#1 GAZE 1", b"x" * (MAX_LINE + 50), b"PING", b"STATUS",
     b"*", b"#", b"SUB 1e9", b"FRAME", b"GET ALL", b"\xff\xfe\x00", b" \t ", b"LIST ALL"]
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(NOISE, st.sampled_from([b"\n", b"\r", b"\r\n"])), max_size=12), st.integers(1, 200))
def test_any_bytes_get_one_answer_a_line_and_never_move_the_face(pieces: list[tuple[bytes, bytes]], cut: int) -> None:
    data = b"".join(body + end for body, end in pieces) + b"\n"
    session = LineSession(STATE, 0)
    replies = b"".join(session.feed(data[i : i + cut], 0) for i in range(0, len(data), cut))
    lines = [line for line in data.replace(b"\r", b"\n").split(b"\n") if line.strip(b" \t")]
    answers = replies.splitlines()
    assert len(answers) == len(lines)
    for answer in answers:
        reply = parse_reply(answer)
        assert reply is not None and reply.kind in ("OK", "ERR") and len(answer) <= MAX_REPLY
    STATE.tick(SECOND, 0.01, FACE)
    assert not FACE.any()


STATE, FACE = CommandState(P), P.neutral()


class Servos:
    """Servos that show an open jaw."""

    def __init__(self) -> None:
        self.known = True

    def measured(self, out: np.ndarray) -> bool:
        out[:] = 0.0
        out[JAW] = 0.5
        return self.known

    def status(self) -> dict[str, float]:
        return {"away_deg": 1.5}


def test_a_face_is_told_and_streamed_in_other_vocabularies(talk: Talk) -> None:
    talk.say("EXPR happiness")
    talk.run(1.5)
    assert talk.say("READ EMOTION").text.startswith("READ EMOTION happiness=")
    assert "L12=" in talk.say("read units").text
    assert talk.say("READ MOOD").text.startswith("READ MOOD valence=")
    assert talk.say("READ VISEMES").text.startswith("READ VISEMES")
    assert talk.say("SUB 20 READ EMOTION").text == "SUB 20 READ EMOTION"
    reply = parse_reply(talk.session.stream(talk.now).strip())
    assert reply is not None and reply.kind == "P" and "happiness=" in reply.text
    assert (
        talk.say("READ").code == 21 and talk.say("READ TEA").code == 21 and talk.say("SUB 5 READ UNITS NOW").code == 21
    )


def test_what_the_servos_show_is_told_and_streamed(talk: Talk) -> None:
    for line in ("MEASURED jawOpen", "READ UNITS MEASURED"):
        assert (talk.say(line).code, talk.say(line).text) == (30, "no servo reports its position")
    servos = talk.state.servo_monitor = Servos()
    assert talk.say("MEASURED jawOpen tongueOut").text == "MEASURED jawOpen=0.5 tongueOut=0"
    assert "26=" in talk.say("READ UNITS MEASURED").text
    assert "away_deg=1.5" in talk.say("STATUS").text
    assert talk.say("SUB 20 MEASURED jawOpen").text == "SUB 20 MEASURED 1"
    assert talk.session.stream(talk.now).strip().endswith(b"jawOpen=0.5")
    assert talk.say("SUB 20 MEASURED").text == "SUB 20 MEASURED 59"
    assert talk.session.stream(talk.now).startswith(b"F ")
    servos.known = False
    talk.now += SECOND
    assert talk.session.stream(talk.now) == b""


def checked(line: str) -> str:
    return format_words([line], checked=True).decode().strip()


def test_a_link_that_had_a_checksum_takes_no_line_without_one(talk: Talk) -> None:
    talk.session = LineSession(talk.state, 0, checksum="latched")
    assert talk.say("SET tongueOut 0.3").ok  # a person at a terminal
    assert talk.say(checked("SET tongueOut 0")).ok
    damaged = checked("SET tongueOut 0").replace("*", ".")
    assert damaged == "SET tongueOut 0.45"
    reply = talk.say(damaged)
    assert reply.code == 13 and "HELLO checksum=optional" in reply.text
    assert talk.run(1.0)[P.index("tongueOut")] == pytest.approx(0.0, abs=1e-3)
    assert talk.say("#4 PING").tag is None and talk.say("HELLO").code == 13 and talk.say("START").code == 13
    assert talk.say("HELLO checksum=never").code == 21
    assert talk.say("HELLO checksum=optional").text.endswith("checksum=optional")  # the way out that it names
    assert talk.say(checked("PING")).ok and talk.say("PING").ok
    assert talk.say("HELLO checksum=latched").ok and talk.say("PING").ok
    assert talk.say(checked("SET nothing 1")).code == 23 and talk.say("PING").code == 13
    assert talk.say(checked("HELLO checksum=latched")).ok and talk.say("PING").code == 13


def test_a_repeated_line_is_judged_each_time(talk: Talk) -> None:
    """What a line means is kept, not whether it is taken."""
    talk.session = LineSession(talk.state, 0, checksum="latched")
    assert [talk.say(f"#{n} SET jawOpen 0.5").tag for n in (1, 1, 2)] == [1, 1, 2]
    assert talk.say("SET jawOpen 0.5").ok and talk.say("SET jawOpen 0.5").ok
    assert talk.say(checked("SET jawOpen 0.5")).checked and talk.say("SET jawOpen 0.5").code == 13
    for n in range(KNOWN_LINES + 9):
        assert talk.say(checked(f"SET jawOpen {n / 1000}")).ok
    kept = talk.session._grammar._command.cache_info()  # type: ignore[attr-defined]
    assert kept.currsize == KNOWN_LINES


def test_a_link_that_demands_checksums_never_takes_a_line_without(talk: Talk) -> None:
    talk.session = LineSession(talk.state, 0, checksum="required")
    for line in ("PING", "HELLO", "HELLO checksum=optional", "START"):
        reply = talk.say(line)
        assert reply.code == 13 and "the stage's file requires" in reply.text and reply.checked
    assert talk.say(checked("HELLO checksum=optional")) == Reply(
        "ERR", "the stage's file requires checksums on this link", None, 30, True
    )
    assert talk.say(checked("HELLO checksum=required")).text.endswith("checksum=required")
    assert talk.say("PING").code == 13 and talk.say(checked("PING")).ok


def test_a_host_can_ask_for_checksums_and_a_person_can_end_that(talk: Talk) -> None:
    assert talk.say("HELLO").text.endswith("checksum=optional") and talk.say(checked("PING")).ok
    assert talk.say("PING").ok
    assert talk.say("HELLO checksum=required").ok
    assert "this link requires one" in talk.say("PING").text
    assert talk.say("HELLO checksum=optional").ok and talk.say("PING").ok


def test_stop_holds_until_start_and_is_reported(talk: Talk) -> None:
    session, latch = LineSession(talk.state, 0, name="line /dev/tty ACM0"), talk.state.stop_latch
    talk.session = session
    assert "stopped=no" in talk.say("STATUS").text.split()
    assert talk.say("#3 STOP") == Reply("OK", "STOP", 3)
    assert latch.stopped is not None and latch.stopped.who == "line /dev/tty ACM0"
    other = LineSession(talk.state, 0, name="line other")
    assert other.feed(b"STOP\n", talk.now) == b"OK STOP\n" and latch.stopped.who == "line /dev/tty ACM0"
    talk.say("SET jawOpen 0.5")
    talk.run(1.25)
    for text in (talk.say("STATUS").text, other.feed(b"STATUS\n", talk.now).decode()):
        assert {"stopped=line_/dev/tty_ACM0", "stopped_s=1.25"} <= set(text.split())
    assert talk.values[JAW] > 0.4  # the face goes on
    assert talk.say("START").ok and latch.stopped is None and "stopped_s" not in talk.say("STATUS").text
    assert talk.say("START").ok  # nothing had stopped them


@pytest.mark.parametrize("mode", ["latched", "required"])
@pytest.mark.parametrize(
    "line", [b"STOP", b"STOP*00", b" STOP", b"#1234567890 STOP", b"\xff\x00STOP", b"STOP now", b"STOP*"]
)
def test_stop_is_never_refused(talk: Talk, mode: str, line: bytes) -> None:
    session = LineSession(talk.state, 0, checksum=mode)
    session.feed(checked("PING").encode() + b"\n", 0)
    reply = parse_reply(session.feed(line + b"\n", 0).strip())
    assert reply is not None and (reply.kind, reply.text) == ("OK", "STOP")
    assert talk.state.stop_latch.stopped is not None
    assert b"ERR 13" in session.feed(b"START\n", 0) and talk.state.stop_latch.stopped is not None


def test_a_start_before_a_stop_in_one_read_never_lets_the_servos_go(talk: Talk) -> None:
    latch = talk.state.stop_latch
    replies = talk.session.feed(b"STOP\nSTART\nPING\nSTOP\n", 0).splitlines()
    assert [reply.split()[0] for reply in replies] == [b"OK", b"ERR", b"OK", b"OK"]
    assert b"a STOP follows" in replies[1] and latch.stopped is not None and latch.stops == 1
    assert talk.session.feed(b"STOP\nSTART\n", 0) == b"OK STOP\nOK START\n" and latch.stopped is None


def test_a_script_stops_under_its_own_name(talk: Talk) -> None:
    session = LineSession(talk.state, 0, name="show tour", scripted=True)
    assert session.feed(b"STOP\nSTART\n", 0).splitlines()[1].startswith(b"ERR 30 START is not for scripts")
    assert "stopped=show_tour" in talk.say("STATUS").text


def test_an_error_of_omote_in_a_stream_ends_the_stream_only(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(out: np.ndarray) -> None:
        raise ZeroDivisionError("no values")

    talk.say("SUB 10")
    monkeypatch.setattr(talk.state, "snapshot", broken)
    assert talk.session.stream(talk.now) == b"" and talk.session.due_ns() is None
    assert (talk.session.faults, talk.session.last_fault) == (1, "ZeroDivisionError: no values")
    assert talk.say("PING").ok and talk.say("GET jawOpen").code == 31


def test_hello_opens_no_file(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    package_version.cache_clear()
    monkeypatch.setattr("importlib.metadata.version", lambda name: (_ for _ in ()).throw(OSError(24, "no descriptor")))
    assert talk.say("HELLO").text.startswith(f"HELLO omote {version('omote')} ")


@pytest.mark.parametrize("debug", ["", "1"])
def test_an_error_of_omote_shows_a_traceback_to_developers_only(
    talk: Talk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, debug: str
) -> None:
    monkeypatch.setenv("OMOTE_DEBUG", debug)
    talk.session.fault(OSError("no descriptor"), "it goes on")
    assert "OSError: no descriptor" in caplog.text and bool(caplog.records[0].exc_info) is bool(debug)


def test_a_file_that_is_wrong_refuses_the_line_that_needs_it(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(self: Vocabulary, name: str) -> None:
        raise ConfigError("facs.toml: 1 fault:\n  units: missing")

    monkeypatch.setattr(Vocabulary, "__getitem__", wrong)
    assert talk.say("#5 EXPR AU1") == Reply("ERR", "facs.toml: 1 fault: units: missing", 5, 30)
    assert talk.session.faults == 0


@pytest.mark.parametrize("to", ["1_0", "nan", "inf", "1e999"])
def test_only_plain_numbers_are_times_of_a_show(talk: Talk, to: str) -> None:
    script = Script(((0.0, "PING"), (50.0, "PING")), name="mine", marks={"end": 1.0})
    talk.state.shows = Shows(lambda name: script, talk.state)
    assert talk.say("SHOW mine").ok and talk.say("SHOW SEEK 10").ok
    assert talk.say(f"SHOW SEEK {to}").kind == "ERR" and "show=mine@10" in talk.say("STATUS").text


def test_faults_are_logged_once_a_kind_and_shown_in_part(
    talk: Talk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    kinds = itertools.cycle(["one", "two"])

    def broken(amount: float, stamp_ns: int) -> None:
        raise ZeroDivisionError(next(kinds) + 300 * "x")

    monkeypatch.setattr(talk.state, "live", broken)
    assert all(len(talk.say("LIFE 1").text) < 150 for _ in range(6))
    assert caplog.text.count("the link continues with the next line") == 2 and talk.session.faults == 6
    kinds = (str(i) for i in itertools.count())
    for _ in range(100):
        talk.say("LIFE 1")
    assert caplog.text.count("the link continues with the next line") == 50


def test_visemes_form_the_mouth_until_the_next_or_for_a_second(talk: Talk) -> None:
    roll = P.index("mouthRollLower")
    assert talk.say("VISEME aa 0.8") == Reply("OK", "VISEME aa 0.8")
    assert talk.run(0.5)[JAW] == pytest.approx(0.44, abs=0.01) and talk.state.holder(JAW) == "speech"
    talk.say("VISEME PP")
    assert talk.run(0.5)[[JAW, roll]] == pytest.approx([0.0, 0.45], abs=0.01)
    assert talk.run(1.5)[roll] == pytest.approx(0.0, abs=0.01) and talk.state.holder(roll) != "speech"


def test_a_mix_of_visemes_is_the_sum_of_them_and_no_more_than_the_face_can(talk: Talk) -> None:
    talk.say("VISEME aa 0.5 O 0.5")
    assert talk.run(0.5)[JAW] == pytest.approx(0.5 * 0.55 + 0.5 * 0.52, abs=0.01)
    talk.say("VISEME aa 1 O 1 U 1")
    assert talk.run(0.8).max() == pytest.approx(1.0, abs=0.01)


def test_the_shows_are_listed(talk: Talk) -> None:
    talk.state.shows = Shows(lambda name: Script(((0.0, "PING"),)), talk.state, lambda: ("tour", "wave"))
    assert talk.say("LIST SHOWS").text == "LIST SHOWS tour wave"
