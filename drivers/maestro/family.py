"""Definition of the family of Pololu Maestro boards and its options."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.options import option
from drivers.core.families import Family, PulseSettings


@dataclass(frozen=True, kw_only=True)
class MaestroSettings(PulseSettings):
    """Options of the Maestro driver."""

    board: str | None = option('"micro" is the one with 6 channels.', choices=("mini", "micro"))
    device: int | None = option("Device number, for the Pololu protocol.", at_least=0, at_most=127)
    crc: bool | None = option("End every command with a CRC-7.")


FAMILY = Family(
    api=1,
    kind="maestro",
    title="Pololu Maestro boards",
    driver="drivers.maestro.bus:MaestroBus",
    settings=MaestroSettings,
    check_model="drivers.boards.hobby:check_hobby",
    simulator="drivers.sim.boards.maestro:SIMULATOR",
    hobby=True,
    install="pyserial",
)
