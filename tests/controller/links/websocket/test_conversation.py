"""controller.links.websocket.conversation: each message does what it says, or is refused with a reason."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.websocket.conversation import Conversation
from controller.links.websocket.messages import MAX_RATE_HZ

MS = 1_000_000


class Client:
    """A conversation with a face in virtual time."""

    def __init__(self) -> None:
        self.state = CommandState(P)
        self.state.live(0.0, 0)
        self.now_ns = 1_000 * MS
        self.talk = Conversation(self.state, "websocket test", self.now_ns)
        self.out = P.neutral()

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        return self.send({"type": kind, "id": 7, **fields})

    def send(self, message: Any) -> dict[str, Any]:
        text = message if isinstance(message, str | bytes) else json.dumps(message)
        reply = self.talk.handle(text, self.now_ns)
        return json.loads(reply.model_dump_json()) if reply is not None else {}

    def settle(self, seconds: float = 2.0) -> None:
        for _ in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            self.state.tick(self.now_ns, 0.01, self.out)

    def shown(self, name: str) -> float:
        return float(self.out[P.index(name)])


@pytest.fixture
def client() -> Client:
    return Client()


def test_parameters_are_held_until_they_are_released(client: Client) -> None:
    assert client.ask("set", parameters={"jawOpen": 0.5, "eyeBlink_L": 1.0}) == {"id": 7, "type": "ok"}
    client.settle()
    assert (client.shown("jawOpen"), client.shown("eyeBlinkLeft")) == pytest.approx((0.5, 1.0), abs=1e-3)
    client.ask("release", parameters=["jawOpen"])
    client.settle()
    assert (client.shown("jawOpen"), client.shown("eyeBlinkLeft")) == pytest.approx((0.0, 1.0), abs=1e-3)
    client.ask("release")
    client.settle()
    assert client.shown("eyeBlinkLeft") == pytest.approx(0.0, abs=1e-3)


def test_the_state_has_what_is_shown(client: Client) -> None:
    client.ask("set", parameters={"jawOpen": 0.5})
    client.settle()
    state = client.ask("get")
    assert state["id"] == 7 and state["parameters"]["jawOpen"] == pytest.approx(0.5, abs=1e-3)
    assert len(state["parameters"]) == len(P) and state["measured"] is None and state["stopped_by"] is None
    assert state["status"]["expression"] == "neutral" and state["time_s"] == pytest.approx(2.0)
    assert list(client.ask("get", parameters=["jawOpen"])["parameters"]) == ["jawOpen"]


def test_expressions_moods_and_neutral(client: Client) -> None:
    client.ask("expression", name="happiness", intensity=1.0)
    client.settle()
    assert client.shown("mouthSmileLeft") > 0.4
    client.ask("emotion", valence=-0.6, arousal=-0.3)
    client.settle()
    assert client.shown("mouthSmileLeft") < 0.1
    client.ask("expression", name="AU12", intensity=0.5)
    client.settle()
    assert client.shown("mouthSmileLeft") > 0.1
    client.ask("neutral", seconds=0.2)
    client.settle()
    assert abs(client.out).max() < 1e-3


def test_gaze_in_degrees_at_a_point_and_off(client: Client) -> None:
    client.ask("gaze", yaw_deg=20, pitch_deg=-10)
    assert client.ask("get")["status"]["gaze"] == "20.0,-10.0"
    client.ask("gaze_at", point_mm=[0, 0, 500])
    assert client.ask("get")["status"]["gaze"] == "0.0,0.0"
    client.ask("gaze_off")
    assert client.ask("get")["status"]["gaze"] == "off"


def test_stop_and_start_and_who_stopped(client: Client) -> None:
    client.ask("stop")
    assert client.state.stop_latch.stopped is not None
    assert client.ask("get")["stopped_by"] == "websocket test"
    client.ask("start")
    assert client.state.stop_latch.stopped is None


def test_life_and_manner(client: Client) -> None:
    client.ask("life", amount=0.7, manner="listen")
    client.settle(0.1)
    status = client.ask("get")["status"]
    assert (status["life"], status["manner"]) == (0.7, "listen")


def test_who_is_there(client: Client) -> None:
    hello = client.ask("hello", name="trial")
    assert hello["version"] == 1 and list(hello["parameters"]) == list(P.names)
    yaw = hello["parameters"]["headYaw"]
    i = P.index("headYaw")
    assert (yaw["low"], yaw["high"], yaw["region"]) == (-1.0, 1.0, "head")
    assert yaw["full_scale_deg"] == pytest.approx(math.degrees(P.full_scale_rad[i]), abs=1e-3)
    assert "happiness" in hello["expressions"] and "manual" in hello["layers"]
    assert client.ask("hello", version=2)["code"] == "name"
    assert client.ask("list", what="layers")["names"] == list(client.state.layer_names())
    assert client.ask("list", what="shows")["names"] == []


def test_states_come_at_their_rate_and_missed_ones_are_left_out(client: Client) -> None:
    assert client.talk.due_ns() is None
    client.ask("subscribe", rate_hz=50, parameters=["jawOpen"])
    seen = []
    for _ in range(100):
        client.now_ns += 5 * MS
        state = client.talk.state_due(client.now_ns)
        if state is not None:
            seen.append(state.time_s)
    assert len(seen) == 26 and state is not None and list(state.parameters) == ["jawOpen"]
    client.now_ns += 5_000 * MS
    assert client.talk.state_due(client.now_ns) is not None
    assert client.talk.state_due(client.now_ns) is None
    client.ask("unsubscribe")
    assert client.talk.due_ns() is None


def test_a_frame_has_the_breath_and_pupils_of_the_picture(client: Client) -> None:
    client.ask("subscribe", rate_hz=100, form="numbers")
    frame = client.talk.state_due(client.now_ns)
    assert frame is not None and json.loads(frame.model_dump_json())["life"] == [0.0, 0.0]
    client.ask("life", amount=1.0)
    seen = []
    for _ in range(600):
        client.settle(0.01)
        frame = client.talk.state_due(client.now_ns)
        assert frame is not None and len(frame.values) == len(P)  # type: ignore[union-attr]
        rise_mm, pupil = frame.life  # type: ignore[union-attr]
        assert (rise_mm, pupil) == pytest.approx(client.state.beside, abs=1e-3)
        seen.append((rise_mm, pupil))
    rises, pupils = zip(*seen, strict=True)
    assert min(rises) == 0.0 and max(rises) == pytest.approx(3.0, abs=0.01) and max(pupils) - min(pupils) > 0.03


def test_only_who_asks_is_answered(client: Client) -> None:
    assert client.send({"type": "set", "parameters": {"jawOpen": 0.1}}) == {}
    assert client.send({"type": "ping"})["type"] == "ok"
    assert client.send({"type": "get"})["type"] == "state"
    assert client.talk.accepted == 3


@pytest.mark.parametrize(
    ("message", "code", "part"),
    [
        ("", "message", "JSON"),
        ("{", "message", "JSON"),
        (b"\xff\xfe", "message", "JSON"),
        ("[1]", "message", "a message must be an object"),
        ("null", "message", "a message must be an object"),
        ({"no": "type"}, "message", "type: missing"),
        ({"type": "dance"}, "message", "unknown message 'dance', there are hello, set"),
        ({"type": "sett"}, "message", "unknown message 'sett', did you mean 'set'"),
        ({"type": "set"}, "message", "set.parameters: missing"),
        ({"type": "set", "parameters": {}}, "message", "parameters"),
        ({"type": "set", "parameters": {"jawOpn": 1}}, "name", "did you mean"),
        ({"type": "set", "parameters": {"jawOpen": 1.5}}, "name", "must be 0 to 1"),
        ({"type": "set", "parameters": {"jawOpen": 0.1, "JawOpen": 0.2}}, "name", "named twice"),
        ('{"type": "set", "parameters": {"jawOpen": NaN}}', "message", "finite"),
        ('{"type": "set", "parameters": {"jawOpen": 1e999}}', "message", "finite"),
        ({"type": "set", "parameters": {"jawOpen": 0.5}, "layer": "x"}, "message", "set.layer: unknown key"),
        ({"type": "expression", "name": "smug", "intensity": 2}, "message", "intensity"),
        ({"type": "expression", "name": "smyle"}, "name", "did you mean"),
        ({"type": "gaze", "yaw_deg": 120, "pitch_deg": 0}, "message", "yaw_deg"),
        ({"type": "gaze_at", "point_mm": [0, 0, 0]}, "name", "at least 1 mm"),
        ({"type": "subscribe", "rate_hz": 2 * MAX_RATE_HZ}, "message", "rate_hz"),
        ({"type": "show", "name": "tour"}, "name", "no shows"),
        ({"type": "life", "amount": 0.5, "manner": "wild"}, "message", "manner"),
        ({"type": "set", "id": "x" * 65, "parameters": {"jawOpen": 0.5}}, "message", "id"),
        ('{"type": "set", "parameters": ' + "[" * 5000 + "]" * 5000 + "}", "message", ""),
    ],
)
def test_what_is_wrong_is_refused_with_its_reason_and_changes_nothing(
    client: Client, message: Any, code: str, part: str
) -> None:
    reply = client.send(message)
    assert (reply["type"], reply["code"]) == ("error", code)
    assert part in reply["message"] and len(reply["message"]) < 500
    client.settle(0.5)
    assert abs(client.out).max() < 1e-6
    assert client.talk.refused == {code: 1} and client.talk.accepted == 0


@pytest.mark.parametrize("given", [7, "seven"])
def test_a_message_that_is_wrong_is_answered_with_its_id(client: Client, given: int | str) -> None:
    assert client.send({"type": "sett", "id": given})["id"] == given
    assert client.send({"type": "set", "id": given, "parameters": {"jawOpn": 1}})["id"] == given
    assert client.send({"type": "sett", "id": "x" * 65})["id"] is None
    assert client.send({"type": "sett", "id": True})["id"] is None
