"""Bytes to motors and back: servo buses, and simulated ones that keep the same contract.

Drivers are imported when they are asked for, so a missing vendor package never breaks anything else.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from drivers.base.errors import DriverError

if TYPE_CHECKING:
    from drivers.base.bus import Bus, ServoSpec

SIMULATED = "simulated"


class Kind(NamedTuple):
    """Where a family lives: its driver, and what raises DriverError for a model that it does not drive."""

    driver: str
    check: str


KINDS = {
    "dynamixel": Kind("drivers.dynamixel.bus:DynamixelBus", "drivers.tables.models:check_dynamixel"),
    "maestro": Kind("drivers.maestro.bus:MaestroBus", "drivers.boards.hobby:check_hobby"),
    "ssc32": Kind("drivers.ssc32.bus:Ssc32Bus", "drivers.boards.hobby:check_hobby"),
    "text": Kind("drivers.text.bus:TextBus", "drivers.boards.hobby:check_hobby"),
    "omote": Kind("drivers.omote.bus:LineOutBus", "drivers.omote.bus:check_lineout"),
    "feetech": Kind("drivers.feetech.bus:FeetechBus", "drivers.tables.models:check_feetech"),
}


def open_bus(kind: str, servos: Iterable[ServoSpec], *, simulates: str = "dynamixel", **options: Any) -> Bus:
    """Make the bus of a kind; it opens its port when it is entered or when ``open`` is called.

    Parameters
    ----------
    kind : a family of :data:`KINDS` (a real port, or one that something serves), or ``"simulated"`` (the same driver
        over a bus simulated in a child process).
    servos : the servos in the order of all arrays.
    simulates : the family that ``"simulated"`` stands in for.
    options : what the driver takes, for example ``port`` and ``baud``; see docs/drivers.md.

    Raises
    ------
    DriverError : unknown kind, or a package is not installed.
    """
    servos = tuple(servos)
    if kind == SIMULATED:
        from drivers.sim.serving.standin import simulated

        driver = simulated(_load(simulates, "driver").fitting(servos), simulates)
    else:
        driver = _load(kind, "driver").fitting(servos)
        if options.pop("faults", ()):
            raise DriverError("faults can only be given to a simulated bus", hint='set kind = "simulated"')
    bus: Bus = driver(servos, **options)
    return bus


def check_model(kind: str, model: str, simulates: str = "dynamixel") -> None:
    """Whether a kind of bus drives a servo model.

    Raises
    ------
    DriverError : it does not; the hint lists names that look like it.
    """
    _load(simulates if kind == SIMULATED else kind, "check")(model)


def _load(kind: str, what: str) -> Any:
    """A family's driver or check."""
    if kind not in KINDS:
        names = ", ".join(sorted((*KINDS, SIMULATED)))
        raise DriverError(f"unknown bus kind {kind!r}", hint=f"use one of: {names}")
    module, _, name = getattr(KINDS[kind], what).partition(":")
    try:
        return getattr(import_module(module), name)
    except ModuleNotFoundError as error:
        raise DriverError(
            f"bus kind {kind!r} needs the package {error.name!r}, which is not installed",
            hint="pip install dynamixel-sdk pyserial",
        ) from error
