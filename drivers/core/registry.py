"""Registry of bus families, built-in and of other packages; opens a bus by its kind and checks servo models.

A driver is imported when it is used, so a missing vendor package affects no other kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from drivers.base.errors import DriverError, PluginError
from drivers.base.options import check_options
from drivers.base.plugins import Registry, folders_with
from drivers.core.families import API, HIGH_RATE_HZ, RESERVED, USUAL_RATE_HZ, Family

if TYPE_CHECKING:  # imported lazily: numpy is not needed to list the kinds
    from drivers.base.bus import Bus, ServoSpec
    from drivers.core.wirebus import WireBus

SIMULATED = "simulated"
_BITS_PER_BYTE = 10  # with start and stop bit
_MAX_WIRE_LOAD = 0.6
"""Greatest fraction of time that the wire may be busy at the high rate; adapters and late replies need the rest."""

FAMILIES: Registry[Family] = Registry(
    Family,
    "bus kind",
    "omote.drivers",
    API,
    lambda: folders_with("drivers", "family"),
    "FAMILY",
    reserved=(SIMULATED, "robot", "host"),  # the last two are commands of omote simulate
    check=lambda family: check_options(family.settings, RESERVED),
)


def kinds() -> list[str]:
    """Every kind of real bus, sorted by name."""
    return FAMILIES.kinds()


def open_bus(kind: str, servos: Iterable[ServoSpec], *, simulates: str = "dynamixel", **options: Any) -> Bus:
    """Create the bus of a kind; it opens its port when it is entered or when ``open`` is called.

    kind : one of :func:`kinds`, or ``"simulated"`` (the same driver over a bus simulated in a child process).
    servos : the servos in the order of all arrays.
    simulates : the family that ``"simulated"`` simulates.
    options : options of the driver, for example ``port`` and ``baud``; see docs/drivers.md.

    Raises DriverError: unknown kind, or a package is not installed.
    """
    servos = tuple(servos)
    if kind != SIMULATED:
        family, driver = kind, driver_of(kind, servos)
        if options.pop("faults", ()):
            raise DriverError("faults can only be given to a simulated bus", hint='set kind = "simulated"')
    else:
        family, plugin = simulates, FAMILIES.get(simulates)
        if not plugin.simulator:
            raise no_simulator_error(simulates)
        simulated = FAMILIES.load(plugin, "drivers.sim.serving.simulated_driver:simulated")
        driver = simulated(driver_of(simulates, servos), simulates)
    with FAMILIES.naming_package(family):
        return driver(servos, **options)


def driver_of(kind: str, servos: Sequence[ServoSpec]) -> type[WireBus]:
    """Return the driver class for servos of a family.

    Raises DriverError: unknown kind or model, or a package is not installed.
    """
    try:
        family = FAMILIES.get(kind)
    except PluginError as error:
        known = FAMILIES.kinds()
        if kind in known:
            raise
        raise PluginError(str(error), hint=f"use one of: {', '.join(sorted([*known, SIMULATED]))}") from error
    driver: Any = FAMILIES.load(family, family.driver)
    with FAMILIES.importing(family):
        chosen: type[WireBus] = driver if isinstance(driver, type) else driver(servos)
    return chosen


def check_model(kind: str, model: str, simulates: str = "dynamixel") -> None:
    """Raise DriverError where a kind of bus does not drive a servo model; the hint lists similar names."""
    family = FAMILIES.get(simulates if kind == SIMULATED else kind)
    check = FAMILIES.load(family, family.check_model)
    with FAMILIES.naming_package(family.kind):
        check(model)


def usual_rate_hz(kind: str, models: Sequence[str], baud: int) -> float:
    """Default rate (cycles per second) of a bus with servos of these models, for a robot file that gives none.

    Raises DriverError for a model that the family does not drive.
    """
    family = FAMILIES.get(kind)
    if not family.cycle_bytes:
        return USUAL_RATE_HZ
    count = FAMILIES.load(family, family.cycle_bytes)
    with FAMILIES.naming_package(family.kind):
        busy_s = count(models) * _BITS_PER_BYTE / baud
    return HIGH_RATE_HZ if busy_s * HIGH_RATE_HZ <= _MAX_WIRE_LOAD else USUAL_RATE_HZ


def no_simulator_error(kind: str) -> PluginError:
    """The error for simulating a family that has no simulator."""
    return PluginError(f"bus kind {kind!r} has no simulator", hint=f'use a real one: kind = "{kind}", and its port')
