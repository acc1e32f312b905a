"""Benchmark of ``omote bench bus --buses N``: several buses at once in one process, as ``omote run`` drives them.

Each bus has a thread here and its simulated servos in a separate process that imitates the time of bytes on the wire,
so that each bus has its own limit. It also reports the processor time of a cycle, and the rates of drivers that each
have a process: the difference is the cost of sharing one interpreter.
"""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import Any

from controller.base.errors import ControllerError
from controller.base.steal_time import StealTime
from controller.tools.bench_bus import (
    MIN_WIRE_FRACTIONS,
    WARM_UP_CYCLES,
    Cycle,
    Figure,
    Log,
    Loop,
    bytes_alone,
    limit_hz,
    measure_loop,
    steal_figures,
)
from drivers import open_bus
from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError
from drivers.base.priority import request_realtime, shorten_thread_switches
from drivers.sim import SimulatedBus

PACED_HZ = 100.0
MIN_PACED_FRACTION = 0.99
MAX_READY_S = 60.0
"""Longest time until all buses are ready to begin together."""
MAX_PROCESS_S = 120.0
"""Time that a process may take beyond its measurement, mostly to start."""
_OTHER_FAILED = "another bus failed"
Drive = Callable[[str], AbstractContextManager[Cycle]]
"""Opens the bus at a path; the context gives the function of one cycle."""


def bench_many(buses: int, servos: int, baud: int, seconds: float, log: Log) -> list[tuple[str, list[Figure]]]:
    """Measure buses that run at once: as fast as each can, the same bytes without a driver, and at 100 Hz.

    buses, servos : how many buses, and servos on each. baud : of every bus. seconds : for each measurement.
    """
    specs = [ServoSpec(i + 1, f"servo{i + 1}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in range(servos)]
    shorten_thread_switches()
    steal = StealTime()
    figures: list[Figure] = []
    with ExitStack() as stack:
        wires = [stack.enter_context(SimulatedBus(specs, process=True, wire=True, baud=baud)) for _ in range(buses)]
        paths = [wire.path for wire in wires]
        for fast in (False, True):
            kind = "fast sync read" if fast else "sync read"
            log(f"{buses} buses at once, {kind}, as fast as they can")
            used_s = [wire.processor_s or 0.0 for wire in wires]
            free = _measure_at_once(paths, partial(_driver, specs, baud, fast), seconds, 0.0)
            used_s = [(wire.processor_s or 0.0) - before for wire, before in zip(wires, used_s, strict=True)]
            log(f"{buses} buses at once, {kind}, the same bytes without a driver")
            alone = _measure_at_once(paths, partial(bytes_alone, servos=servos, baud=baud, fast=fast), seconds, 0.0)
            log(f"{buses} buses at once, {kind}, each driven from a process of its own")
            apart = _measure_at_once(paths, partial(_driver, specs, baud, fast), seconds, 0.0, processes=True)
            figures += _free_figures(kind, limit_hz(servos, baud, fast), MIN_WIRE_FRACTIONS[fast], free, alone)
            simulated = 1e6 * sum(used_s) / sum(loop.rate_hz * seconds + WARM_UP_CYCLES for loop in free)
            figures += _cost_figures(kind, limit_hz(servos, baud, fast), free, alone, apart)
            figures.append(Figure("  simulated servos, processor of a cycle", simulated, "us"))
        log(f"{buses} buses at once, {PACED_HZ:g} Hz")
        figures += _paced_figures(_measure_at_once(paths, partial(_driver, specs, baud, True), seconds, PACED_HZ))
    return [(f"{buses} buses of {servos} servos at {baud} baud, wire-timed", figures + steal_figures(steal))]


def _free_figures(kind: str, limit: float, share: float, free: list[Loop], alone: list[Loop]) -> Iterator[Figure]:
    for k, (driven, bare) in enumerate(zip(free, alone, strict=True), 1):
        reach, kept = f">= {share:.0%} of {limit:.0f} Hz", driven.rate_hz >= share * limit
        yield Figure(f"bus {k}, write and {kind}", driven.rate_hz, "Hz")
        yield Figure(f"  bus {k}, of the wire limit", 100 * driven.rate_hz / limit, "%", reach, kept)
        yield Figure(f"  bus {k}, the same bytes without a driver", 100 * bare.rate_hz / limit, "%")


def _cost_figures(kind: str, limit: float, free: list[Loop], alone: list[Loop], apart: list[Loop]) -> Iterator[Figure]:
    """Yield the processor time of a cycle, and typical rates with and without drivers and separate processes."""
    driven, bare = (1e6 * sum(loop.processor for loop in loops) / sum(loop.rate_hz for loop in loops)
        for loops in (free, alone))  # fmt: skip
    yield Figure(f"{kind}, processor of a cycle", driven, "us")
    yield Figure("  the same bytes without a driver", bare, "us")
    typical = [1e3 / limit / _median([loop.cycle_ms["p50"] for loop in loops]) for loops in (free, apart, alone)]
    names = ("half of all cycles, of the wire limit", "  each driven from a process of its own", "  without a driver")
    yield from (Figure(name, 100 * share, "%") for name, share in zip(names, typical, strict=True))


def _median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def _paced_figures(paced: list[Loop]) -> Iterator[Figure]:
    for k, loop in enumerate(paced, 1):
        share = loop.rate_hz / PACED_HZ
        yield Figure(
            f"bus {k}, at {PACED_HZ:g} Hz",
            100 * share,
            "%",
            f">= {MIN_PACED_FRACTION:.0%}",
            share >= MIN_PACED_FRACTION,
        )
        yield Figure(f"  bus {k}, tick late by, 99 of 100", loop.late_ms["p99"], "ms")


@contextmanager
def _driver(specs: list[ServoSpec], baud: int, fast: bool, path: str) -> Iterator[Cycle]:
    options: dict[str, Any] = {"fast": fast, "feedback": "position", "slow_group": 0, "watchdog_ms": 0}
    with open_bus("dynamixel", specs, port=path, baud=baud, **options) as bus:

        def cycle(angle_rad: Floats) -> bool:
            bus.write(angle_rad[: len(specs)])
            return bool(bus.read().fresh.all())

        bus.start()
        yield cycle


def _run_process(opened: Drive, path: str, seconds: float, rate_hz: float, together: Any, answers: Any) -> None:
    """Measure one bus, in a separate process; send the result, or an error as text."""
    shorten_thread_switches()
    request_realtime()
    try:
        with opened(path) as cycle:
            together.wait(timeout=MAX_READY_S)
            loop = measure_loop(cycle, seconds, rate_hz)
    except threading.BrokenBarrierError:
        answers.send(_OTHER_FAILED)
    except Exception as error:  # noqa: BLE001  the parent reports any error
        together.abort()
        answers.send(_describe(error))
    else:
        answers.send(loop)


def _measure_in_processes(paths: list[str], opened: Drive, seconds: float, rate_hz: float) -> list[Loop]:
    """Measure every bus in its own process, all at once; raises as `_measure_at_once`."""
    context = multiprocessing.get_context("spawn")
    together = context.Barrier(len(paths))
    pipes = [context.Pipe(duplex=False) for _ in paths]
    processes = [
        context.Process(target=_run_process, args=(opened, path, seconds, rate_hz, together, answers), daemon=True)
        for path, (_, answers) in zip(paths, pipes, strict=True)
    ]
    try:
        for process, (_, answers) in zip(processes, pipes, strict=True):
            process.start()
            answers.close()  # so that the end of the process is the end of the pipe
        end_s = time.monotonic() + seconds + MAX_PROCESS_S
        found = [
            _receive_result(answer, process, together, end_s)
            for (answer, _), process in zip(pipes, processes, strict=True)
        ]
    finally:
        for process in [each for each in processes if each.pid]:
            process.kill()
            process.join()
    return _all_loops(paths, found)


def _receive_result(answer: Any, process: Any, together: Any, end_s: float) -> Loop | str:
    """Receive the result of a process, or return as text why there is none."""
    try:
        if answer.poll(max(end_s - time.monotonic(), 0.0)):
            found: Loop | str = answer.recv()
            return found
    except EOFError:
        together.abort()  # the others would wait for it
        process.join()
        return f"its process ended with status {process.exitcode} before it had measured anything"
    together.abort()
    return f"its process did not answer within {MAX_PROCESS_S:g} s of the end of its time"


def _describe(error: Exception) -> str:
    """Describe an error as text."""
    return str(error) if isinstance(error, DriverError) else f"{type(error).__name__}: {error}"


def _all_loops(paths: list[str], found: list[Loop | str]) -> list[Loop]:
    """Return the results of all buses; raises ControllerError where one is missing."""
    failed = [f"bus {k} on {path}: {each}" for k, (path, each) in enumerate(zip(paths, found, strict=True), 1)
              if isinstance(each, str) and each != _OTHER_FAILED]  # fmt: skip
    loops = [each for each in found if isinstance(each, Loop)]
    if len(loops) < len(paths):
        hint = "close other programs, or measure fewer buses: --buses 2"
        raise ControllerError("; ".join(failed) or f"buses did not begin within {MAX_READY_S:g} s", hint=hint)
    return loops


def _measure_at_once(
    paths: list[str], opened: Drive, seconds: float, rate_hz: float, *, processes: bool = False
) -> list[Loop]:
    """Measure every bus in its own thread, all at once. Raises ControllerError, which names buses that failed.

    processes : use processes instead of threads.
    """
    if processes:
        return _measure_in_processes(paths, opened, seconds, rate_hz)
    found: list[Loop | str] = [_OTHER_FAILED] * len(paths)
    together = threading.Barrier(len(paths))

    def drive(k: int, path: str) -> None:
        try:
            request_realtime()
            with opened(path) as cycle:
                together.wait(timeout=MAX_READY_S)
                found[k] = measure_loop(cycle, seconds, rate_hz)
        except threading.BrokenBarrierError:
            pass  # `found` holds _OTHER_FAILED
        except Exception as error:  # noqa: BLE001  the caller reports any error
            together.abort()
            found[k] = _describe(error)

    threads = [threading.Thread(target=drive, args=(k, path)) for k, path in enumerate(paths)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return _all_loops(paths, found)
