"""The simulated far end of any family, from plain values, as they travel to a child process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Servos, Setting, simulator_of


def make_line(
    family: str, servos: Servos, now_s: float, *, baud: int = 1_000_000, seed: int = 0, options: Mapping[str, Any] = {}
) -> Line:
    """What a simulated bus of a family has at its far end.

    Parameters
    ----------
    family : a kind of bus; the models of Dynamixel and Feetech servos decide their protocol.
    servos : id and model of each. now_s : time.
    baud : rate of the wire. seed : of random faults.
    options : what the family's driver gives as ``far_end()``.

    Raises
    ------
    DriverError : unknown family or model, or servos that cannot share a wire.
    """
    return simulator_of(family).far_end(servos, options, Setting(now_s=now_s, baud=baud, seed=seed))
