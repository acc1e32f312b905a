"""Definition of the family of heads that take the omote line protocol, and its options."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.options import option
from drivers.core.families import AnySettings, Family


@dataclass(frozen=True, kw_only=True)
class LineSettings(AnySettings):
    """Options of the driver of such a head."""

    checksum: bool | None = option("End every line with a checksum.")
    heartbeat_s: float | None = option("All values are sent again after this time (s).", above=0, at_most=10)


FAMILY = Family(
    api=1,
    kind="omote",
    title="heads that take the omote line protocol",
    driver="drivers.omote.bus:LineOutBus",
    settings=LineSettings,
    check_model="drivers.omote.bus:check_lineout",
    simulator="drivers.sim.boards.linehead:SIMULATOR",
    hobby=True,
    install="pyserial",
)
