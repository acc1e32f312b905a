"""The fuzzer of messages: a short run of every format finds nothing, and it would find what it looks for."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from controller.base.parameters import Parameters
from controller.formats.format import FORMATS
from controller.formats.frame import Frame, Refusals
from tests.controller.formats.faces import KINDS
from tests.fuzz import requests
from tests.fuzz.messages import LONGEST_S, attack


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_short_run_finds_no_fault(kind: str) -> None:
    found = attack(FORMATS.get(kind), 1500, seed=5)
    assert not found.faults, found.first
    assert found.messages == 1500 and found.frames >= 3


class Fragile:
    """A decoder that raises for what it does not expect, and does not go on after it."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused, self._inner = Refusals(), FORMATS.get("livelink").decoder(parameters)

    def feed(self, message: bytes) -> list[Frame]:
        frames = self._inner.feed(message)
        if not frames:
            raise ValueError("what is this?")
        return frames


def test_what_raises_is_found() -> None:
    found = attack(replace(FORMATS.get("livelink"), decoder=Fragile), 300, seed=1)
    assert found.faults["livelink: ValueError: what is this?"] > 50 and "what is this" in str(found)


class Slow(Fragile):
    """A decoder that is slow for the first ``left`` messages."""

    left = 0

    def feed(self, message: bytes) -> list[Frame]:
        end_s = time.thread_time() + 1.2 * LONGEST_S * (Slow.left > 0)
        Slow.left -= 1
        while time.thread_time() < end_s:
            pass
        return self._inner.feed(message)


@pytest.mark.parametrize(("times", "is_found"), [(1, False), (4, True)])
def test_a_message_is_slow_that_is_so_each_time(times: int, is_found: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Slow, "left", times)
    found = attack(replace(FORMATS.get("livelink"), decoder=Slow), 1, seed=1)
    assert (found.slowest_s > LONGEST_S) is is_found


def test_a_short_run_of_websocket_requests_finds_no_fault() -> None:
    found = requests.attack(1500, seed=5)
    assert not found.faults, found.first
    assert found.messages == 1500 and found.frames > 100


def test_what_raises_in_a_conversation_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests.Conversation, "_refuse", lambda *_: 1 / 0)
    found = requests.attack(300, seed=1)
    assert found.faults["ZeroDivisionError: division by zero"] > 50
