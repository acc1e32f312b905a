"""Which of several sources counts, and what a link costs where nothing can be shown."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.layers.commands import CommandState
from controller.links.net.incoming import Incoming
from controller.links.net.kinds import link_of
from controller.links.net.receivers import Received
from controller.links.net.shown import GONE_S
from tests.controller.formats.faces import face
from tests.controller.links.net.sockets import wait_for


class Fed:
    """A receiver that is given what it receives."""

    error = ""

    def __init__(self) -> None:
        self.waiting: Received = []
        self.closed = False

    def receive(self, timeout_s: float) -> Received:
        if not self.waiting:
            time.sleep(0.005)
        found, self.waiting = self.waiting, []
        return found

    def close(self) -> None:
        self.closed = True


def opened(kind: str = "livelink", **keys: object) -> tuple[Fed, CommandState, Incoming]:
    fed, state = Fed(), CommandState(P)
    by = "tcp:" if "tcp" in FORMATS.get(kind).transports else ""
    settings = link_of(FORMATS.get(kind)).settings(listen=f"{by}127.0.0.1", **keys)
    incoming = Incoming(settings, fed, state, f"{kind} here")
    incoming.start()
    return fed, state, incoming


def test_a_second_source_is_heard_when_the_first_is_silent() -> None:
    fed, state, incoming = opened(timeout_s=0.3)
    encoder = FORMATS.get("livelink").encoder(P)
    first, second = (encoder.encode(face(seed, 1.0 + seed))[0] for seed in (1, 2))
    try:
        fed.waiting = [("10.0.0.1", first)]
        wait_for(lambda: incoming.report()["accepted"] == 1)
        fed.waiting = [("10.0.0.2", second)]
        wait_for(lambda: incoming.report()["refused"] == {"a second source while the first one sends": 1})
        time.sleep(0.35)
        fed.waiting = [("10.0.0.2", second)]
        wait_for(lambda: incoming.report()["accepted"] == 2)
        assert incoming.report()["sender"] == "10.0.0.2 omote"
        assert np.isfinite(state.mixer["capture"].values).all()
    finally:
        incoming.stop()
    assert fed.closed


def test_a_link_that_nobody_stops_does_not_keep_the_program_alive() -> None:
    _, _, incoming = opened()
    try:
        assert [each.daemon for each in threading.enumerate() if each.name == "link livelink here"] == [True]
    finally:
        incoming.stop()


def test_of_several_sources_at_once_the_first_counts() -> None:
    fed, _, incoming = opened(timeout_s=5.0)
    message = FORMATS.get("livelink").encoder(P).encode(face(1, 1.0))[0]
    try:
        for _ in range(20):
            fed.waiting = [("10.0.0.1", message), ("10.0.0.2", message)]
            wait_for(lambda: not fed.waiting)
        wait_for(lambda: incoming.report()["accepted"] == 20)
        assert incoming.report()["refused"] == {"a second source while the first one sends": 20}
    finally:
        incoming.stop()


def test_a_clock_that_differs_delays_nothing() -> None:
    """Times as those of a source after each three minutes of an hour, whose clock is 1 % fast, then set back."""
    fed, state, incoming = opened(timeout_s=5.0)
    encoder, jaw = FORMATS.get("livelink").encoder(P), P.index("jawOpen")
    times_s = [180.0 * n * 1.01 for n in range(21)] + [10.0]
    try:
        for n, time_s in enumerate(times_s):
            sent = replace(face(n, time_s), values=np.full(len(P), 0.01 * (n + 1)))
            fed.waiting = [("10.0.0.1", message) for message in encoder.encode(sent)]
            wait_for(lambda n=n: abs(state.mixer["capture"].values[jaw] - 0.01 * (n + 1)) < 1e-4)
        assert incoming.report()["accepted"] == len(times_s)
    finally:
        incoming.stop()


def test_a_stream_that_ends_gives_its_layer_back_and_the_next_one_counts_at_once() -> None:
    fed, state, incoming = opened("json")
    jaw, capture = P.index("jawOpen"), state.mixer["capture"]
    try:
        fed.waiting = [("127.0.0.1:1", b'{"jawOpen": 0.5}\n')]
        wait_for(lambda: capture.values[jaw] == 0.5)
        fed.waiting = [("127.0.0.1:1", b"")]
        wait_for(lambda: not fed.waiting)
        fed.waiting = [("127.0.0.1:2", b'{"jawOpen": 0.75}\n')]
        wait_for(lambda: capture.values[jaw] == 0.75)
        assert incoming.report()["refused"] == {}
        time.sleep(2 * GONE_S)
        assert capture.holding == 1
        fed.waiting = [("127.0.0.1:2", b"")]
        wait_for(lambda: not capture.holding)
    finally:
        incoming.stop()
