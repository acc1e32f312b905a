"""The family of Dynamixel servos."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.base.options import option
from drivers.core.families import SERVO_BAUD, Family, ServoSettings


@dataclass(frozen=True, kw_only=True)
class DynamixelSettings(ServoSettings):
    """What the driver of Dynamixel servos can be told."""

    fast: bool | None = option("Use fast reads where every servo has them.")


FAMILY = Family(
    api=1,
    kind="dynamixel",
    title="Dynamixel servos, Protocol 2.0 and 1.0",
    driver="drivers.dynamixel.choice:driver_for",
    settings=DynamixelSettings,
    check_model="drivers.tables.tables:check_dynamixel",
    simulator="drivers.sim.servos.simulators:DYNAMIXEL",
    baud=SERVO_BAUD,
    install="dynamixel-sdk pyserial",
)
