"""Defines the kind of link that speaks the omote line protocol on a serial port."""

from __future__ import annotations

from dataclasses import dataclass

from controller.links.kind import LinkKind
from controller.links.line.checksums import CHECKSUMS
from drivers.base.options import REQUIRED, option

SIMULATED = "simulated"


@dataclass(frozen=True, kw_only=True)
class LineSettings:
    """Its options in a stage."""

    port: str = option("Device path; simulated starts a simulated robot host.", REQUIRED)
    baud: int = option("Rate of the port.", 115_200, at_least=300, at_most=12_000_000)
    checksum: str = option(
        "When lines must have one: never, once a line had a valid one, or always.", "latched", choices=CHECKSUMS
    )
    script: str | None = option("What a simulated host plays: a name in configs/scripts, or a path.")

    def check(self) -> None:
        """Raises ValueError for a script without a simulated host."""
        if self.script is not None and self.port != SIMULATED:
            raise ValueError('script needs port = "simulated"')

    @property
    def simulated(self) -> str | None:
        """The script that a simulated host plays; None where a real one is at the port."""
        return (self.script or "tour") if self.port == SIMULATED else None

    @property
    def address(self) -> str:
        """Where the link listens."""
        return self.port


LINK = LinkKind(
    api=1,
    kind="line",
    title="the omote line protocol on a serial port",
    settings=LineSettings,
    open="controller.links.line.opening:open_line",
    install="pyserial",
)
