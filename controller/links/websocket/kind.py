"""Defines the link kind ``websocket``, which serves WebSocket clients."""

from __future__ import annotations

from dataclasses import dataclass, field

from controller.links.access import check_reach, host_and_port, is_loopback
from controller.links.kind import LinkKind
from drivers.base.options import Option, option

PORT = 8765


@dataclass(frozen=True, kw_only=True)
class WebSocketSettings:
    """Options of the link in a stage file."""

    listen: str = option("HOST:PORT at which clients connect.", f"127.0.0.1:{PORT}")
    token: str | None = option("Token that clients need, instead of the one that omote makes.", longest=128)
    open_to_network: bool = option("Allow others than programs on this machine to connect, with a token.", False)
    origins: list[str] = field(
        default_factory=list,
        metadata={"option": Option(help="Web pages from elsewhere that may connect, as https://example.org.")},
    )
    clients: int = option("How many clients may be connected.", 16, at_least=1, at_most=256)

    def check(self) -> None:
        """Raises ValueError: no address, one that others reach without permission, or an easily guessed token."""
        check_reach(self.where[0], self.token, open_to_network=self.open_to_network)

    @property
    def where(self) -> tuple[str, int]:
        """Host and port of the link. Raises ValueError: ``listen`` is not an address."""
        return host_and_port(self.listen, PORT)

    @property
    def needs_token(self) -> bool:
        """Whether clients need a token."""
        return self.token is not None or not is_loopback(self.where[0])

    @property
    def address(self) -> str:
        """The address at which the link listens."""
        return self.listen


LINK = LinkKind(
    api=1,
    kind="websocket",
    title="JSON messages over WebSockets",
    settings=WebSocketSettings,
    open="controller.links.websocket.server:open_websocket",
    install="omote[web]",
)
