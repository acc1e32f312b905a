"""Bytes to motors and back: servo buses, and simulated ones that keep the same contract.

Drivers are imported when they are asked for, so a missing vendor package never breaks anything else.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from drivers.errors import DriverError

if TYPE_CHECKING:
    from drivers.bus import Bus, ServoSpec

KINDS = {
    "dynamixel": ("drivers.dynamixel.bus", "DynamixelBus"),
    "simulated": ("drivers.dynamixel.simulated", "SimulatedDynamixelBus"),
}


def open_bus(kind: str, servos: Iterable[ServoSpec], **options: Any) -> Bus:
    """Make the bus of a kind; it opens its port when it is entered or when ``open`` is called.

    Parameters
    ----------
    kind : ``"dynamixel"`` (a real port, or a pseudo-terminal that something serves) or ``"simulated"``
        (the same driver over a bus simulated in a child process).
    servos : the servos in the order of all arrays.
    options : what the driver takes, for example ``port`` and ``baud``.

    Raises
    ------
    DriverError : unknown kind, or the vendor's package is not installed.
    """
    if kind not in KINDS:
        raise DriverError(f"unknown bus kind {kind!r}", hint=f"use one of: {', '.join(sorted(KINDS))}")
    module, name = KINDS[kind]
    try:
        driver = getattr(import_module(module), name)
    except ModuleNotFoundError as error:
        raise DriverError(
            f"bus kind {kind!r} needs the package {error.name!r}, which is not installed",
            hint="pip install dynamixel-sdk pyserial",
        ) from error
    bus: Bus = driver(servos, **options)
    return bus
