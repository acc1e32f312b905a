"""The simulated far end of any family, from plain values, as they travel to a child process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivers.core.registry import simulator_of
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Servos, Setting


def make_line(
    family: str, servos: Servos, now_s: float, *, baud: int = 1_000_000, seed: int = 0, options: Mapping[str, Any] = {}
) -> Line:
    """What a simulated bus of a family has at its far end.

    Parameters
    ----------
    family : a kind of bus; servos with control tables know their protocol themselves.
    servos : id and model of each. now_s : time.
    baud : rate at which servos with control tables listen. seed : of random faults.
    options : what the family's driver gives as ``far_end()``.

    Raises
    ------
    DriverError : unknown family or model, or servos that cannot share a wire.
    """
    line: Line = simulator_of(family).far_end(servos, options, Setting(now_s=now_s, baud=baud, seed=seed))
    return line
