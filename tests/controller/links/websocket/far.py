"""A face that a WebSocket link serves, for tests."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links, read_link
from drivers.base.shutdown import Closers


@contextmanager
def served(state: CommandState | None = None, **keys: Any) -> Iterator[tuple[CommandState, Any, str]]:
    """The face, its link, and the URL at which it listens: a free port of loopback."""
    state, closers = state or CommandState(PARAMETERS), Closers()
    try:
        (link,) = open_links(
            [read_link({"kind": "websocket", "listen": "127.0.0.1:0", **keys})], LinkContext(state, closers)
        )
        yield state, link, f"ws://127.0.0.1:{link.port}"
    finally:
        with suppress(Exception):
            closers.close()


def tick(state: CommandState, seconds: float = 1.0, now_ns: int = 0) -> None:
    """Let the face move on."""
    now_ns = now_ns or time.monotonic_ns()
    out = state.parameters.neutral()
    for step in range(round(seconds / 0.01)):
        state.tick(now_ns + step * 10_000_000, 0.01, out)
