"""Every kind of bus there is: the families in the folders of ``drivers``, and those that other packages add.

Nothing else in the house names a family. A driver is imported when it is asked for, so a missing vendor package never
breaks anything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from drivers.base.errors import DriverError, PluginError
from drivers.base.options import check_options
from drivers.base.plugins import Registry, folders_with
from drivers.core.families import API, RESERVED, Family

if TYPE_CHECKING:  # start-up: they bring numpy, which listing the kinds does without
    from drivers.base.bus import Bus, ServoSpec
    from drivers.core.wirebus import WireBus

SIMULATED = "simulated"

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
    """Every kind of real bus, in order."""
    return FAMILIES.kinds()


def open_bus(kind: str, servos: Iterable[ServoSpec], *, simulates: str = "dynamixel", **options: Any) -> Bus:
    """Make the bus of a kind; it opens its port when it is entered or when ``open`` is called.

    Parameters
    ----------
    kind : one of :func:`kinds` (a real port, or one that something serves), or ``"simulated"`` (the same driver over a
        bus simulated in a child process).
    servos : the servos in the order of all arrays.
    simulates : the family that ``"simulated"`` stands in for.
    options : what the driver takes, for example ``port`` and ``baud``; see docs/drivers.md.

    Raises
    ------
    DriverError : unknown kind, or a package is not installed.
    """
    servos = tuple(servos)
    if kind == SIMULATED:
        driver = _simulated(simulates, servos)
    else:
        driver = driver_of(kind, servos)
        if options.pop("faults", ()):
            raise DriverError("faults can only be given to a simulated bus", hint='set kind = "simulated"')
    with FAMILIES.blaming(simulates if kind == SIMULATED else kind):
        bus: Bus = driver(servos, **options)
    return bus


def driver_of(kind: str, servos: Sequence[ServoSpec]) -> type[WireBus]:
    """The driver of a family for some servos.

    Raises
    ------
    DriverError : unknown kind, a package is not installed, or an unknown model.
    """
    family = _family(kind)
    driver = FAMILIES.load(family, family.driver)
    chosen: type[WireBus] = driver if isinstance(driver, type) else driver(servos)
    return chosen


def _family(kind: str) -> Family:
    """A family by its kind; where there is none, ``"simulated"`` is named among those there are."""
    try:
        return FAMILIES.get(kind)
    except PluginError as error:
        if kind in FAMILIES.kinds():
            raise
        raise PluginError(
            str(error), hint=f"use one of: {', '.join(sorted([*FAMILIES.kinds(), SIMULATED]))}"
        ) from error


def check_model(kind: str, model: str, simulates: str = "dynamixel") -> None:
    """Whether a kind of bus drives a servo model.

    Raises
    ------
    DriverError : it does not; the hint lists names that look like it.
    """
    family = FAMILIES.get(simulates if kind == SIMULATED else kind)
    check = FAMILIES.load(family, family.check_model)
    with FAMILIES.blaming(family.kind):
        check(model)


def _simulated(kind: str, servos: Sequence[ServoSpec]) -> Any:
    """The driver of a family over a simulated far end; PluginError where the family has none."""
    family = FAMILIES.get(kind)
    if not family.simulator:
        raise no_simulator_error(kind)
    return FAMILIES.load(family, "drivers.sim.serving.simulated_wire:simulated")(driver_of(kind, servos), kind)


def no_simulator_error(kind: str) -> PluginError:
    """What is said of a family that nothing stands in for."""
    return PluginError(f"bus kind {kind!r} has no simulator", hint=f'use a real one: kind = "{kind}", and its port')
