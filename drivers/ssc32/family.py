"""Definition of the family of Lynxmotion SSC-32 boards."""

from __future__ import annotations

from drivers.core.families import Family, PulseSettings

FAMILY = Family(
    api=1,
    kind="ssc32",
    title="Lynxmotion SSC-32 boards",
    driver="drivers.ssc32.bus:Ssc32Bus",
    settings=PulseSettings,
    check_model="drivers.boards.hobby:check_hobby",
    simulator="drivers.sim.boards.ssc32:SIMULATOR",
    hobby=True,
    install="pyserial",
)
