"""Messages and declarations that stand in for those of Zenoh; real ones are in test_node.py and test_processes.py."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from controller.fleet.payload import Header


class Bytes(bytes):
    """Bytes as a message of Zenoh has them."""

    def to_bytes(self) -> bytes:  # type: ignore[override]
        """The bytes."""
        return bytes(self)


class Sample:
    """A message that arrived; ``header`` : attached to it, None for a message of nobody."""

    def __init__(self, header: Header | None, payload: bytes, encoding: str) -> None:
        self.attachment = None if header is None else Bytes(header.encode())
        self.payload, self.encoding = Bytes(payload), encoding


class Outlet:
    """A publisher. matching_status : whether somebody is known to listen. sent : what was put, and its encoding."""

    def __init__(self, listens: bool = True) -> None:
        self.matching_status = listens
        self.sent: list[tuple[Any, str | None]] = []

    def put(self, data: Any, encoding: str | None = None) -> None:
        """Keep what is sent."""
        self.sent.append((data, encoding))


class Query:
    """A question; ``replies`` : key, payload and encoding of every answer."""

    def __init__(self, key: str = "asked/key") -> None:
        self.key_expr = key
        self.replies: list[tuple[str, str, str]] = []

    def reply(self, key: str, payload: str, encoding: str) -> None:
        """Keep an answer."""
        self.replies.append((key, payload, encoding))


class Session:
    """A session with the number 7. sent : what was put, by key."""

    def __init__(self) -> None:
        self.sent: dict[str, list[str]] = {}

    def zid(self) -> str:
        """Its number."""
        return "7"

    def put(self, key: str, data: str) -> None:
        """Keep what is sent."""
        self.sent.setdefault(key, []).append(data)


class Wire:
    """Keeps what is declared. heard, answered : what is called, by head and name. alive : tokens."""

    def __init__(self, listens: bool = True) -> None:
        self.session, self._listens = Session(), listens
        self.heard: dict[tuple[str, str], Callable[[Any], object]] = {}
        self.answered: dict[tuple[str, str], Callable[[Any], object]] = {}
        self.outlets_of: dict[tuple[str, str], Outlet] = {}
        self.alive: list[tuple[str, str]] = []

    def key(self, head: str, what: str) -> str:
        """A key."""
        return f"omote/{head}/{what}"

    def hear(self, head: str, what: str, act: Callable[[Any], object], *, direct: bool = False) -> None:
        """Declare a subscriber, which must be direct: waking another thread costs more than a face."""
        assert direct
        self.heard[head, what] = act

    def answer(self, head: str, what: str, act: Callable[[Any], object]) -> None:
        """Declare a queryable."""
        self.answered[head, what] = act

    def live(self, head: str, what: str) -> None:
        """Declare a token."""
        self.alive.append((head, what))

    def outlets(self, heads: Any, what: str) -> dict[str, Outlet]:
        """Declare publishers."""
        made = {name: Outlet(self._listens) for name in heads}
        self.outlets_of |= {(name, what): outlet for name, outlet in made.items()}
        return made
