"""Shows."""

from __future__ import annotations

import itertools
import math

import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line.script import Script
from controller.links.line.session import LineSession
from controller.links.line.show import Show, Shows

STEPS = ((0.0, "EXPR smile"), (1.0, "SET jawOpen 0.5"), (2.0, "NEUTRAL 0"), (2.0, "EXPR anger"))
SECOND = 10**9


def run(show: Show, start_s: float, seconds: float) -> list[str]:
    """Tick 20 times a second from ``start_s`` on; everything that was said."""
    return [line for i in range(round(seconds * 20) + 1) for line in show.tick(int((start_s + i / 20) * SECOND))]


@pytest.fixture
def show() -> Show:
    return Show(Script(STEPS, marks={"open": 1.0, "end": 2.0}), CommandState(P))


def test_steps_come_in_time_and_reach_the_face() -> None:
    state = CommandState(P)
    show = Show(Script(STEPS), state)
    assert show.tick(0) == []  # not begun
    show.playing = True
    assert run(show, 5.0, 0.9) == ["EXPR smile"]
    assert run(show, 5.95, 0.1) == ["SET jawOpen 0.5"]
    assert state.status()["manual"] == 1 and state.status()["expression"] == "smile"
    assert run(show, 6.1, 1.0) == ["NEUTRAL 0", "EXPR anger"]
    assert show.finished and state.status()["manual"] == 0
    assert run(show, 8.0, 3.0) == []


def test_pause_stops_time(show: Show) -> None:
    show.playing = True
    run(show, 0.0, 0.5)
    show.playing = False
    assert run(show, 0.6, 30.0) == []
    show.playing = True
    assert run(show, 100.0, 0.4) == []
    assert run(show, 100.45, 0.2) == ["SET jawOpen 0.5"]


def test_seek_to_marks_and_times(show: Show) -> None:
    show.playing = True
    show.seek("end")
    assert show.tick(0) == ["NEUTRAL 0", "EXPR anger"]
    show.seek(0.5)
    assert not show.finished
    assert run(show, 10.0, 0.6) == ["SET jawOpen 0.5"]
    with pytest.raises(ParameterError, match="did you mean 'open'"):
        show.seek("opne")
    for wrong in (-1.0, math.nan, math.inf):
        with pytest.raises(ParameterError):
            show.seek(wrong)


def test_a_loop_begins_again_without_losing_time() -> None:
    show = Show(Script(((0.0, "PING a"), (0.5, "PING b")), loop_s=1.0), CommandState(P))
    show.playing = True
    assert run(show, 0.0, 3.3) == ["PING a", "PING b"] * 3 + ["PING a"]
    assert show.position_s == pytest.approx(0.3) and not show.finished


def test_a_show_is_steered_over_a_link() -> None:
    state = CommandState(P)
    session, values = LineSession(state, 0), P.neutral()

    def say(line: str) -> str:
        return session.feed(line.encode() + b"\n", 0).decode().strip()

    assert say("SHOW tour").startswith("ERR 30 no shows can be played here")
    script = Script(
        ((0.0, "SET jawOpen 0.5"), (1.0, "SET jawOpen 1"), (2.0, "NEUTRAL 0")), 0.0, 0.0, "mine", {"end": 1.9}
    )
    shows = state.shows = Shows(lambda name: {"mine": script}[name], state)
    assert say("SHOW PAUSE").startswith("ERR 30 no show plays")
    assert say("SHOW mine") == "OK SHOW mine"

    clock = itertools.count(0, 10_000_000)

    def run(seconds: float) -> float:
        for now_ns in itertools.islice(clock, round(seconds * 100)):
            shows.tick(now_ns)
            state.tick(now_ns, 0.01, values)
        return float(values[P.index("jawOpen")])

    assert run(0.8) == pytest.approx(0.5, abs=0.01)
    assert say("SHOW PAUSE") == "OK SHOW PAUSE" and run(1.0) == pytest.approx(0.5, abs=0.01)
    assert "show=mine@0.8,paused" in say("STATUS")
    say("SHOW PLAY")
    assert run(0.9) == pytest.approx(1.0, abs=0.01)
    assert say("SHOW SEEK 0.9") == "OK SHOW SEEK 0.9" and "show=mine@0.9" in say("STATUS")
    assert say("SHOW SEEK end") == "OK SHOW SEEK end" and run(0.9) == pytest.approx(0.0, abs=0.01)
    assert "show=off" in say("STATUS")
    assert "did you mean 'end'" in say("SHOW SEEK ent") and say("SHOW SEEK").startswith("ERR 21")
    assert say("SHOW STOP") == "OK SHOW STOP" and say("SHOW STOP").startswith("ERR 30")


def test_a_show_stops_the_servos_and_cannot_start_them() -> None:
    state = CommandState(P)
    show = Show(Script(((0.0, "STOP"), (0.1, "START")), name="mine"), state)
    show.playing = True
    assert run(show, 0.0, 1.0) == ["STOP", "START"]
    assert state.stop_latch.stopped is not None and state.stop_latch.stopped.who == "show mine"


def test_the_hint_lists_the_marks_there_are(show: Show) -> None:
    with pytest.raises(ParameterError) as caught:
        show.seek("nowhere")
    assert caught.value.hint == f"marks: {', '.join(show.script.marks)}" and "open" in caught.value.hint
    plain = Show(Script(((0.0, "NEUTRAL"),)), CommandState(P))
    with pytest.raises(ParameterError) as caught:
        plain.seek("open")
    assert caught.value.hint == "marks: none"


@pytest.mark.parametrize(("what", "status"), [("STOP", "off"), ("PAUSE", "next@0.0,paused"), ("SEEK", "next@0.0")])
def test_what_stops_a_show_also_stops_one_that_has_begun_at_that_moment(what: str, status: str) -> None:
    """A show may start another one while a link asks for it to be stopped; a place in the one is none in the other."""
    shows = Shows(lambda name: Script(((9.0, "PING"),), name=name), CommandState(P))
    shows.start("first")
    act = shows.prepare_control(what, 5.0)
    shows.start("next")
    act()
    assert shows.status() == status
