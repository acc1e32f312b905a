"""controller.layers.heads: whom a command means, and who speaks."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.base.placement import Placement
from controller.layers.commands import CommandState
from controller.layers.heads import Heads, Turns
from controller.layers.mixer import LayerSettings, Mixer
from controller.layers.settings import default_layers
from controller.links.line.script import Script
from controller.links.line.session import LineSession
from controller.links.line.show import Shows
from controller.links.websocket.conversation import Conversation

JAW = P.index("jawOpen")
SECOND = 10**9


def hall(*, auto: bool = False) -> list[CommandState]:
    """Three heads in a row, 500 mm apart."""
    heads = Heads({"pair": ["maple", "oak"]})
    states = [CommandState(P) for _ in range(3)]
    for i, (state, name) in enumerate(zip(states, ("maple", "oak", "willow"), strict=True)):
        state.name, state.heads, state.placement = name, heads, Placement((500.0 * (i - 1), 0.0, 0.0))
        state.stop_latch = states[0].stop_latch
        heads.add(state)
    heads.turns = Turns(heads, auto=auto)
    return states


def held(states: list[CommandState]) -> list[float | None]:
    return [state.held().get(JAW) for state in states]


def say(session: LineSession, line: str, now_ns: int = SECOND) -> str:
    return session.feed(line.encode() + b"\n", now_ns).decode().strip()


def test_lines_reach_whom_they_name() -> None:
    states = hall()
    session = LineSession(states[0], 0)
    assert say(session, "SET jawOpen 0.1") == "OK SET 1" and held(states) == [0.1, None, None]
    assert say(session, "#3 @OAK SET jawOpen 0.2") == "#3 OK SET 1" and held(states) == [0.1, 0.2, None]
    assert say(session, "@pair SET jawOpen 0.3") == "OK SET 1" and held(states) == [0.3, 0.3, None]
    assert say(session, "@all SET jawOpen 0.4") == "OK SET 1" and held(states) == [0.4, 0.4, 0.4]
    assert say(session, "TO willow") == "OK TO willow"
    say(session, "SET jawOpen 0.5")
    say(session, "@maple RELEASE jawOpen")
    assert held(states) == [None, 0.4, 0.5]
    assert "head=willow" in say(session, "STATUS") and "head=oak" in say(session, "@oak STATUS")
    assert say(session, "LIST HEADS") == "OK LIST HEADS maple oak willow"
    assert say(session, "LIST GROUPS") == "OK LIST GROUPS pair"


def test_nobody_is_meant_by_a_wrong_name_and_questions_need_one_head() -> None:
    states = hall()
    session = LineSession(states[0], 0)
    assert say(session, "@mapel SET jawOpen 1").startswith("ERR 23 ") and "'maple'" in say(
        session, "@mapel SET jawOpen 1"
    )
    assert say(session, "TO nobody").startswith("ERR 23 ")
    assert say(session, "@pair GET jawOpen").startswith("ERR ") and held(states) == [None] * 3
    alone = LineSession(CommandState(P), 0)
    assert "one head" in say(alone, "@maple SET jawOpen 1") and "one head" in say(alone, "TURN maple")
    assert say(alone, "LIST HEADS") == "OK LIST HEADS"


def with_shows(states: list[CommandState], scripts: dict[str, dict[str, Script]]) -> list[Shows]:
    """Gives each head its own scripts, by name."""

    def finder(own: dict[str, Script]) -> Callable[[str], Script]:
        def find(name: str) -> Script:
            if name not in own:
                raise ConfigError(f"no script {name}", hint="name one that is there")
            return own[name]

        return find

    shows = [Shows(finder(scripts[state.name]), state) for state in states]
    for state, each in zip(states, shows, strict=True):
        state.shows = each
    return shows


def test_a_show_for_all_begins_at_every_head_or_at_none() -> None:
    states, tour = hall(), Script(((0.0, "SET jawOpen 0.5"),), name="tour", marks={"middle": 1.0})
    shows = with_shows(states, {"maple": {"tour": tour}, "oak": {}, "willow": {"tour": tour}})
    session = LineSession(states[0], 0)
    answer = say(session, "@all SHOW tour")
    assert answer.startswith("ERR ") and "oak: no script tour; nothing has changed at maple, oak, willow" in answer
    assert [each.name for each in shows] == [None] * 3
    assert say(session, "@maple SHOW tour") == "OK SHOW tour" and [each.name for each in shows] == ["tour", None, None]


def test_a_mark_that_one_of_the_shows_lacks_is_sought_by_none_of_them() -> None:
    states = hall()
    tour, walk = (Script(((5.0, "SET jawOpen 0.5"),), name=name, marks=marks)
                  for name, marks in (("tour", {"middle": 1.0}), ("walk", {})))  # fmt: skip
    shows = with_shows(states, {"maple": {"tour": tour}, "oak": {"walk": walk}, "willow": {}})
    session = LineSession(states[0], 0)
    assert "maple: no show plays" in say(session, "@all SHOW PAUSE")
    for line in ("@maple SHOW tour", "@oak SHOW walk"):
        say(session, line)
    answer = say(session, "@all SHOW SEEK middle")
    assert answer.startswith("ERR ") and "oak: unknown mark" in answer
    assert [each.status() for each in shows] == ["tour@0.0", "walk@0.0", "off"]
    assert say(session, "@all SHOW SEEK 2") == "OK SHOW SEEK 2"  # of those that play
    assert say(session, "@all SHOW PAUSE") == "OK SHOW PAUSE"
    assert [each.status() for each in shows] == ["tour@2.0,paused", "walk@2.0,paused", "off"]


def test_a_layer_that_one_head_lacks_is_written_at_none() -> None:
    states = hall()
    own = [*default_layers(), LayerSettings(name="dance", priority=35)]
    states[0].mixer, states[2].mixer = Mixer(P, own), Mixer(P, own)
    mask = np.zeros(len(P), bool)
    mask[JAW] = True
    everybody = states[0].heads.find("all")
    with pytest.raises(ParameterError, match="oak: no layer 'dance'; nothing has changed at maple, oak, willow"):
        everybody.write_layer("dance", np.full(len(P), 0.5), mask, SECOND)
    with pytest.raises(ParameterError, match="oak: no layer 'dance'"):
        everybody.release_layer("dance")
    assert not any(states[k].mixer["dance"].holding for k in (0, 2))
    everybody.write_layer("capture", np.full(len(P), 0.5), mask, SECOND)
    assert all(state.mixer["capture"].holding for state in states)


def test_a_stop_for_one_head_stops_all() -> None:
    states = hall()
    assert say(LineSession(states[0], 0), "@oak STOP") == "OK STOP"
    assert all(state.stop_latch.stopped is not None for state in states)


def test_a_stream_stays_with_its_head() -> None:
    states = hall()
    session = LineSession(states[0], 0)
    states[1].set_parameters([JAW], [0.8], 1)
    out = P.neutral()
    for k in range(1, 100):
        states[1].tick(SECOND + k * 10**7, 0.01, out)
    say(session, "@oak SUB 10 jawOpen", 0)
    say(session, "SET jawOpen 0.1")
    assert "jawOpen=0.8" in session.stream(2 * SECOND).decode()


def test_json_messages_say_whom_they_are_for() -> None:
    states = hall()
    talk = Conversation(states[0], "test", 0)
    talk.handle('{"type": "set", "to": "oak", "parameters": {"jawOpen": 0.6}}', SECOND)
    talk.handle('{"type": "set", "parameters": {"jawOpen": 0.2}}', SECOND)
    assert held(states) == [0.2, 0.6, None]
    refused = talk.handle('{"type": "get", "to": "all"}', SECOND)
    assert getattr(refused, "type", "") == "error" and "several heads" in refused.message  # type: ignore[union-attr]
    state = talk.handle('{"type": "get", "to": "oak"}', SECOND)
    assert state.status["head"] == "oak"  # type: ignore[union-attr]


@pytest.mark.parametrize("yaw", [0.0, 35.0, -80.0, 180.0])
def test_a_point_of_the_room_comes_back_from_the_axes_of_a_head(yaw: float) -> None:
    place, point = Placement((100.0, -20.0, 300.0), yaw), (400.0, 200.0, 900.0)
    np.testing.assert_allclose(place.to_room(place.to_head(point)), point, atol=1e-9)
    ahead = place.to_room((0.0, 0.0, 1000.0))
    turned = math.degrees(math.atan2(ahead[0] - 100.0, ahead[2] - 300.0))
    assert math.isclose(math.cos(math.radians(turned - yaw)), 1.0, abs_tol=1e-12)


def lines_of_sight(states: list[CommandState]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Where each head is in the room, and the direction of its gaze there."""
    found = []
    for state in states:
        yaw, pitch = (math.radians(float(x)) for x in str(state.status()["gaze"]).split(","))
        own = (math.sin(yaw) * math.cos(pitch), -math.sin(pitch), math.cos(yaw) * math.cos(pitch))
        here = np.array(state.placement.position_mm)
        found.append((here, np.array(state.placement.to_room(own)) - here))
    return found


def test_all_heads_look_at_the_same_point_from_where_they_stand() -> None:
    states = hall()
    states[2].placement = Placement((600.0, 100.0, 200.0), -30.0)
    point = np.array([150.0, 80.0, 1200.0])
    say(LineSession(states[0], 0), "@all GAZE ROOM 150 80 1200")
    for here, direction in lines_of_sight(states):
        away = np.linalg.norm(np.cross(point - here, direction)) / np.linalg.norm(direction)
        assert away < 5.0  # mm: the middle of two eyes, and status rounds to 0.1 degrees


def test_who_has_the_turn_speaks_and_the_others_listen_and_look_at_it() -> None:
    states = hall()
    session = LineSession(states[0], 0)
    states[1].live(1.0, 1, "alone")
    assert say(session, "TURN oak") == "OK TURN oak"
    assert [state.manner for state in states] == ["listen", "speak", "listen"]
    gazes = [str(state.status()["gaze"]) for state in states]
    assert gazes[1] == "off" and gazes[0].startswith("90") and gazes[2].startswith("-90")
    assert states[0].status()["turn"] == "oak"
    say(session, "TURN maple")
    assert [state.manner for state in states] == ["speak", "listen", "listen"]
    say(session, "TURN OFF")
    assert [state.manner for state in states] == ["auto", "alone", "auto"]
    assert {state.status()["gaze"] for state in states} == {"off"}


def test_whoever_begins_to_speak_gets_the_turn_and_keeps_it_through_short_pauses() -> None:
    states = hall(auto=True)
    turns = states[0].heads.turns
    assert isinstance(turns, Turns)
    states[2].viseme(["aa"], [1.0], SECOND)
    turns.tick(SECOND)
    assert turns.speaker == "willow" and states[0].manner == "listen"
    states[0].viseme(["aa"], [1.0], SECOND)
    turns.tick(SECOND + 10**8)
    assert turns.speaker == "willow"  # who interrupts has to wait
    states[2].release_layer("speech")
    turns.tick(SECOND + 5 * 10**8)
    assert turns.speaker == "willow"
    turns.tick(SECOND + 9 * 10**8)
    assert turns.speaker == "maple" and states[2].manner == "listen"


def test_who_speaks_while_the_turn_is_taken_from_everybody_has_to_pause_first() -> None:
    states = hall(auto=True)
    turns = states[0].heads.turns
    assert isinstance(turns, Turns)
    states[2].viseme(["aa"], [1.0], SECOND)
    turns.tick(SECOND)
    turns.give(None, SECOND)
    turns.tick(SECOND + 10**8)
    assert turns.speaker is None and states[0].manner == "auto"
    states[2].release_layer("speech")
    turns.tick(2 * SECOND)
    states[2].viseme(["aa"], [1.0], 2 * SECOND)
    turns.tick(2 * SECOND + 10**7)
    assert turns.speaker == "willow"


def test_groups_look_and_nobody_looks_at_itself() -> None:
    states = hall()
    session = LineSession(states[0], 0)
    assert say(session, "@all GAZE HEAD maple") == "OK GAZE maple"
    assert states[0].status()["gaze"] == "off" and states[1].status()["gaze"] != "off"
    assert say(session, "GAZE HEAD maple").startswith("ERR ")
    with pytest.raises(ParameterError, match="no head called"):
        states[1].gaze_head("nobody", SECOND)
