"""Defines the kind of link that serves WebSocket clients."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass, field

from controller.links.kind import LinkKind
from drivers.base.options import Option, option

PORT = 8765


@dataclass(frozen=True, kw_only=True)
class WebSocketSettings:
    """Its options in a stage."""

    listen: str = option("HOST:PORT at which clients connect.", f"127.0.0.1:{PORT}")
    token: str | None = option("What clients must know, instead of the token that omote makes.", longest=128)
    open_to_network: bool = option("Allow others than programs on this machine to connect, with a token.", False)
    origins: list[str] = field(
        default_factory=list,
        metadata={"option": Option(help="Web pages from elsewhere that may connect, as https://example.org.")},
    )
    clients: int = option("How many clients may be connected.", 16, at_least=1, at_most=256)

    def check(self) -> None:
        """Raises ValueError: no address, or one that others reach without leave, or a token that is easily guessed."""
        host, _ = self.where
        if not _is_loopback(host) and not self.open_to_network:
            raise ValueError(
                f"listen: at {host} every machine that reaches this one could try to connect; "
                "open_to_network = true allows it, with a token"
            )
        if self.token is not None and len(self.token) < SHORTEST_TOKEN:
            raise ValueError(f"token: needs at least {SHORTEST_TOKEN} characters")

    @property
    def where(self) -> tuple[str, int]:
        """Host and port. Raises ValueError: it is no address."""
        host, colon, port = self.listen.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 65_535:
            raise ValueError(f'listen: {self.listen!r} is no address; write it as "127.0.0.1:{PORT}"')
        return host, int(port)

    @property
    def needs_token(self) -> bool:
        """Whether clients have to know a token."""
        return self.token is not None or not _is_loopback(self.where[0])

    @property
    def address(self) -> str:
        """Where the link listens."""
        return self.listen


SHORTEST_TOKEN = 12
"""Characters of a token of one's own."""


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


LINK = LinkKind(
    api=1,
    kind="websocket",
    title="JSON messages over WebSockets",
    settings=WebSocketSettings,
    open="controller.links.websocket.server:open_websocket",
    install="omote[web]",
)
