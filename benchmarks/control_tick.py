"""One tick of the controller: time, memory and latency with 24 channels, 59 parameters and 8 active layers.

Run ``python benchmarks/control_tick.py [--ticks N]``. A tick is what runs between a command and the bytes on the
wire: layers mixed and limited, channels mapped, safety rules and limits of motion kept. Times are from one run on one
machine.
"""

from __future__ import annotations

import argparse
import gc
import time
import tracemalloc
from collections.abc import Iterator

import numpy as np
from rich.console import Console

from controller.channels import build_table, limiter_of, play
from controller.commands import CommandState
from controller.mixer import DEFAULT_LAYERS, LayerSettings
from controller.parameters import PARAMETERS as P
from controller.parameters import Floats
from controller.paths import find_config
from controller.robot import load_robot
from controller.safety import Guard

LAYERS = (*DEFAULT_LAYERS, LayerSettings("show", 45, "max"), LayerSettings("twitch", 55, "add", weight=0.2))
DT = 0.01
STEP_NS = 10_000_000


class Line:
    """Everything between a command and a bus, but the threads and the wire."""

    def __init__(self, seed: int = 0) -> None:
        robot = load_robot(find_config("robots", "head24"), P)
        self.table = build_table(robot.channels, P)
        self.state = CommandState(P, layers=LAYERS)
        self.state.live(1.0, 0)
        self.guard = Guard(robot.rules, self.table, *play(robot.channels))
        self.limiter = limiter_of(self.table, DT)
        self.sent, self.values = np.zeros(len(self.table.names)), P.neutral()
        self.now_ns = 1_000_000_000
        self._random = np.random.default_rng(seed)
        self._every = np.ones(len(P), dtype=bool)

    def feed(self, hostile: bool = False) -> None:
        """Write to every layer, as capture, speech, shows and links would."""
        values = self._random.uniform(P.low, P.high)
        if hostile:
            values = self._random.choice([np.nan, np.inf, -1e9, 1e9, 0.0, 1.0], len(P))
        for name in ("speech", "capture", "show", "twitch"):
            self.state.write_layer(name, values, self._random.random(len(P)) < 0.6, self.now_ns)
        self.state.set_parameters([3, 40], values[[3, 40]].tolist(), self.now_ns)
        self.state.gaze(0.1, 0.0, self.now_ns)

    def tick(self) -> Floats:
        """One tick; (n,) rad that go to the bus."""
        self.now_ns += STEP_NS
        self.state.tick(self.now_ns, DT, self.values)
        angles, _ = self.table.angles(self.values)
        allowed = self.guard.apply(angles, self.sent, self.limiter.rest(DT), None, DT)
        return self.limiter.step(DT, allowed, self.sent)


def measure(line: Line, ticks: int) -> Floats:
    """(ticks, 2) ms by the clock and of this thread's processor time.

    Layers are written every third tick, outside the measured time.
    """
    took = np.zeros((ticks, 2))
    for i in range(ticks):
        if i % 3 == 0:
            line.feed()
        clock, cpu = time.perf_counter_ns(), time.thread_time_ns()
        line.tick()
        took[i] = (time.perf_counter_ns() - clock) / 1e6, (time.thread_time_ns() - cpu) / 1e6
    return took


def growth(line: Line, ticks: int) -> int:
    """Bytes that Python and numpy hold more after ``ticks`` than after a tenth of them."""

    def run(count: int) -> int:
        for i in range(count):
            if i % 3 == 0:
                line.feed()
            line.tick()
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    run(200)
    before = run(ticks // 10)
    after = run(ticks)
    tracemalloc.stop()
    return after - before


def ticks_to_output(line: Line) -> int:
    """Ticks from a command until the bus is sent something else because of it."""
    line.state.neutral(0.01, line.now_ns)
    line.state.live(0.0, line.now_ns)
    for _ in range(600):
        line.tick()
    jaw = line.table.names.index("jawOpen")
    before = line.sent[jaw]
    line.state.set_parameters([P.index("jawOpen")], [1.0], line.now_ns)
    return next(i for i in range(1, 100) if abs(line.tick()[jaw] - before) > 1e-9)


def faults(line: Line, ticks: int) -> Iterator[tuple[str, int]]:
    """Kinds of broken limits over ``ticks`` of hostile input, and how often."""
    table, before, speed = line.table, line.sent.copy(), np.zeros(len(line.sent))
    counts = dict.fromkeys(("position", "speed", "acceleration", "not a number"), 0)
    for i in range(ticks):
        if i % 4 == 0:
            line.feed(hostile=i % 8 == 0)
        sent = line.tick()
        now = (sent - before) / DT
        counts["not a number"] += int(not np.isfinite(sent).all())
        counts["position"] += int(np.any((sent < table.low_rad) | (sent > table.high_rad)))
        counts["speed"] += int(np.any(np.abs(now) > table.max_speed_rad_s * (1 + 1e-9)))
        counts["acceleration"] += int(np.any(np.abs(now - speed) / DT > table.max_accel_rad_s2 * (1 + 1e-6)))
        before, speed = sent.copy(), now
    yield from counts.items()


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=20_000, help="ticks to measure; 1000000 takes some minutes")
    ticks, console = parser.parse_args().ticks, Console(highlight=False)
    line = Line()
    measure(line, 500)
    took = measure(line, min(ticks, 20_000))
    active = sum(1 for layer in line.state.mixer.layers if layer.level.any())
    console.print(f"{len(line.table.names)} channels, {len(P)} parameters, {active} layers active")
    for name, column in zip(("by the clock", "processor time"), took.T, strict=True):
        median, late = np.percentile(column, [50, 99])
        console.print(f"tick, {name}: median {median:.3f} ms, p99 {late:.3f} ms (reach 0.5 and 1 ms)")
    console.print(f"memory: {growth(Line(1), ticks // 4)} bytes more after {ticks // 4} ticks")
    console.print(f"command to output: {ticks_to_output(Line(2))} tick")
    broken = ", ".join(f"{kind} {count}" for kind, count in faults(Line(3), ticks))
    console.print(f"limits broken in {ticks} hostile ticks: {broken}")


if __name__ == "__main__":
    main()
