"""Benchmark of ``omote bench bus``: a simulated bus of 24 servos, driven by omote and by the bare Dynamixel SDK.

Bytes are delayed by their transmission time in both directions (``drivers.sim``, ``wire=True``). The servos' return
delay is 0, so the shortest cycle is known: ten bits per byte at the baud rate. The simulated servos run in another
process, which uses the processors of this machine, too.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import dynamixel_sdk as sdk
import numpy as np
import tomli_w
from numpy.typing import NDArray

from controller.base.clock import Clock, Samples
from controller.base.paths import find_config
from controller.base.steal_time import StealTime
from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.children import environment as child_environment
from drivers.base.priority import NO_REALTIME, request_realtime, restore_priority, shorten_thread_switches
from drivers.dynamixel.frames import GoalFrame, GroupRead, Run
from drivers.port.serialport import SerialPort
from drivers.sim import SimulatedBus

Log = Callable[[str], None]
Cycle = Callable[["NDArray[np.float64]"], "bool | NDArray[np.bool_]"]
"""Writes goals (n,) rad and reads once; returns which servos answered."""

SERVOS = 24
BAUD = 1_000_000
PACED_HZ = 50
JITTER_HZ = 100
GOAL, POSITION, WIDTH = 116, 132, 4
ROUNDS = 3
MIN_WIRE_FRACTIONS = (0.92, 0.85)
"""Lower bounds of the rate relative to the wire's limit: of a loop with sync reads, and with fast sync reads."""
_SWING_RAD = 0.3
WARM_UP_CYCLES = 40
_UNLIMITED_FPS, _PACED_FPS = 1000, 30
_MIN_FACE_S = 10.0
"""Shortest run with the face. In a shorter one, the ticks while servos start would decide the 99th percentile."""
_FACE_RUNS = (
    ("as fast as it can, ordinary priority", _UNLIMITED_FPS, True),
    ("as fast as it can", _UNLIMITED_FPS, False),
    ("30 frames/s", _PACED_FPS, False),
)
_SLEEPER = """
import select, sys
from controller.base.clock import Clock, Samples
from drivers.base.priority import request_realtime
request_realtime()
clock = Clock(float(sys.argv[1]))
clock.jitter_ms = Samples(int(sys.argv[2]))
for _ in clock.run(lambda: not select.select([sys.stdin], [], [], 0)[0]):
    pass
print(clock.jitter_ms.summary()["p99"])
"""
"""Program that sleeps from tick to tick until its standard input ends, then prints the lateness (ms) of the newest
ticks, 99th percentile."""


@dataclass(frozen=True)
class Figure:
    """One row of the report: a measured value, its bound ``reach`` as text or empty, and whether it keeps the bound."""

    name: str
    value: float
    unit: str
    reach: str = ""
    kept: bool | None = None


@dataclass(frozen=True)
class Loop:
    """Measurements of a loop of one write and one read.

    rate_hz : cycles per second in which every servo answered. processor : fraction of a core that the thread used.
    cycle_ms : percentiles of the time of one write and one read. late_ms : percentiles of how late ticks began; empty
    for a loop without pauses.
    """

    rate_hz: float
    processor: float
    cycle_ms: dict[str, float]
    late_ms: dict[str, float]


def limit_hz(servos: int, baud: int, fast: bool) -> float:
    """Return the cycles per second that the wire allows, each a sync write and a sync read of 4 bytes per servo.

    Bytes (ROBOTIS e-Manual, Protocol 2.0): 14 + n (1 + 4) for the write, 14 + n for the request, n (11 + 4) for
    the replies or 8 + n (4 + 4) for one joint reply.
    """
    write, request = 14 + servos * (1 + WIDTH), 14 + servos
    replies = 8 + servos * (4 + WIDTH) if fast else servos * (11 + WIDTH)
    return baud / (10.0 * (write + request + replies))


def bench_bus(seconds: float, log: Log, *, face: bool = False) -> list[tuple[str, list[Figure]]]:
    """Return tables of rates, processor time, latency and jitter, each measured for ``seconds``.

    ``face`` : also run the whole program, face and control process, and measure the jitter of its bus.
    """
    specs = [ServoSpec(i + 1, f"servo{i + 1}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in range(SERVOS)]
    shorten_thread_switches()
    realtime = request_realtime()
    title = f"{SERVOS} servos at {BAUD} baud, wire-timed" + (", real-time priority" if realtime else "")
    steal = StealTime()
    with SimulatedBus(specs, process=True, wire=True, baud=BAUD) as bus:
        rounds = []
        for k in range(ROUNDS):
            log(f"loops as fast as they can, {k + 1} of {ROUNDS}")
            rounds.append(
                {
                    "plain": _run_omote(bus.path, specs, seconds, False, 0.0).rate_hz,
                    "fast": _run_omote(bus.path, specs, seconds, True, 0.0).rate_hz,
                    "plain_bytes": _run_bytes(bus.path, seconds, False).rate_hz,
                    "fast_bytes": _run_bytes(bus.path, seconds, True).rate_hz,
                    "sdk": _run_sdk(bus.path, seconds, 0.0).rate_hz,
                }
            )
        log(f"sync read, {PACED_HZ} Hz")
        paced = _run_omote(bus.path, specs, seconds, False, PACED_HZ)
        log(f"sync read, {JITTER_HZ} Hz")
        ticks = _run_omote(bus.path, specs, seconds, False, JITTER_HZ)
        log(f"the bare SDK, {PACED_HZ} Hz")
        sdk_paced = _run_sdk(bus.path, seconds, PACED_HZ)
    # the median of the rounds, because other load of the machine may slow down any of them
    rates = {kind: float(np.median([each[kind] for each in rounds])) for kind in rounds[0]}
    figures = _rate_figures(rates) + _loop_figures(paced, sdk_paced, ticks, realtime)
    tables = [(title, figures + steal_figures(steal))]
    if face:
        restore_priority()  # otherwise the programs that are started would inherit the real-time priority
        tables.append(("the whole program: face and body, simulated head of 24 servos", _bench_face(seconds, log)))
    return tables


def _run_omote(path: str, specs: list[ServoSpec], seconds: float, fast: bool, rate_hz: float) -> Loop:
    """Measure omote's driver with sync reads or fast ones; ``rate_hz`` 0 means without pauses."""
    options: dict[str, Any] = {"fast": fast, "feedback": "position", "slow_group": 0, "watchdog_ms": 0}
    with open_bus("dynamixel", specs, port=path, baud=BAUD, **options) as bus:

        def cycle(angle_rad: NDArray[np.float64]) -> NDArray[np.bool_]:
            bus.write(angle_rad)
            return bus.read().fresh

        bus.start()
        return measure_loop(cycle, seconds, rate_hz)


def _run_bytes(path: str, seconds: float, fast: bool) -> Loop:
    with bytes_alone(path, SERVOS, BAUD, fast) as cycle:
        return measure_loop(cycle, seconds, 0.0)


@contextmanager
def bytes_alone(path: str, servos: int, baud: int, fast: bool) -> Iterator[Cycle]:
    """Yield a cycle that sends ready packets and waits for as many bytes as the answers have.

    It neither encodes nor decodes, so its rate is the upper limit for a driver on this machine.
    """
    ids = tuple(range(1, servos + 1))
    goals = GoalFrame(ids, GOAL, WIDTH, np.arange(servos)).encode(np.full(servos, 2048, np.int32))
    read, port = GroupRead((Run(ids, POSITION, WIDTH),), fast), SerialPort(path, baud)

    def cycle(_: object) -> bool:
        port.write(goals)
        port.write(read.frame)
        missing, deadline_s = read.size, time.monotonic() + 1.0
        while missing > 0 and (data := port.read(deadline_s)):
            missing -= len(data)
        return missing == 0

    port.open()
    try:
        yield cycle
    finally:
        port.close()


def _run_sdk(path: str, seconds: float, rate_hz: float) -> Loop:
    """Measure the same goals and positions through the SDK's own group classes, at ordinary priority.

    The SDK waits by polling. At a higher priority it would keep the system from transferring the bytes that it waits
    for, time out, and mistake late replies for those to its next request.
    """
    port, packets = sdk.PortHandler(path), sdk.PacketHandler(2.0)
    port.openPort()
    port.setBaudRate(BAUD)
    write = sdk.GroupSyncWrite(port, packets, GOAL, WIDTH)
    read = sdk.GroupSyncRead(port, packets, POSITION, WIDTH)
    for servo in range(1, SERVOS + 1):
        read.addParam(servo)
        write.addParam(servo, [0, 8, 0, 0])

    def cycle(angle_rad: NDArray[np.float64]) -> bool:
        for servo, angle in enumerate(angle_rad, 1):
            goal = 2048 + int(angle * 2048 / np.pi)
            write.changeParam(servo, [goal & 0xFF, goal >> 8, 0, 0])
        write.txPacket()
        result = read.txRxPacket()
        ticks = [read.getData(servo, POSITION, WIDTH) for servo in range(1, SERVOS + 1)]
        return bool(result == sdk.COMM_SUCCESS and ticks)

    restore_priority()
    try:
        return measure_loop(cycle, seconds, rate_hz)
    finally:
        port.closePort()
        request_realtime()


def measure_loop(cycle: Cycle, seconds: float, rate_hz: float) -> Loop:
    """Run ``cycle`` for ``seconds`` at ``rate_hz`` or, with 0, without pauses, and measure it."""
    swing = np.repeat(_SWING_RAD * np.sin(np.arange(314) / 50)[:, None], SERVOS, axis=1)  # a slow sine for all servos
    for angles in swing[:WARM_UP_CYCLES]:
        cycle(angles)
    clock = Clock(rate_hz or 1.0)
    began, used, end = time.monotonic(), time.thread_time(), time.monotonic() + seconds
    ticks = clock.run(lambda: time.monotonic() < end) if rate_hz else iter(time.monotonic_ns, None)
    times, complete = Samples(), 0
    for k, _ in enumerate(ticks):
        start = time.perf_counter()
        complete += bool(np.all(cycle(swing[k % len(swing)])))
        times.add(1e3 * (time.perf_counter() - start))
        if time.monotonic() >= end:
            break
    wall, used = time.monotonic() - began, time.thread_time() - used
    return Loop(complete / wall, used / wall, times.summary(), clock.jitter_ms.summary() if rate_hz else {})


def _rate_figures(rate: dict[str, float]) -> list[Figure]:
    figures = []
    for kind, prefix in (("plain", ""), ("fast", "fast ")):
        limit, fraction = limit_hz(SERVOS, BAUD, kind == "fast"), MIN_WIRE_FRACTIONS[kind == "fast"]
        reach, kept = f">= {fraction:.0%} of {limit:.0f} Hz", rate[kind] >= fraction * limit
        figures += [
            Figure(f"write and {prefix}sync read", rate[kind], "Hz"),
            Figure("  of the wire limit", 100 * rate[kind] / limit, "%", reach, kept),
            Figure("  the same bytes without a driver", 100 * rate[f"{kind}_bytes"] / limit, "%"),
        ]
    ratio = rate["plain"] / rate["sdk"]
    return [
        *figures,
        Figure("bare SDK, write and sync read", rate["sdk"], "Hz"),
        Figure("  omote is quicker by", ratio, "x", ">= 1", ratio >= 1),
    ]


def _loop_figures(paced: Loop, sdk_paced: Loop, ticks: Loop, realtime: bool) -> list[Figure]:
    percent, ratio = 100 * paced.processor, sdk_paced.processor / paced.processor
    worst, bound = ticks.late_ms["p99"], 2.0 if realtime else 3.0
    return [
        Figure(f"processor at {PACED_HZ} Hz", percent, "% of a core", "<= 12 %", percent <= 12.0),
        Figure("bare SDK, the same", 100 * sdk_paced.processor, "% of a core"),
        Figure("  omote uses less by", ratio, "x", ">= 2", ratio >= 2.0),
        Figure("write and read, median", paced.cycle_ms["p50"], "ms"),
        Figure("write and read, 99 of 100", paced.cycle_ms["p99"], "ms"),
        Figure("bare SDK, median", sdk_paced.cycle_ms["p50"], "ms"),
        Figure("bare SDK, 99 of 100", sdk_paced.cycle_ms["p99"], "ms"),
        Figure(f"tick at {JITTER_HZ} Hz late by, median", ticks.late_ms["p50"], "ms"),
        Figure(f"tick at {JITTER_HZ} Hz late by, 99 of 100", worst, "ms", f"<= {bound:g} ms", worst <= bound),
    ]


def steal_figures(steal: StealTime, indent: str = "") -> list[Figure]:
    """Return a row with the processor time that the host of a virtual machine took meanwhile, if it is reported."""
    stolen = steal.fraction()
    return [] if stolen is None else [Figure(f"{indent}taken by the host meanwhile", 100 * stolen, "% of all cores")]


def _bench_face(seconds: float, log: Log) -> list[Figure]:
    figures = []
    for name, rate, ordinary in _FACE_RUNS:
        log(f"beside the face, {name}")
        steal = StealTime()
        report, sleeper_ms = _run_program(rate, max(seconds, _MIN_FACE_S), ordinary)
        bus = report["buses"][0]
        bound = 0.5 if rate == _PACED_FPS else 2.0 if bus["realtime"] else 3.0
        worst = bus["jitter_ms"]["p99"]
        figures += [
            Figure(f"face, {name}", report["face"]["frames_per_second"], "frames/s"),
            Figure(f"  bus tick at {JITTER_HZ} Hz late by, 99 of 100", worst, "ms", f"<= {bound:g} ms", worst <= bound),
            Figure("  beside it a program that only sleeps", sleeper_ms, "ms"),
            Figure("  ticks left out", bus["skipped"], f"of {bus['ticks'] + bus['skipped']}"),
            *steal_figures(steal, "  "),
        ]
    return figures


def _run_program(frames_per_second: int, seconds: float, ordinary: bool) -> tuple[dict[str, Any], float]:
    """Run ``omote run everything`` with the bus at 100 Hz and the face at a rate; return its report and a reference.

    The reference is the lateness (ms, 99th percentile) of a program that meanwhile only sleeps from tick to tick, which
    is the best that this machine allows.
    """
    environment = child_environment("controller") | ({NO_REALTIME: "1"} if ordinary else {})
    with tempfile.TemporaryDirectory(prefix="omote-") as folder:
        robot, stage, report = (Path(folder) / name for name in ("robot.toml", "stage.toml", "report.json"))
        settings = tomllib.loads(find_config("robots", "head24").read_text(encoding="utf-8"))
        settings["buses"][0]["rate_hz"] = JITTER_HZ
        robot.write_text(tomli_w.dumps(settings), encoding="utf-8")
        settings = tomllib.loads(find_config("stages", "everything").read_text(encoding="utf-8"))
        settings["robots"], settings["face"]["fps"] = [str(robot)], frames_per_second
        stage.write_text(tomli_w.dumps(settings), encoding="utf-8")
        program = "from controller.cli.app import main; main()"
        command = [sys.executable, "-P", "-c", program, "run", str(stage), "--headless"]
        command += ["--seconds", str(seconds), "--report", str(report)]
        sleeper_command = [sys.executable, "-P", "-c", _SLEEPER, str(JITTER_HZ), str(round(JITTER_HZ * seconds))]
        pipe = subprocess.PIPE
        with subprocess.Popen(sleeper_command, stdin=pipe, stdout=pipe, text=True, env=environment) as sleeper:
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
            late_ms, _ = sleeper.communicate()
        if done.returncode:
            raise RuntimeError(f"omote run failed: {done.stderr.strip() or done.stdout.strip()}")
        found: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
        return found, float(late_ms)


def to_json(tables: list[tuple[str, list[Figure]]]) -> str:
    """Return the tables as JSON: lists of figures by title."""
    plain = {title: [{**asdict(row), "name": row.name.strip()} for row in figures] for title, figures in tables}
    return json.dumps(plain, indent=2)
