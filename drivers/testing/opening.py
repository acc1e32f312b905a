"""Opens simulated servos and boards for a test, by model and ids, or by the kind of board."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any

from drivers.base.errors import DriverError
from drivers.sim.boards.board import Board
from drivers.sim.serving.ports import Link
from drivers.sim.serving.simulated import SimulatedBus
from drivers.sim.serving.virtual import VirtualClock
from drivers.sim.servos.chain import Chain
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import Setting, make_line, simulator_of
from drivers.testing.bench import ServoBoard, ServoBus
from drivers.testing.serving import OnPort, Serving, Stepped

Models = str | Mapping[int, str]
"""Model of all servos, or of each by its id."""
LOCAL = {"pty": None, "tcp": "socket://127.0.0.1:0", "rfc2217": "rfc2217://127.0.0.1:0"}
"""Where a port is served by the kind of port; pseudo-terminals have no name before they are made."""
BAUD = 1_000_000


def open_servos(
    model: Models = "xl330-m288",
    ids: Iterable[int] = (1,),
    *,
    baud: int = BAUD,
    faults: Iterable[str] = (),
    stepped: bool = False,
    port: str = "",
    link: str | os.PathLike[str] | None = None,
    wire: bool = False,
    latency_s: float = 0.0,
    seed: int = 0,
) -> ServoBus:
    """Simulated Dynamixel or Feetech servos, with their shafts in the middle of the range and torque off.

    model, ids : as ``("xl330-m288", [1, 2])``, or models by id, ``{1: "xl330-m288", 7: "xm430-w350"}``.
    baud : rate the servos listen at. faults : as ``"mute:7"``. seed : of random faults.
    stepped : no port; time passes only when the test lets it, and bytes take their time on the wire.
    port : ``"pty"``, ``"tcp"`` or ``"rfc2217"``; empty: a pseudo-terminal where the system has them, else TCP.
    link : path that shall point at the pseudo-terminal.
    wire, latency_s : on a port, too, bytes take their time, and a USB adapter holds answers back for so long.

    Raises DriverError: unknown model or kind of port, unreadable fault, or the port cannot be made.
    """
    models = dict(model) if isinstance(model, Mapping) else dict.fromkeys(ids, model)
    setting = Setting(now_s=0.0 if stepped else time.monotonic(), baud=baud, seed=seed)
    line = make_line("dynamixel", list(models.items()), setting.now_s, baud=baud, seed=seed)
    return ServoBus(_serve(line, setting.now_s, baud, faults, stepped, port, link, wire, latency_s))


def open_board(
    kind: str = "maestro",
    *,
    parameters: Iterable[str] = (),
    faults: Iterable[str] = (),
    stepped: bool = False,
    port: str = "",
    link: str | os.PathLike[str] | None = None,
    wire: bool = False,
    latency_s: float = 0.0,
    seed: int = 0,
    **options: Any,
) -> ServoBoard:
    """A simulated board: ``"maestro"``, ``"ssc32"``, ``"text"``, ``"omote"``, or one of a plug-in.

    options : those of ``omote simulate KIND``, as ``channels=12`` or ``template="S{ch},{us}\\n"``.
    parameters : what a head of kind ``"omote"`` takes where its option ``names`` is empty.
    The others: see `open_servos`.

    Raises DriverError: as `open_servos`, and for a kind that is no board, or an option that it does not have.
    """
    simulator = simulator_of(kind)
    known = [field.name for field in fields(simulator.options)]
    if unknown := sorted(set(options) - set(known)):
        raise DriverError(f"a simulated {kind} has no option {unknown[0]!r}", hint=f"it has {', '.join(known)}")
    chosen = simulator.options(**options)
    now_s = 0.0 if stepped else time.monotonic()
    setting = Setting(now_s=now_s, baud=chosen.baud, seed=seed, names=tuple(parameters))
    line = simulator.alone(chosen, setting)
    if not isinstance(line, Board):
        raise DriverError(f"{kind} is a family of servos on a bus, not a board", hint="use servo_bus")
    return ServoBoard(_serve(line, now_s, chosen.baud, faults, stepped, port, link, wire, latency_s))


def open_line(
    line: Line, baud: int, *, faults: Iterable[str] = (), port: str = "", wire: bool = False
) -> ServoBus | ServoBoard:
    """Hardware that is made already, at a port. Parameters and errors as `open_servos`."""
    serving = _serve(line, time.monotonic(), baud, faults, False, port, None, wire, 0.0)
    return ServoBus(serving) if isinstance(line, Chain) else ServoBoard(serving)


def _serve(
    line: Line,
    now_s: float,
    baud: int,
    faults: Iterable[str],
    stepped: bool,
    port: str,
    link: Link,
    wire: bool,
    latency_s: float,
) -> Serving:
    line.faults.add(faults, now_s)
    if stepped:
        return Stepped(line, VirtualClock(now_s), baud, latency_s)
    kind = port or ("pty" if hasattr(os, "openpty") else "tcp")
    if kind not in LOCAL:
        raise DriverError(f"there is no port of kind {kind!r}", hint=f"use one of {', '.join(LOCAL)}")
    return OnPort(SimulatedBus((), link or LOCAL[kind], baud=baud, wire=wire, latency_s=latency_s, line=line))
