"""What ``omote bench bus`` measures: a simulated wire of 24 servos, driven by omote and by the bare SDK.

The wire takes its time in both directions (``drivers.sim``, ``wire=True``), so the limit of a loop is known: bytes
times ten bits over the baud rate, as the servos' return delay is 0. All of it runs on this machine's processors,
the simulated servos (in a process of their own) too.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import dynamixel_sdk as sdk
import numpy as np
from numpy.typing import NDArray

from controller.base.clock import Clock, Samples
from controller.base.paths import find_config
from controller.base.steal_time import StealTime
from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.children import environment as child_environment
from drivers.base.priority import NO_REALTIME, request_realtime, restore_priority, shorten_thread_switches
from drivers.dynamixel.frames import GoalFrame, GroupRead, Run
from drivers.port.serialport import SerialPort
from drivers.sim import SimulatedBus

Tell = Callable[[str], None]
Cycle = Callable[["NDArray[np.float64]"], "bool | NDArray[np.bool_]"]
"""One write of goals (n,) rad and one read; who answered."""

SERVOS = 24
BAUD = 1_000_000
PACED_HZ = 50
JITTER_HZ = 100
GOAL, POSITION, WIDTH = 116, 132, 4
ROUNDS = 3
_SWING_RAD = 0.3
_WARM = 40
_AS_FAST_AS_IT_CAN, _PACED_FPS = 1000, 30
_FACE_SECONDS = 10.0
"""At least: of less, the first second, when servos are started and the face is first drawn, is the worst hundredth."""
_FACE = (("as fast as it can, ordinary priority", _AS_FAST_AS_IT_CAN, True),
         ("as fast as it can", _AS_FAST_AS_IT_CAN, False), ("30 frames/s", _PACED_FPS, False))  # fmt: skip
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
"""Until its standard input ends; what it says is of the newest ticks, as the program takes long to load."""


@dataclass(frozen=True)
class Line:
    """One line of the report.

    Attributes
    ----------
    name, unit : what was measured.
    value : the figure.
    reach : what it shall be, as text; empty where nothing is asked.
    kept : whether it is.
    """

    name: str
    value: float
    unit: str
    reach: str = ""
    kept: bool | None = None


@dataclass(frozen=True)
class Loop:
    """How a loop of one write and one read went.

    Attributes
    ----------
    rate_hz : cycles per second, of those in which every servo answered.
    processor : share of one core that the calling thread used.
    cycle_ms : wall time of one write and one read.
    late_ms : how late each tick began; empty where nothing was paced.
    """

    rate_hz: float
    processor: float
    cycle_ms: dict[str, float]
    late_ms: dict[str, float]


def limit_hz(servos: int, baud: int, fast: bool) -> float:
    """Cycles per second that the wire allows: a sync write and a sync read of 4 bytes for each servo.

    Bytes (ROBOTIS e-Manual, Protocol 2.0): 14 + n (1 + 4) for the write, 14 + n for the request, n (11 + 4) for
    the replies or 8 + n (4 + 4) for one joint reply.
    """
    write, request = 14 + servos * (1 + WIDTH), 14 + servos
    replies = 8 + servos * (4 + WIDTH) if fast else servos * (11 + WIDTH)
    return baud / (10.0 * (write + request + replies))


def bench_bus(seconds: float, tell: Tell, *, face: bool = False) -> list[tuple[str, list[Line]]]:
    """Tables of rates, processor time, latency and jitter.

    Parameters
    ----------
    seconds : for each measurement.
    tell : told what is measured now.
    face : also run the whole program, face and body, and measure the jitter of its bus.
    """
    specs = [ServoSpec(i + 1, f"servo{i + 1}", "xl330-m288", -1.0, 1.0, 6.0, 60.0) for i in range(SERVOS)]
    shorten_thread_switches()
    realtime = request_realtime()
    title = f"{SERVOS} servos at {BAUD} baud, wire-timed" + (", real-time priority" if realtime else "")
    steal = StealTime()
    with SimulatedBus(specs, process=True, wire=True, baud=BAUD) as wire:
        free = [_round(wire, specs, seconds, k, tell) for k in range(ROUNDS)]
        tell(f"sync read, {PACED_HZ} Hz")
        paced = _ours(wire, specs, seconds, False, PACED_HZ)
        tell(f"sync read, {JITTER_HZ} Hz")
        ticks = _ours(wire, specs, seconds, False, JITTER_HZ)
        tell(f"the bare SDK, {PACED_HZ} Hz")
        bare_paced = _theirs(wire.path, seconds, PACED_HZ)
    tables = [(title, _rates(free) + _costs(paced, bare_paced) + _jitter(ticks, realtime) + _taken(steal))]
    if face:
        restore_priority()  # programs that are started would have it too, the picture's among them
        tables.append(("the whole program: face and body, simulated head of 24 servos", _beside_face(seconds, tell)))
    return tables


@dataclass(frozen=True)
class Round:
    """Cycles per second of loops that ran one behind the other, each as fast as it can.

    Attributes
    ----------
    plain, fast : omote's, by sync reads and by fast ones.
    plain_bytes, fast_bytes : the same packets sent and as many bytes awaited, nothing else.
    bare : the bare SDK's, by sync reads.
    """

    plain: float
    fast: float
    plain_bytes: float
    fast_bytes: float
    bare: float


def _round(wire: SimulatedBus, specs: list[ServoSpec], seconds: float, number: int, tell: Tell) -> Round:
    tell(f"loops as fast as they can, {number + 1} of {ROUNDS}")
    plain, fast = (_ours(wire, specs, seconds, fast, 0.0).rate_hz for fast in (False, True))
    plain_bytes, fast_bytes = (_bytes(wire.path, seconds, fast).rate_hz for fast in (False, True))
    return Round(plain, fast, plain_bytes, fast_bytes, _theirs(wire.path, seconds, 0.0).rate_hz)


def _ours(wire: SimulatedBus, specs: list[ServoSpec], seconds: float, fast: bool, rate_hz: float) -> Loop:
    """Our own loop; `rate_hz` 0 for as many cycles as there can be."""
    options: dict[str, Any] = {"fast": fast, "feedback": "position", "slow_group": 0, "watchdog_ms": 0}
    with open_bus("dynamixel", specs, port=wire.path, baud=BAUD, **options) as bus:
        bus.start()
        return measure_loop(_cycle_of(bus), seconds, rate_hz)


def _bytes(path: str, seconds: float, fast: bool) -> Loop:
    """What is left when nobody makes or understands the packets: less a program cannot do."""
    ids = tuple(range(1, SERVOS + 1))
    goals = GoalFrame(ids, GOAL, WIDTH, np.arange(SERVOS)).encode(np.full(SERVOS, 2048, np.int32))
    read, port = GroupRead((Run(ids, POSITION, WIDTH),), fast), SerialPort(path, BAUD)

    def cycle(_: object) -> bool:
        port.write(goals)
        port.write(read.frame)
        missing, deadline_s = read.size, time.monotonic() + 1.0
        while missing > 0 and (data := port.read(deadline_s)):
            missing -= len(data)
        return missing == 0

    port.open()
    try:
        return measure_loop(cycle, seconds, 0.0)
    finally:
        port.close()


def _cycle_of(bus: Bus) -> Cycle:
    def cycle(angle_rad: NDArray[np.float64]) -> NDArray[np.bool_]:
        bus.write(angle_rad)
        return bus.read().fresh

    return cycle


def _theirs(path: str, seconds: float, rate_hz: float) -> Loop:
    """The same goals and positions through the SDK's own group classes, at ordinary priority: as it waits by asking
    again and again, with a better one it keeps the system from carrying the bytes it waits for, gives up, and takes
    late replies for those to its next question.
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
    """Run cycles for some time, paced or one behind the other."""
    targets = _targets()
    for k in range(_WARM):
        cycle(targets[k])
    clock = Clock(rate_hz or 1.0)
    began, used, end = time.monotonic(), time.thread_time(), time.monotonic() + seconds
    ticks = clock.run(lambda: time.monotonic() < end) if rate_hz else _without_pause(end)
    times, answers = Samples(), []
    for k, _ in enumerate(ticks):
        start = time.perf_counter()
        answers.append(cycle(targets[k % len(targets)]))
        times.add(1e3 * (time.perf_counter() - start))
    wall, used = time.monotonic() - began, time.thread_time() - used
    whole = sum(bool(np.all(answered)) for answered in answers)
    return Loop(whole / wall, used / wall, times.summary(), clock.jitter_ms.summary() if rate_hz else {})


def _without_pause(end_s: float) -> Iterator[float]:
    while (now := time.monotonic()) < end_s:
        yield now


def _targets() -> NDArray[np.float64]:
    """One slow swing of all servos, (314, n) rad."""
    swing = _SWING_RAD * np.sin(np.arange(314) / 50)
    return np.repeat(swing[:, np.newaxis], SERVOS, axis=1)


# ---------------------------------------------------------------------------- what is asked of the figures


def _rates(rounds: list[Round]) -> list[Line]:
    """Of each kind of loop the median round, as a host that is busy elsewhere may take the processor from any."""
    rate = {field.name: float(np.median([getattr(one, field.name) for one in rounds])) for field in fields(Round)}
    lines = []
    for kind, prefix, share in (("plain", "", 0.92), ("fast", "fast ", 0.85)):
        limit = limit_hz(SERVOS, BAUD, kind == "fast")
        reach, kept = f">= {share:.0%} of {limit:.0f} Hz", rate[kind] >= share * limit
        lines += [
            Line(f"write and {prefix}sync read", rate[kind], "Hz"),
            Line("  of the wire limit", 100 * rate[kind] / limit, "%", reach, kept),
            Line("  the same bytes without a driver", 100 * rate[f"{kind}_bytes"] / limit, "%"),
        ]
    ratio = rate["plain"] / rate["bare"]
    return [
        *lines,
        Line("bare SDK, write and sync read", rate["bare"], "Hz"),
        Line("  omote is quicker by", ratio, "x", ">= 1", ratio >= 1),
    ]


def _costs(paced: Loop, bare: Loop) -> list[Line]:
    share = 100 * paced.processor
    ratio = bare.processor / paced.processor
    return [
        Line(f"processor at {PACED_HZ} Hz", share, "% of a core", "<= 12 %", share <= 12.0),
        Line("bare SDK, the same", 100 * bare.processor, "% of a core"),
        Line("  omote uses less by", ratio, "x", ">= 2", ratio >= 2.0),
        Line("write and read, median", paced.cycle_ms["p50"], "ms"),
        Line("write and read, 99 of 100", paced.cycle_ms["p99"], "ms"),
        Line("bare SDK, median", bare.cycle_ms["p50"], "ms"),
        Line("bare SDK, 99 of 100", bare.cycle_ms["p99"], "ms"),
    ]


def _jitter(ticks: Loop, realtime: bool) -> list[Line]:
    worst, bound = ticks.late_ms["p99"], 2.0 if realtime else 3.0
    return [
        Line(f"tick at {JITTER_HZ} Hz late by, median", ticks.late_ms["p50"], "ms"),
        Line(f"tick at {JITTER_HZ} Hz late by, 99 of 100", worst, "ms", f"<= {bound:g} ms", worst <= bound),
    ]


def _taken(steal: StealTime, indent: str = "") -> list[Line]:
    """What the host of a virtual machine kept from this one while it was measured."""
    share = steal.share()
    return [] if share is None else [Line(f"{indent}taken by the host meanwhile", 100 * share, "% of all cores")]


# ---------------------------------------------------------------------------- beside the face


def _beside_face(seconds: float, tell: Tell) -> list[Line]:
    lines = []
    for name, rate, ordinary in _FACE:
        tell(f"beside the face, {name}")
        steal = StealTime()
        report, sleeper = _run_program(rate, max(seconds, _FACE_SECONDS), ordinary)
        bus = report["buses"][0]
        bound = 0.5 if rate == _PACED_FPS else 2.0 if bus["realtime"] else 3.0
        worst = bus["jitter_ms"]["p99"]
        lines += [
            Line(f"face, {name}", report["face"]["frames_per_second"], "frames/s"),
            Line(f"  bus tick at {JITTER_HZ} Hz late by, 99 of 100", worst, "ms", f"<= {bound:g} ms", worst <= bound),
            Line("  beside it a program that only sleeps", sleeper, "ms"),
            Line("  ticks left out", bus["skipped"], f"of {bus['ticks'] + bus['skipped']}"),
            *_taken(steal, "  "),
        ]
    return lines


def _run_program(frames_per_second: int, seconds: float, ordinary: bool) -> tuple[dict[str, Any], float]:
    """The report of ``omote run everything`` with the bus at 100 Hz and the face at a rate, and how late (ms, 99 of
    100) a program is meanwhile that does nothing but sleep from tick to tick: less is not to be had on the machine.
    """
    environment = child_environment("controller") | ({NO_REALTIME: "1"} if ordinary else {})
    with tempfile.TemporaryDirectory(prefix="omote-") as folder:
        robot, stage, report = (Path(folder) / name for name in ("robot.toml", "stage.toml", "report.json"))
        _write_changed(find_config("robots", "head24"), robot, {"rate_hz": str(JITTER_HZ)})
        changes = {"fps": str(frames_per_second), "robots": json.dumps([str(robot)])}
        _write_changed(find_config("stages", "everything"), stage, changes)
        program = "from controller.cli.app import main; main()"
        command = [sys.executable, "-P", "-c", program, "run", str(stage), "--headless"]
        command += ["--seconds", str(seconds), "--report", str(report)]
        with subprocess.Popen(
            [sys.executable, "-P", "-c", _SLEEPER, str(JITTER_HZ), str(round(JITTER_HZ * seconds))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        ) as sleeper:
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
            late_ms, _ = sleeper.communicate()
        if done.returncode:
            raise RuntimeError(f"omote run failed: {done.stderr.strip() or done.stdout.strip()}")
        found: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
        return found, float(late_ms)


def _write_changed(source: Path, target: Path, changes: dict[str, str]) -> None:
    """A copy of a TOML file with other values for some of its keys, wherever they stand."""
    lines = source.read_text(encoding="utf-8").splitlines()
    for at, line in enumerate(lines):
        key = line.partition("=")[0].strip()
        if key in changes:
            lines[at] = f"{key} = {changes[key]}"
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def to_json(tables: list[tuple[str, list[Line]]]) -> str:
    """The tables for programs: by title, a list of lines."""
    plain = {title: [{**asdict(line), "name": line.name.strip()} for line in lines] for title, lines in tables}
    return json.dumps(plain, indent=2)
