"""controller.fleet.conducting: what Zenoh's threads bring at once does not mix, and no message ends a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from controller.base.errors import LinkError
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


def conducting(heads: dict[str, CommandState], wire: FakeWire, lease: Lease) -> Conducting:
    return Conducting(wire, heads, Payloads(P), lease, 0.2, Counter())  # type: ignore[arg-type]


@pytest.mark.parametrize("fence", ["18446744073709551616", "18446744073709551615", "1e999", "1" + 400 * "0"])
def test_a_state_with_a_fence_that_no_header_holds_is_refused(fence: str) -> None:
    """Its successor's header could not be packed, which ended the conductor's run."""
    wire, lease = FakeWire(), Lease(1, 0.2, 0.0, 0.0)
    conductor = conducting({"maple": CommandState(P, seed=1)}, wire, lease)
    with pytest.raises(LinkError):
        wire.heard["_/state"](message(b'{"token": [' + fence.encode() + b", 5]}", []))
    assert not conductor.tick(150_000_000)
    assert conductor.tick(300_000_000)
    assert lease.token.fence == 1


def test_a_standby_obeys_nothing_but_stop() -> None:
    state, wire = CommandState(P, seed=1), FakeWire()
    conducting({"maple": state}, wire, Lease(1, 0.2, 0.0, 0.0))
    hear = wire.heard["maple/commands"]
    hear(message(b"SET jawOpen 0.5 STOP", []))
    hear(message(b"EXPR stop", []))
    assert state.stop_latch.stopped is None and not state.held()
    hear(message(b"SET jawOpen 0.5\n#3 STOP\nSET jawOpen 0.7\n", []))
    assert state.stop_latch.stopped is not None and not state.held()


def test_a_stop_that_comes_in_the_middle_of_a_question_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands and questions of a head come in two threads: here one comes while the other's line is taken apart."""
    state, wire, replies = CommandState(P, seed=1), FakeWire(), list[bytes]()
    lease = Lease(1, 0.2, 0.0, 0.0)
    conducting({"maple": state}, wire, lease)
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


def test_a_heartbeat_is_sent_five_times_a_lease_and_not_in_every_tick() -> None:
    wire, lease, sent = FakeWire(), Lease(1, 0.2, 0.0, 0.0), list[str]()
    wire.session = SimpleNamespace(put=lambda key, *_, **__: sent.append(key))
    conductor = conducting({}, wire, lease)
    ticks = [k * 5_000_000 for k in range(2_000, 2_200)]  # a second in steps of 5 ms, long after the start
    conducts = [conductor.tick(now_ns) for now_ns in ticks]
    heartbeats = [key for key in sent if key.endswith("lease")]
    assert any(conducts) and 10 <= len(heartbeats) <= 60
