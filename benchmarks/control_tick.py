"""One tick of the controller: time, memory and latency with 24 channels, 59 parameters and 8 active layers.

Run ``python benchmarks/control_tick.py [--ticks N]``, or with ``--soak`` for a million ticks of hostile input. A tick
is what runs between a command and the bytes on the wire: layers mixed and limited, channels mapped, safety rules and
limits of motion kept. Times are from one run on one machine.
"""

from __future__ import annotations

import argparse
import gc
import resource
import time
import tracemalloc
from collections import Counter
from contextlib import suppress

import numpy as np
from rich.console import Console
from rich.progress import track

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Floats
from controller.base.paths import find_config
from controller.layers.commands import CommandState
from controller.layers.mixer import LayerSettings
from controller.layers.settings import default_layers
from controller.robot.robot import load_robot
from controller.robot.safety import GoalFilter

LAYERS = (*default_layers(), LayerSettings("show", 45, "max"), LayerSettings("twitch", 55, "add", weight=0.2))
DT = 0.01
STEP_NS = 10_000_000
SOURCES = ("speech", "capture", "show", "twitch")
FAR = (-1e9, 1e9, 0.0, 1.0)
POISON = (np.nan, np.inf, -np.inf, *FAR)


class Chain:
    """Everything between a command and a bus, but the threads and the wire."""

    def __init__(self, seed: int = 0) -> None:
        robot = load_robot(find_config("robots", "head24"), P)
        self.state = CommandState(P, layers=LAYERS)
        self.state.live(1.0, 0)
        self.goals = GoalFilter(robot.channels, P, robot.rules, DT)
        self.table, self.sent, self.values = self.goals.table, self.goals.sent, P.neutral()
        self.now_ns = 1_000_000_000
        self._random = np.random.default_rng(seed)

    def feed(self) -> None:
        """Write to every layer, as capture, speech, shows and links would."""
        values = self._random.uniform(P.low, P.high)
        for name in SOURCES:
            self.state.write_layer(name, values, self._random.random(len(P)) < 0.6, self.now_ns)
        self.state.set_parameters([3, 40], values[[3, 40]].tolist(), self.now_ns)
        self.state.gaze(0.1, 0.0, self.now_ns)

    def attack(self) -> None:
        """What a broken or hostile source might do: no numbers, jumps, old stamps, flicker, commands at random."""
        random, state, now = self._random, self.state, self.now_ns
        kinds = random.choice(POISON, len(P)), random.choice(FAR, len(P)), random.choice([P.low, P.high])
        values = kinds[random.choice(3, p=[0.25, 0.25, 0.5])]
        for name in SOURCES:
            if random.random() < 0.5:
                stamp = now - int(random.integers(2)) * 10**9
                with suppress(ParameterError):  # not all values are finite: the source is told so
                    state.write_layer(name, values, random.random(len(P)) < random.random(), stamp)
        at: list[int] = random.integers(0, len(P), 4).tolist()
        match random.integers(0, 6):
            case 0:
                state.set_parameters(at, values[at].tolist(), now)
            case 1:
                state.release(at, now)
            case 2:
                names, length = state.vocabulary.names, None if random.random() < 0.5 else 0.05
                state.expression(names[random.integers(len(names))], random.random(), length, now)
            case 3:
                state.neutral(0.5 * float(random.integers(2)), now)
            case 4:
                state.gaze(random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0), now)
            case 5:
                state.live(float(random.integers(2)), now)

    def tick(self) -> Floats:
        """One tick; (n,) rad that go to the bus."""
        self.now_ns += STEP_NS
        self.state.tick(self.now_ns, DT, self.values)
        return self.goals.step(self.table.angles(self.values)[0])


def measure(chain: Chain, ticks: int) -> Floats:
    """(ticks, 2) ms by the clock and of this thread's processor time.

    Layers are written every third tick, outside the measured time.
    """
    took = np.zeros((ticks, 2))
    for i in range(ticks):
        if i % 3 == 0:
            chain.feed()
        clock, cpu = time.perf_counter_ns(), time.thread_time_ns()
        chain.tick()
        took[i] = (time.perf_counter_ns() - clock) / 1e6, (time.thread_time_ns() - cpu) / 1e6
    return took


def growth(chain: Chain, ticks: int) -> int:
    """Bytes that Python and numpy hold more after ``ticks`` than after a tenth of them."""

    def run(count: int) -> int:
        for i in range(count):
            if i % 3 == 0:
                chain.feed()
            chain.tick()
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    run(200)
    before = run(ticks // 10)
    after = run(ticks)
    tracemalloc.stop()
    return after - before


def ticks_to_output(chain: Chain) -> int:
    """Ticks from a command until the bus is sent something else because of it."""
    chain.state.neutral(0.01, chain.now_ns)
    chain.state.live(0.0, chain.now_ns)
    for _ in range(600):
        chain.tick()
    jaw = chain.table.names.index("jawOpen")
    before = chain.sent[jaw]
    chain.state.set_parameters([P.index("jawOpen")], [1.0], chain.now_ns)
    return next(i for i in range(1, 100) if abs(chain.tick()[jaw] - before) > 1e-9)


def faults(chain: Chain, ticks: range) -> dict[str, int]:
    """Kinds of broken limits at the bus over ``ticks`` of hostile input, and how often."""
    table, way = chain.table, np.array([chain.sent.copy(), *(chain.tick().copy() for _ in range(3))])
    before, speed, push = way[-1], np.diff(way, axis=0)[-1] / DT, np.diff(way, 2, axis=0)[-1] / DT**2
    counts = dict.fromkeys(("not a number", "position", "speed", "acceleration", "jerk"), 0)
    for i in ticks:
        if i % 4 == 0 and i // 2000 % 4:  # now and then silence, for layers to time out
            chain.attack()
        sent = chain.tick()
        now = (sent - before) / DT
        change = (now - speed) / DT
        counts["not a number"] += int(not np.isfinite(sent).all())
        counts["position"] += int(np.any((sent < table.low_rad) | (sent > table.high_rad)))
        counts["speed"] += int(np.any(np.abs(now) > table.max_speed_rad_s * (1 + 1e-9)))
        counts["acceleration"] += int(np.any(np.abs(change) > table.max_accel_rad_s2 * (1 + 1e-6)))
        counts["jerk"] += int(np.any(np.abs(change - push) / DT > table.max_jerk_rad_s3 * (1 + 1e-6)))
        before, speed, push = sent.copy(), now, change
    return counts


def resident_kb() -> int:
    """Most memory this process has held so far (kB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def soak(ticks: int, console: Console) -> None:
    """Hostile ticks, and how much memory they took."""
    chain, tenth = Chain(3), ticks // 10
    faults(chain, range(tenth))
    held, counts, began = [resident_kb()], Counter[str](), time.perf_counter()
    for part in track(range(1, 10), "hostile ticks", console=console, transient=True):
        counts.update(faults(chain, range(part * tenth, (part + 1) * tenth)))
        held.append(resident_kb())
    took = (time.perf_counter() - began) / (9 * tenth)
    broken = ", ".join(f"{kind} {count}" for kind, count in counts.items())
    console.print(f"{ticks} hostile ticks; limits broken at the bus: {broken}")
    console.print(f"resident memory after each tenth of them: {', '.join(str(kb) for kb in held)} kB")
    console.print(f"{took * 1e3:.3f} ms a tick with its checks")
    acted = [f"{rule['rule']} {rule['times']}" for rule in chain.goals.guard.report()]
    console.print(f"rules that acted: {', '.join(acted)}")


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=20_000, help="ticks to measure")
    parser.add_argument("--soak", action="store_true", help="a million hostile ticks instead; takes some minutes")
    given, console = parser.parse_args(), Console(highlight=False)
    if given.soak:
        soak(1_000_000, console)
        return
    chain = Chain()
    measure(chain, 500)
    took = measure(chain, given.ticks)
    active = len(chain.state.mixer.active)
    console.print(f"{len(chain.table.names)} channels, {len(P)} parameters, {active} layers active")
    for name, column in zip(("by the clock", "processor time"), took.T, strict=True):
        median, late = np.percentile(column, [50, 99])
        console.print(f"tick, {name}: median {median:.3f} ms, p99 {late:.3f} ms (reach 0.5 and 1 ms)")
    console.print(f"memory: {growth(Chain(1), given.ticks)} bytes more after {given.ticks} ticks")
    console.print(f"command to output: {ticks_to_output(Chain(2))} tick")
    soak(given.ticks, console)


if __name__ == "__main__":
    main()
