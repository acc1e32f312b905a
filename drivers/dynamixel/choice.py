"""Which driver Dynamixel servos need: one of either protocol, or both on one wire."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.base.bus import ServoSpec
from drivers.core.wirebus import WireBus
from drivers.dynamixel.bus import DynamixelBus
from drivers.tables.tables import load_table, model_number


def driver_for(servos: Sequence[ServoSpec]) -> type[WireBus]:
    """The driver for the servos' protocols; that of Protocol 1.0 is only loaded where there are any.

    Raises
    ------
    DriverError : unknown model.
    """
    protocols = {load_table(model_number(servo.model)).protocol for servo in servos}
    if 1 not in protocols:
        return DynamixelBus
    from drivers.dynamixel.legacy import LegacyBus  # start-up: few heads have servos of both protocols
    from drivers.dynamixel.mixed import MixedBus

    return LegacyBus if protocols == {1} else MixedBus
