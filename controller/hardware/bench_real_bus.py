"""Benchmark behind ``omote bench bus --real PORT``: round trips and read rates of the servos on a real bus.

It only pings and reads: no torque is switched on and no goal is sent.

The limit of the wire is computed as in :mod:`controller.tools.bench_bus`, without the goals: for n servos with Protocol
2.0 a read takes 14 + n bytes of request, and 15 n bytes of replies or 8 + 8 n bytes of one joint reply.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from controller.base.clock import Samples
from controller.tools.bench_bus import Figure, Log, Loop, measure_loop
from controller.tools.scan import scan_port
from drivers import open_bus
from drivers.base.bus import Bus, BusState, ServoInfo, ServoSpec
from drivers.base.errors import DriverError, NoReply
from drivers.servos.bus import ServoBus
from drivers.tables.tables import FEETECH, load_table

RATES_HZ = (50.0, 100.0)
REQUIRED_FRACTION = 0.99
"""Fraction of the reads in which every servo must answer for a rate to count as reached."""
PINGS = 100
_REQUEST_2, _REPLY_2, _JOINT_2, _JOINT_EACH_2 = 14, 15, 8, 8
"""Bytes of a request, of one reply, of a joint reply, and of each servo in a joint reply (Protocol 2.0)."""


def find_servos(port: str, baud: int, protocols: Sequence[int]) -> list[ServoInfo]:
    """Return the servos of known models that answer on a port, in the first protocol in which any do.

    Raises PortError; NoReply where no servo answers.
    """
    for protocol in protocols:
        found = [item.servo for item in scan_port(port, [(protocol, baud)]) if item.servo]
        if known := [info for info in found if _is_known(info)]:
            return known
    raise NoReply(f"no servo to measure on {port} at {baud} baud", hint=f"omote scan {port}", port=port)


def _is_known(info: ServoInfo) -> bool:
    try:
        load_table(info.model_number)
    except DriverError:
        return False
    return True


def bench_real_bus(
    port: str, baud: int, seconds: float, log: Log, protocols: Sequence[int] = (2, 1)
) -> list[tuple[str, list[Figure]]]:
    """Measure round trips and read rates of the servos on a port, each rate for ``seconds``; return titled tables.

    Raises PortError; NoReply where no servo answers.
    """
    log("looking for servos")
    found = find_servos(port, baud, protocols)
    specs = [ServoSpec(info.id, f"servo {info.id}", info.model, -math.pi, math.pi, 1.0, 1.0) for info in found]
    kind = "feetech" if found[0].model.startswith(FEETECH) else "dynamixel"
    title = f"{len(specs)} servos on {port} at {baud} baud, read only"
    figures: list[Figure] = []
    for fast, options in _read_modes(found):
        with open_bus(kind, specs, port=port, baud=baud, feedback="position", slow_group=0, **options) as bus:
            if not figures:
                log("round trips")
                figures += _round_trips(bus)
            figures += _rates(bus, baud, seconds, fast, log)
    return [(title, figures)]


def _read_modes(found: Sequence[ServoInfo]) -> list[tuple[bool, dict[str, Any]]]:
    """Return for each way of reading that the servos support: whether it is a fast read, and the bus options for it.

    Fast reads need Protocol 2.0 and firmware that has them. With Protocol 1.0 every cycle reads all servos.
    """
    tables = [load_table(info.model_number, info.firmware) for info in found]
    if any(table.protocol == 1 for table in tables):
        return [(False, {"singles": len(found)})]
    return [(fast, {"fast": fast}) for fast in (False, True)[: 1 + all(table.fast_read for table in tables)]]


def _round_trips(bus: Bus) -> list[Figure]:
    """Measure the time of describing one servo after the other, and how much of it the adapter adds."""
    times = Samples()
    for k in range(PINGS):
        began = time.perf_counter()
        bus.discover([bus.ids[k % len(bus.ids)]])
        times.add(1e3 * (time.perf_counter() - began))
    summary = times.summary()
    figures = [
        Figure("a servo described (ping and four reads), median", summary["p50"], "ms"),
        Figure("  99 of 100", summary["p99"], "ms"),
    ]
    if not isinstance(bus, ServoBus) or bus.reply_delay_s is None:
        return figures
    message, hint = bus.slow_answers()
    note = f"{message}; try: {hint}" if message else "<= 5 ms"
    delay = Figure("an answer comes after its time on the wire by", 1e3 * bus.reply_delay_s, "ms", note, not message)
    return [*figures, delay]


def _rates(bus: Bus, baud: int, seconds: float, fast: bool, log: Log) -> list[Figure]:
    name = f"{'fast ' if fast else ''}reads of all"
    log(f"{name}, as fast as possible")
    unpaced = _measure(bus, seconds, 0.0)
    figures = [Figure(name, unpaced.rate_hz, "Hz")]
    if limit := read_limit_hz([servo.model for servo in bus.servos], baud, fast):
        figures.append(Figure("  of the wire limit", 100 * unpaced.rate_hz / limit, "%", f"of {limit:.0f} Hz"))
    figures.append(Figure("  one read, 99 of 100", unpaced.cycle_ms["p99"], "ms"))
    for rate in RATES_HZ:
        log(f"{name}, {rate:g} Hz")
        paced = _measure(bus, seconds, rate)
        share = paced.rate_hz / rate
        reach = f">= {REQUIRED_FRACTION:.0%}"
        figures.append(Figure(f"  complete at {rate:g} Hz", 100 * share, "%", reach, share >= REQUIRED_FRACTION))
    return figures


def _measure(bus: Bus, seconds: float, rate_hz: float) -> Loop:
    return measure_loop(partial(_read, bus.read), seconds, rate_hz)


def _read(read: Callable[[], BusState], _: object) -> bool:
    return bool(np.all(read().fresh))


def read_limit_hz(models: Sequence[str], baud: int, fast: bool) -> float | None:
    """Reads of all positions per second that the wire allows; None where servos are read one by one."""
    n, tables = len(models), [load_table(model) for model in models]
    if all(table.protocol == 2 for table in tables):
        size = _REQUEST_2 + n + (_JOINT_2 + _JOINT_EACH_2 * n if fast else _REPLY_2 * n)
        return baud / (10.0 * size)
    return None
