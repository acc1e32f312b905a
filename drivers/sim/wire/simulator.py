"""Definition of a family's simulator: how its simulated far end is made, and the options of ``omote simulate``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from drivers.base.errors import PluginError
from drivers.base.options import check_options, entries, option
from drivers.core.families import BOARD_BAUD
from drivers.core.registry import FAMILIES, no_simulator_error
from drivers.core.traffic import Decoder, TextDecoder
from drivers.sim.wire.line import Line

Servos = Sequence[tuple[int, Any]]
"""(id, model) of each servo."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What every simulated far end is made with.

    baud : rate of the wire. seed : of random faults.
    names : names of all parameters, for a head that is served alone; empty for a driver's far end.
    """

    now_s: float
    baud: int
    seed: int = 0
    names: tuple[str, ...] = ()


def simulator_of(kind: str) -> Simulator:
    """The simulator of a family.

    Raises PluginError: unknown kind, a family that has none, or one that names something else.
    """
    family = FAMILIES.get(kind)
    if not family.simulator:
        raise no_simulator_error(kind)
    found = FAMILIES.load(family, family.simulator)
    update = "update the package that it comes from"
    if not isinstance(found, Simulator):
        raise PluginError(f"bus kind {kind!r} names {family.simulator}, which is no Simulator", hint=update)
    try:
        check_options(found.options)
    except ValueError as error:
        raise PluginError(f"the simulator of bus kind {kind!r} cannot be used: {error}", hint=update) from error
    if "baud" not in {entry.name for entry in entries(found.options)}:
        raise PluginError(f"the simulator of bus kind {kind!r} has no option baud", hint=update)
    return found


@dataclass(frozen=True, kw_only=True)
class BoardOptions:
    """Options of ``omote simulate`` for every board."""

    baud: int = option("Baud rate of the board.", BOARD_BAUD, at_least=300)


@dataclass(frozen=True, kw_only=True)
class Simulator:
    """The simulator of a family.

    far_end : makes what a driver of the family expects at the other end of its wire, from the ids and models of its
        servos and from what the driver gives as ``far_end()``, plain values that can travel to another process.
    alone : makes what ``omote simulate KIND`` serves, from an instance of ``options``.
    options : dataclass of the command's options (:mod:`drivers.base.options`), the bit rate ``baud`` among them;
        the options of serving are added.
    help : the command's help; its last line is an example.
    decoder : makes the decoder that shows the traffic of a far end in words.
    """

    far_end: Callable[[Servos, Mapping[str, Any], Setting], Line]
    alone: Callable[[Any, Setting], Line]
    options: type
    help: str
    decoder: Callable[[Line], Decoder] = field(default=lambda line: TextDecoder())


def make_line(
    family: str, servos: Servos, now_s: float, *, baud: int = 1_000_000, seed: int = 0, options: Mapping[str, Any] = {}
) -> Line:
    """The simulated far end of any family, from plain values, as they travel to a child process.

    family : a kind of bus; the models of Dynamixel and Feetech servos decide their protocol.
    servos : id and model of each. now_s : time.
    baud : rate of the wire. seed : of random faults.
    options : what the family's driver gives as ``far_end()``.

    Raises DriverError: unknown family or model, or servos that cannot share a wire.
    """
    return simulator_of(family).far_end(servos, options, Setting(now_s=now_s, baud=baud, seed=seed))
