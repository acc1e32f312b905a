"""Defines the link kind ``line``: the omote line protocol on a serial port or over TCP."""

from __future__ import annotations

from dataclasses import dataclass

from controller.links.access import check_reach, check_word, host_and_port
from controller.links.kind import LinkKind
from controller.links.line.checksums import CHECKSUMS
from drivers.base.options import option

SIMULATED = "simulated"
PORT = 9404


@dataclass(frozen=True, kw_only=True)
class LineSettings:
    """Options of the link in a stage file."""

    port: str | None = option("Device path; simulated starts a simulated robot host.")
    baud: int = option("Rate of the port.", 115_200, at_least=300, at_most=12_000_000)
    checksum: str = option(
        "When lines need a checksum: never, after the first line with a valid one, or always.",
        "latched",
        choices=CHECKSUMS,
    )
    script: str | None = option("What a simulated host plays: a name in configs/scripts, or a path.")
    listen: str | None = option("HOST:PORT at which clients connect by TCP, instead of a serial port.")
    token: str | None = option("Token that clients need, instead of the one that omote makes.", longest=128)
    open_to_network: bool = option("Allow others than programs on this machine to connect, with a token.", False)
    clients: int = option("How many clients may be connected by TCP.", 8, at_least=1, at_most=64)

    def check(self) -> None:
        """Raises ValueError: not exactly one of port and listen, a script without a simulated host, or an address that
        other machines reach without permission.
        """
        if (self.port is None) == (self.listen is None):
            raise ValueError(f'give port, as "/dev/ttyUSB0", or listen, as "127.0.0.1:{PORT}"')
        if self.listen is not None:
            check_reach(self.where[0], self.token, open_to_network=self.open_to_network)
            if self.token is not None:
                check_word(self.token)
        if self.script is not None and self.port != SIMULATED:
            raise ValueError('script needs port = "simulated"')

    @property
    def simulated(self) -> str | None:
        """The script that a simulated host plays; None if a real host is at the port."""
        return (self.script or "tour") if self.port == SIMULATED else None

    @property
    def where(self) -> tuple[str, int]:
        """Host and port of a link over TCP. Raises ValueError: ``listen`` is not an address."""
        return host_and_port(self.listen or "", PORT)

    @property
    def address(self) -> str:
        """The address or serial port at which the link listens."""
        return self.listen or self.port or ""


LINK = LinkKind(
    api=1,
    kind="line",
    title="the omote line protocol on a serial port or over TCP",
    settings=LineSettings,
    open="controller.links.line.opening:open_line",
    install="pyserial",
)
