"""Defines the kind of link that serves WebSocket clients."""

from __future__ import annotations

from dataclasses import dataclass, field

from controller.links.access import check_reach, host_and_port, is_loopback
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
        check_reach(self.where[0], self.token, open_to_network=self.open_to_network)

    @property
    def where(self) -> tuple[str, int]:
        """Host and port. Raises ValueError: it is no address."""
        return host_and_port(self.listen, PORT)

    @property
    def needs_token(self) -> bool:
        """Whether clients have to know a token."""
        return self.token is not None or not is_loopback(self.where[0])

    @property
    def address(self) -> str:
        """Where the link listens."""
        return self.listen


LINK = LinkKind(
    api=1,
    kind="websocket",
    title="JSON messages over WebSockets",
    settings=WebSocketSettings,
    open="controller.links.websocket.server:open_websocket",
    install="omote[web]",
)
