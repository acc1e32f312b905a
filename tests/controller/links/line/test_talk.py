"""A talk in the line protocol, without any wire."""

from __future__ import annotations

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.line import talk as module
from controller.links.line.session import LineSession
from controller.links.line.talk import Talk


class Wire:
    """Takes what is sent, at most ``room`` bytes of it."""

    def __init__(self, room: int = 1 << 20) -> None:
        self.room, self.sent = room, b""

    def put(self, data: bytes) -> int:
        taken = data[: self.room]
        self.room -= len(taken)
        self.sent += taken
        return len(taken)


@pytest.fixture
def state() -> CommandState:
    return CommandState(P)


@pytest.fixture
def talk(state: CommandState) -> Talk:
    return Talk(LineSession(state, 0))


def test_answers_go_out_and_are_counted(talk: Talk) -> None:
    wire = Wire()
    talk.serve(b"PING a\nPING b\n", wire.put)
    assert wire.sent == b"OK PONG a\nOK PONG b\n"
    assert talk.counts == {"bytes_in": 14, "bytes_out": 20, "streamed": 0, "dropped": 0}
    assert talk.meter.frames == 2 and not talk.busy and talk.wait_s(0.5) == 0.5


def test_what_finds_no_room_waits_and_is_lost_with_the_wire(talk: Talk) -> None:
    wire = Wire(room=4)
    talk.serve(b"PING\nPING\nPI", wire.put)
    assert wire.sent == b"OK P"
    wire.room = 100
    talk.serve(b"NG\n", wire.put)
    assert wire.sent == b"OK PONG\n" * 3
    wire.room = 0
    talk.serve(b"PING\nPI", wire.put)
    talk.lose()
    assert talk.session.unanswered == 1
    wire.room = 100
    talk.serve(b"PING\n", wire.put)
    assert wire.sent == b"OK PONG\n" * 4


def test_lines_may_wait_for_the_next_turn_and_a_stop_among_them_does_not(talk: Talk, state: CommandState) -> None:
    wire = Wire()
    talk.serve(b"PING\n" * 3 + b"STOP\n", wire.put, longest_s=0.0)
    assert wire.sent == b"OK PONG\n" and talk.busy and talk.wait_s(1.0) == 0.0
    assert state.stop_latch.stopped is not None
    for _ in range(4):
        talk.serve(b"", wire.put, longest_s=0.0)
    assert wire.sent == b"OK PONG\n" * 3 + b"OK STOP\n" and not talk.busy


def test_a_stream_is_due_now_and_then(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    wire = Wire()
    monkeypatch.setattr(module.time, "monotonic_ns", lambda: 10**9)
    talk.serve(b"SUB 10 jawOpen\n", wire.put)
    assert wire.sent == b"OK SUB 10 1\nP 1000 jawOpen=0\n" and talk.wait_s(1.0) == pytest.approx(0.1)
    talk.serve(b"", wire.put)
    assert talk.counts["streamed"] == 1
