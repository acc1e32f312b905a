"""Definition of the family of Feetech servos: options, driver and simulator."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.options import option
from drivers.core.families import SERVO_BAUD, Family, ServoSettings


@dataclass(frozen=True, kw_only=True)
class FeetechSettings(ServoSettings):
    """Options of the driver of Feetech servos."""

    torque_limit: float | None = option("Part of their torque that servos may use.", above=0, at_most=1)


FAMILY = Family(
    api=1,
    kind="feetech",
    title="Feetech STS, SMS and SCS servos",
    driver="drivers.feetech.bus:FeetechBus",
    settings=FeetechSettings,
    check_model="drivers.tables.models:check_feetech",
    cycle_bytes="drivers.tables.wire:cycle_bytes",
    simulator="drivers.sim.servos.simulators:FEETECH",
    baud=SERVO_BAUD,
    install="dynamixel-sdk pyserial",
)
