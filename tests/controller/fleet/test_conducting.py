"""controller.fleet.conducting: what Zenoh's threads bring at once does not mix."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.conducting import Conducting
from controller.fleet.lease import Lease
from controller.fleet.payload import Payloads
from controller.layers.commands import CommandState
from controller.links.line.protocol import LineDecoder


class FakeWire:
    """Keeps the callbacks that are declared, by what they are for; nothing is sent."""

    session = SimpleNamespace(put=lambda *_, **__: None)

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Any], object]] = {}
        self.answered: dict[str, Callable[[Any], object]] = {}

    def key(self, head: str, what: str) -> str:
        return f"{head}/{what}"

    def hear(self, head: str, what: str, act: Callable[[Any], object]) -> None:
        self.heard[f"{head}/{what}"] = act

    def answer(self, head: str, what: str, act: Callable[[Any], object]) -> None:
        self.answered[f"{head}/{what}"] = act

    def outlet(self, head: str, what: str) -> None:
        return None

    def outlets(self, heads: Any, what: str) -> dict[str, None]:
        return dict.fromkeys(heads)


def message(text: bytes, replies: list[bytes]) -> Any:
    """A message, or a question that keeps its answer."""
    payload = SimpleNamespace(to_bytes=lambda: text)
    return SimpleNamespace(payload=payload, key_expr="", reply=lambda _, data: replies.append(data))


def test_a_stop_that_comes_in_the_middle_of_a_question_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands and questions of a head come in two threads: here one comes while the other's line is taken apart."""
    state, wire, replies = CommandState(P, seed=1), FakeWire(), list[bytes]()
    lease = Lease(1, 0.2, 0.0, 0.0)
    Conducting(wire, {"maple": state}, Payloads(P), lease, 0.2, Counter())  # type: ignore[arg-type]
    assert lease.tick(0.15) is False
    assert lease.tick(0.3)
    take, waiting = LineDecoder._take, [b"STOP"]

    def interrupted(decoder: LineDecoder, piece: bytes) -> None:
        take(decoder, piece)
        if waiting:
            wire.heard["maple/commands"](message(waiting.pop(), replies))

    monkeypatch.setattr(LineDecoder, "_take", interrupted)
    wire.answered["maple/commands"](message(b"GET jawOpen", replies))
    assert state.stop_latch.stopped is not None
    assert len(replies) == 1
    assert replies[0].startswith(b"OK"), "the question is answered as well"
