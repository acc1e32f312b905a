"""Benchmark of ``omote bench bus --buses N``: several buses at once in one process, as ``omote run`` drives them.

Each bus has a thread and simulated servos in a process of its own, with the time of the bytes on its wire, so each has
its own limit; a machine needs about as many cores as buses for the simulators alone.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import Any

from controller.base.steal_time import StealTime
from controller.tools.bench_bus import Figure, Log, Loop, limit_hz, measure_loop, steal_figures
from drivers import open_bus
from drivers.base.bus import Floats, ServoSpec
from drivers.base.priority import request_realtime, shorten_thread_switches
from drivers.sim import SimulatedBus

SHARE = 0.92
PACED_HZ = 100.0
PACED_SHARE = 0.99


def bench_many(buses: int, servos: int, baud: int, seconds: float, log: Log) -> list[tuple[str, list[Figure]]]:
    """Rates of buses that run at once: as fast as each can, and at 100 Hz.

    buses, servos : how many buses, and servos on each. baud : of every bus. seconds : for each measurement.
    """
    specs = [ServoSpec(i + 1, f"servo{i + 1}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in range(servos)]
    shorten_thread_switches()
    steal = StealTime()
    with ExitStack() as stack:
        paths = [
            stack.enter_context(SimulatedBus(specs, process=True, wire=True, baud=baud)).path for _ in range(buses)
        ]
        log(f"{buses} buses at once, as fast as they can")
        free = _at_once(paths, specs, baud, seconds, 0.0)
        log(f"{buses} buses at once, {PACED_HZ:g} Hz")
        paced = _at_once(paths, specs, baud, seconds, PACED_HZ)
    limit = limit_hz(servos, baud, fast=True)
    figures = []
    for k, (fast, slow) in enumerate(zip(free, paced, strict=True)):
        share, kept = fast.rate_hz / limit, slow.rate_hz / PACED_HZ
        figures += [
            Figure(f"bus {k + 1}, write and fast sync read", fast.rate_hz, "Hz"),
            Figure(f"  bus {k + 1}, of the wire limit", 100 * share, "%", f"of {limit:.0f} Hz"),
            Figure(f"  bus {k + 1}, at {PACED_HZ:g} Hz", 100 * kept, "%", f">= {PACED_SHARE:.0%}", kept >= PACED_SHARE),
            Figure(f"  bus {k + 1}, tick late by, 99 of 100", slow.late_ms["p99"], "ms"),
        ]
    return [(f"{buses} buses of {servos} servos at {baud} baud, wire-timed", figures + steal_figures(steal))]


def _at_once(paths: list[str], specs: list[ServoSpec], baud: int, seconds: float, rate_hz: float) -> list[Loop]:
    """A loop of every bus, all in threads that begin together; raises what the first of them raised."""
    loops: list[Loop | BaseException | None] = [None] * len(paths)
    together = threading.Barrier(len(paths))

    def drive(k: int, path: str) -> None:
        try:
            request_realtime()
            options: dict[str, Any] = {"feedback": "position", "slow_group": 0, "watchdog_ms": 0}
            with open_bus("dynamixel", specs, port=path, baud=baud, **options) as bus:

                def cycle(angle_rad: Floats) -> bool:
                    bus.write(angle_rad[: len(specs)])
                    return bool(bus.read().fresh.all())

                bus.start()
                together.wait(timeout=60.0)
                loops[k] = measure_loop(cycle, seconds, rate_hz)
        except BaseException as error:  # noqa: BLE001  raised again by the caller
            together.abort()
            loops[k] = error

    threads = [threading.Thread(target=drive, args=(k, path)) for k, path in enumerate(paths)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for loop in loops:
        if isinstance(loop, BaseException) and not isinstance(loop, threading.BrokenBarrierError):
            raise loop
    return [loop for loop in loops if isinstance(loop, Loop)]
