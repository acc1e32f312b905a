"""Definition of the family of Dynamixel servos: options, simulator, and the driver for each protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.base.options import option
from drivers.core.families import SERVO_BAUD, Family, ServoSettings

if TYPE_CHECKING:
    from drivers.base.bus import ServoSpec
    from drivers.core.wirebus import WireBus


@dataclass(frozen=True, kw_only=True)
class DynamixelSettings(ServoSettings):
    """Options of the driver of Dynamixel servos."""

    fast: bool | None = option("Use fast reads where every servo has them.")


def driver_for(servos: Sequence[ServoSpec]) -> type[WireBus]:
    """The driver for the servos' protocols; only what they need is loaded. Raises DriverError: unknown model."""
    from drivers.tables.tables import load_table  # imported lazily: families are listed without their drivers

    protocols = {load_table(servo.model).protocol for servo in servos}
    if 1 not in protocols:
        from drivers.dynamixel.bus import DynamixelBus  # imported lazily, as above

        return DynamixelBus
    from drivers.dynamixel.legacy import LegacyBus  # imported lazily, as above
    from drivers.dynamixel.mixed import MixedBus  # imported lazily, as above

    return LegacyBus if protocols == {1} else MixedBus


FAMILY = Family(
    api=1,
    kind="dynamixel",
    title="Dynamixel servos, Protocol 2.0 and 1.0",
    driver="drivers.dynamixel.family:driver_for",
    settings=DynamixelSettings,
    check_model="drivers.tables.models:check_dynamixel",
    cycle_bytes="drivers.tables.wire:cycle_bytes",
    simulator="drivers.sim.servos.simulators:DYNAMIXEL",
    baud=SERVO_BAUD,
    install="dynamixel-sdk pyserial",
)
