"""An hour of a simulated head in a minute or two: the real driver, simulated servos, random faults, no sleeping.

Run ``python benchmarks/soak.py [SECONDS] [SEED]`` (3600 simulated seconds by default). It ends with a table, and with
an error where a value was attributed to the wrong servo, a goal jumped, memory grew or the log was flooded.
"""

from __future__ import annotations

import logging
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from drivers import open_bus
from drivers.base.bus import BusState, ServoSpec
from drivers.base.errors import DriverError, PortLost
from drivers.core.limits import BURST_S
from drivers.sim.serving.virtual import VirtualClock, VirtualLink
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

IDS = tuple(range(1, 9))
RATE_HZ = 50
SPEED_RAD_S = 6.0
FAULT_EVERY_S = 8.0
SPREAD = (0.7, 1.3)
QUIET_S = 3.0
OVER_S = 2.0
"""So long after a fault everything is as before."""
GROWTH_MB = 5.0
LOGS_PER_FAULT = 12
"""Lines that one fault may cause: three for each servo it concerns at the most, as when it begins and ends."""
FAULTS = (
    "mute:{i}", "mute:{i} chain-stop", "silent:{i}", "late:{i}:45ms", "drop:*:p=0.05", "drop:{i}:p=0.5",
    "crc:{i}:every=3",
    "flip:*:p=0.05", "short:{i}:1:every=4", "wrongid:{i}:{j}:every=5", "noise:*:5:p=0.1", "alert:{i}", "hw:{i}:0x20",
    "volts:*:3.0", "temp:{i}:75", "stall:{i}", "eeprom-busy:*:20ms", "echo", "unplug", "pause", "forget:{i}",
)  # fmt: skip
"""Faults of ``drivers.sim.wire.faults``; "pause" is a host that stalls, "forget" a servo that loses its
supply a moment."""


@dataclass
class Soak:
    """What happened.

    Attributes
    ----------
    cycles, faults : how many.
    wrong : fresh positions that were not the servo's.
    jumps : goals further from the last than the speed limit allows.
    left_on : servos with torque after the end.
    growth_mb : resident memory at the end, less that after a tenth of the time.
    logs : log lines by text.
    errors : the driver's own counts.
    apart : the faults came one by one, so each must have been counted once.
    """

    cycles: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    wrong: int = 0
    jumps: int = 0
    left_on: int = 0
    growth_mb: float = 0.0
    logs: Counter[str] = field(default_factory=Counter)
    errors: dict[str, int] = field(default_factory=dict)
    apart: bool = False

    @property
    def miscounted(self) -> list[str]:
        """Kinds of error that the driver did not count once for each servo that had it."""
        letting_go = self.faults["hw"] + self.faults["temp"] + len(IDS) * self.faults["volts"]
        due = {
            "port_lost": self.faults["unplug"],
            "reset": self.faults["forget"],
            "alert": letting_go + self.faults["alert"],
            "torque_lost": letting_go + self.faults["forget"],
        }
        return [f"{kind} counted {self.errors.get(kind, 0)} times, not {n}" for kind, n in due.items()
                if self.errors.get(kind, 0) != n]  # fmt: skip

    @property
    def failures(self) -> list[str]:
        """What is not as it must be."""
        said = sum(self.logs.values())
        allowed = LOGS_PER_FAULT * sum(self.faults.values())
        found = {
            f"{self.wrong} positions of the wrong servo": self.wrong > 0,
            f"{self.jumps} goals beyond the speed limit": self.jumps > 0,
            f"{self.left_on} servos left on": self.left_on > 0,
            f"memory grew by {self.growth_mb:.1f} MB": self.growth_mb > GROWTH_MB,
            f"{said} log lines for {sum(self.faults.values())} faults": said > allowed,
        }
        return [text for text, is_so in found.items() if is_so] + (self.miscounted if self.apart else [])


class Head:
    """A virtual head under random faults.

    Parameters
    ----------
    seed : of everything random.
    """

    def __init__(self, seed: int) -> None:
        self.clock, self.random, self.result = VirtualClock(), random.Random(seed), Soak()
        self.chain = Chain([SimulatedServo(i) for i in IDS], seed=seed)
        specs = [ServoSpec(i, f"servo{i}", "xl330-m288", -1.2, 1.2, SPEED_RAD_S, 60.0) for i in IDS]
        link = VirtualLink(self.chain, self.clock)
        self.bus = open_bus("dynamixel", specs, port=link, clock=self.clock, reboot_faulted=True, margin_s=0.01)
        self._sent: np.ndarray | None = None
        self._sent_s = 0.0
        self._next_fault_s, self._quiet_s = FAULT_EVERY_S, 0.0
        self._limp_since_s: float | None = None
        self._last_s = 0.0
        self.result.apart = FAULT_EVERY_S * SPREAD[0] >= QUIET_S + OVER_S

    def run(self, seconds: float) -> Soak:
        """Drive for so many simulated seconds, then stop and look."""
        self.bus.open()
        self.bus.start()
        tenth, before_mb = seconds / 10.0, 0.0
        self._last_s = seconds - (QUIET_S + OVER_S if self.result.apart else 0.0)  # so that each is over at the end
        while self.clock() < seconds:
            if self.clock() > tenth and not before_mb:
                before_mb = resident_mb()
            self._fault()
            self._cycle()
        self.result.growth_mb = resident_mb() - before_mb
        self._finish()
        return self.result

    def _cycle(self) -> None:
        began = self.clock()
        try:
            self._drive(began)
        except PortLost:
            self.clock.sleep(0.3)
            self._sent = None
            try:
                self.bus.reconnect()
            except DriverError:
                self.clock.sleep(0.5)
        self.result.cycles += 1
        self.clock.wait_until(began + 1.0 / RATE_HZ)

    def _drive(self, now: float) -> None:
        target = np.array([np.sin(0.7 * now + i) for i in IDS])
        sent, sent_s = self.bus.write(target), self.clock()
        if self._sent is not None:
            reach = SPEED_RAD_S * (sent_s - self._sent_s + BURST_S) + 2e-3
            shafts = [servo.position_ticks(sent_s) for servo in self.chain.servos]
            here = self.bus.scale.radians(np.array(shafts))  # a servo whose watchdog tripped begins again where it is
            self.result.jumps += int(np.count_nonzero(np.minimum(abs(sent - self._sent), abs(sent - here)) > reach))
        self._sent, self._sent_s = sent, sent_s
        state = self.bus.read()
        self._compare(state, now)
        self._recover(state)

    def _compare(self, state: BusState, began: float) -> None:
        """Fresh positions against where the shafts were between two moments."""
        for at in np.flatnonzero(state.fresh):
            servo = self.chain.servo(IDS[at])
            places = [servo.drive.to_register(servo.plant.motion(t).position) for t in (began, self.clock())]
            ticks = self.bus.scale.ticks(state.position_rad)[at]
            slack = 3 + 2048 / np.pi * SPEED_RAD_S * 2 * (self.clock() - began)
            self.result.wrong += not min(places) - slack <= ticks <= max(places) + slack

    def _recover(self, state: BusState) -> None:
        """What a user would do about servos that let go, once the fault is over."""
        if state.torque.all() or self.chain.faults.active:
            self._limp_since_s = None
            return
        self._limp_since_s = self._limp_since_s or self.clock()
        if self.clock() - self._limp_since_s > 1.0:
            self._limp_since_s = None
            self._sent = None
            try:
                self.bus.recover([IDS[at] for at in np.flatnonzero(~state.torque)])
            except PortLost:
                raise
            except DriverError:
                return

    def _fault(self) -> None:
        now = self.clock()
        if not self._next_fault_s <= now < self._last_s:
            return
        self._next_fault_s = now + FAULT_EVERY_S * self.random.uniform(*SPREAD)
        i, j = self.random.sample(IDS, 2)
        spec = self.random.choice(FAULTS).format(i=i, j=j)
        self.result.faults[spec.partition(":")[0]] += 1
        if spec == "pause":
            self.clock.sleep(0.5)
            self._sent = None
        elif spec.startswith("forget"):
            self.chain.servo(i).reboot(now)
        else:
            ends = f":for={self.random.uniform(0.5, QUIET_S):.1f}s"
            self.chain.faults.add([part + ends for part in spec.split()], now)

    def _finish(self) -> None:
        self.chain.faults.clear(None, self.clock())
        self.clock.sleep(1.0)
        try:
            self.bus.close()
        finally:
            self.result.left_on = sum(servo.torque for servo in self.chain.servos)
            self.result.errors = self.bus.report().errors


class Counting(logging.Handler):
    """Counts log lines instead of showing them."""

    def __init__(self, lines: Counter[str]) -> None:
        super().__init__()
        self._lines = lines

    def emit(self, record: logging.LogRecord) -> None:
        """One line, by its text without values."""
        self._lines[str(record.msg)] += 1


def soak(seconds: float, seed: int = 1) -> Soak:
    """Run a head for so many simulated seconds."""
    head = Head(seed)
    log, handler = logging.getLogger("drivers"), Counting(head.result.logs)
    log.addHandler(handler)
    try:
        return head.run(seconds)
    finally:
        log.removeHandler(handler)


def resident_mb() -> float:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 2**20


def main() -> int:
    """Run, show what happened, and say whether it is as it must be."""
    seconds, seed = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0, int(sys.argv[2]) if len(sys.argv) > 2 else 1
    logging.getLogger("drivers").propagate = False
    began = time.monotonic()
    result = soak(seconds, seed)
    took = time.monotonic() - began
    table = Table("what", "how many", title=f"{seconds:g} simulated seconds in {took:.0f} s", title_justify="left")
    table.add_row("cycles", str(result.cycles))
    table.add_row("memory", f"{result.growth_mb:+.1f} MB")
    for title, counts in (("fault", result.faults), ("error", result.errors), ("log", result.logs)):
        for name, count in sorted(counts.items()):
            table.add_row(f"{title}: {name}", str(count))
    Console().print(table)
    for failure in result.failures:
        Console(stderr=True).print(failure)
    return 1 if result.failures else 0


if __name__ == "__main__":
    sys.exit(main())
