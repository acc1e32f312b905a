"""Pairs and triples of faults on a simulated bus, with replugs, while commands come; no sleeping.

Run ``python benchmarks/fault_soak.py [SECONDS] [SEED]`` (3600 simulated seconds by default, and as many more as every
pair of faults takes to come once). It ends with a table, and with an error where a position was not the servo's, a goal
jumped, a servo was left on, or the healthy servos were driven in less than 99 % of the time between replugs.

A servo is healthy while no fault changes it or its answers, and from a little after. A fault of the adapter or of the
chain changes all of them, and so does a late answer, which arrives while another servo is asked on the same wire. A
goal jumps where it is further from the servo's last goal, and from where the servo is, than its top speed allows.
"""

from __future__ import annotations

import itertools
import logging
import random
import sys
import time
from collections import Counter, deque
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console
from rich.table import Table

from drivers.base.bus import BusState, ServoSpec
from drivers.base.errors import DriverError, PortLost, PortMissing
from drivers.core.limits import BURST_S
from drivers.sim.serving.virtual import VirtualBus
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.wire.faults import parse_fault

FAMILIES = {"dynamixel": ("xl330-m288",), "feetech": ("sts3215",), "both protocols": ("xl330-m288", "ax-12a")}
"""Families that take turns, and the models of their servos."""
IDS = tuple(range(1, 9))
CYCLE_S = 0.02
SPEED_RAD_S = 6.0
FAULT_S, QUIET_S = (0.3, 2.5), 2.5
"""How long the faults of a group last, and how long nothing happens after them."""
SETTLE_S = 2.5
"""Time in which a servo is driven again after its fault is over."""
DRIVEN = 0.99
FAULTS = (
    "mute:{i}", "silent:{i}", "late:{i}:45ms", "drop:{i}:p=0.5", "crc:{i}:every=3", "flip:{i}:p=0.2",
    "short:{i}:1:every=4", "wrongid:{i}:{j}:every=5", "noise:{i}:5:p=0.3", "alert:{i}", "hw:{i}:0x20", "volts:{i}:3.0",
    "temp:{i}:85", "stall:{i}", "watchdog-ignored:{i}", "dup:{i}", "baud:{i}:57600", "eeprom-busy:{i}:20ms", "echo",
    "chain-stop", "slow-reader:60ms", "unplug",
)  # fmt: skip
"""Every fault of ``drivers.sim.wire.faults``, so that each pair comes; ``stops`` and ``weight`` belong to a joint."""
CORRUPTING = {"crc", "dup", "flip", "noise", "short", "wrongid"}
"""Faults that change bytes of replies."""
RETRY_S = 1.0
"""Time in which a bus drives again after its port is back."""
PATIENCE_S = 60.0
"""Time in which all servos are driven again after a repair; the soak ends with an error otherwise."""


@dataclass
class Result:
    """What happened.

    cycles, groups, replugs : how many. faults : by kind. pairs : that came, of ``wanted``.
    wrong : fresh positions that were not the servo's. unnoticed : the same of Protocol 1.0 under faults that change
        bytes: one such reply in 256 has a right checksum, for it has 8 bits. twins : positions of a second servo with
        the id that answered alone, since the first was silent: nobody can tell it from the first. jumps : goals
        beyond the speed limit.
    driven, healthy : cycles times servos. left_on : servos with torque after the end.
    findings : the first wrong values and jumps.
    """

    cycles: int = 0
    groups: int = 0
    replugs: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    pairs: set[tuple[str, str]] = field(default_factory=set)
    wanted: int = 0
    wrong: int = 0
    unnoticed: int = 0
    twins: int = 0
    jumps: int = 0
    driven: int = 0
    healthy: int = 0
    left_on: int = 0
    findings: list[str] = field(default_factory=list)

    @property
    def share(self) -> float:
        """Share of the time between replugs in which healthy servos were driven."""
        return self.driven / max(self.healthy, 1)

    @property
    def failures(self) -> list[str]:
        """What is not as it must be."""
        found = {
            f"{self.wrong} positions that were not the servo's": self.wrong > 0,
            f"{self.jumps} jumps": self.jumps > 0,
            f"{self.left_on} servos left on": self.left_on > 0,
            f"healthy servos were driven {self.share:.2%} of the time": self.share < DRIVEN,
            f"only {len(self.pairs)} of {self.wanted} pairs came": len(self.pairs) < self.wanted,
        }
        return [text for text, is_so in found.items() if is_so] + self.findings


class Head:
    """A head on a virtual bus, driven as a bus loop does it, under groups of faults.

    name : of ``FAMILIES``. groups : faults that come together, one group after the other.
    """

    def __init__(self, name: str, seed: int, result: Result) -> None:
        models = itertools.cycle(FAMILIES[name])
        self.specs = [ServoSpec(i, f"servo{i}", m, -1.2, 1.2, SPEED_RAD_S, 60.0) for i, m in zip(IDS, models)]  # noqa: B905
        kind = "dynamixel" if name == "both protocols" else name
        self.wire = VirtualBus(self.specs, kind, seed=seed, driver={"margin_s": 0.02})
        self.clock, self.name, self.result, self.random = self.wire.clock, name, result, random.Random(seed)
        self.bus = self.wire.bus(reboot_faulted=True)
        self._written_s = 0.0
        self._well_s = np.zeros(len(IDS))  # from when on each servo counts as healthy
        self._retry_s: float | None = None
        self._there_s = 0.0  # when the port was last seen to be missing

    def start(self) -> None:
        """Open the bus and start the servos."""
        self.bus.open()
        self.bus.start()
        self._written_s = self.clock()

    def run(self, group: tuple[str, ...]) -> None:
        """Let a group of faults come, and some time pass after them."""
        begun, ends = self.clock(), 0.0
        for spec in group:
            ends = max(ends, self._inflict(spec))
        while self.clock() < begun + ends + QUIET_S + SETTLE_S:
            self._cycle()
        self.result.groups += 1
        self._repair()

    def _inflict(self, template: str) -> float:
        """Begin one fault; returns when it ends, from now."""
        i, j = self.random.sample(IDS, 2)
        kind, span_s = template.partition(":")[0], self.random.uniform(*FAULT_S)
        self.wire.fault(f"{template.format(i=i, j=j)}:for={span_s:.2f}s")
        self.result.faults[kind] += 1
        self.result.replugs += kind == "unplug"
        fault = parse_fault(template.format(i=i, j=j))
        everyone = fault.ids is None or kind == "late"
        hit = [at for at, servo in enumerate(IDS) if everyone or servo in (i, j if kind == "wrongid" else i)]
        self._well_s[hit] = np.maximum(self._well_s[hit], self.clock() + span_s + SETTLE_S)
        return span_s

    def _repair(self) -> None:
        """What a person does about servos that let go: switch their power off and on, then start them again."""
        self.wire.clear()
        for servo in self.wire.chain.servos:
            if servo.hardware_error or not servo.torque:
                servo.reboot(self.clock())
                self._well_s[IDS.index(servo.id)] = self.clock() + SETTLE_S
        self.clock.sleep(0.3)
        self._written_s = self.clock()
        give_up_s = self.clock() + PATIENCE_S
        while not self._recovered():
            if self.clock() > give_up_s:
                off = [i for i, driven in zip(IDS, self.bus.driven, strict=True) if not driven]
                raise RuntimeError(f"{self.name}: servos {off} were not driven again {PATIENCE_S:g} s after a repair")
            self._cycle()

    def _recovered(self) -> bool:
        off = [servo.id for servo in self.wire.chain.servos if not servo.torque]
        if off and self.bus.is_open and self.bus.running:
            try:
                self.bus.recover(off)  # type: ignore[attr-defined]
            except DriverError as error:
                logging.getLogger("drivers").debug("%s", error)
        return self.bus.is_open and bool(self.bus.driven.all()) and not off

    def _cycle(self) -> None:
        began = self.clock()
        try:
            if self._retry_s is None:
                self._drive(began)
            elif began >= self._retry_s:
                self.bus.reconnect()
                self._retry_s, self._written_s = None, self.clock()
        except (PortLost, PortMissing):
            self._retry_s = self._there_s = began
        except DriverError:
            self._retry_s = began + RETRY_S / 2
        if self._retry_s is not None and began > self._there_s + RETRY_S:
            self.result.healthy += int((self._well_s <= began).sum())
        self.result.cycles += 1
        self.clock.wait_until(began + CYCLE_S)

    def _drive(self, now: float) -> None:
        before, places = self._registers(now)
        target = np.array([np.sin(0.9 * now + i) for i in IDS])
        span_s, self._written_s = now - self._written_s, now
        self.bus.write(target)
        after, _ = self._registers(self.clock())
        self._check_goals(before, after, places, span_s)
        active = self._active()
        state = self.bus.read()
        self._compare(state, now, active | self._active())  # some end while the bus is read
        well = self._well_s <= now
        self.result.healthy += int(well.sum())
        self.result.driven += int((well & self.bus.driven).sum())

    def _registers(self, now: float) -> tuple[np.ndarray, np.ndarray]:
        """Goals and shafts of the servos, rad."""
        servos = [self.wire.chain.servo(i) for i in IDS]
        goals = [_angle(servo, servo.goal) for servo in servos]
        return np.array(goals), np.array([_angle(servo, servo.position_ticks(now)) for servo in servos])

    def _check_goals(self, before: np.ndarray, after: np.ndarray, places: np.ndarray, span_s: float) -> None:
        reach = SPEED_RAD_S * (min(span_s, BURST_S) + BURST_S) + 0.02
        far = (after != before) & (np.minimum(abs(after - before), abs(after - places)) > reach)
        on = np.array([self.wire.chain.servo(i).torque for i in IDS])
        for at in np.flatnonzero(far & on):
            self.result.jumps += 1
            self._tell(f"servo {IDS[at]}: a goal {after[at] - before[at]:+.2f} rad from the last")

    def _active(self) -> set[str]:
        """Kinds of the faults at present."""
        return {fault.kind for fault in self.wire.line.faults.active}

    def _compare(self, state: BusState, began: float, active: set[str]) -> None:
        """Fresh positions against where the shafts were between two moments, under some kinds of faults."""
        for at in np.flatnonzero(state.fresh):
            servo = self.wire.chain.servo(IDS[at])
            if not self._is_at(servo, state.position_rad[at], began):
                if any(self._is_at(twin, state.position_rad[at], began) for twin in self.wire.chain.twins(servo.id)):
                    self.result.twins += 1
                    continue
                if servo.table.protocol == 1 and active & CORRUPTING:
                    self.result.unnoticed += 1
                    continue
                self.result.wrong += 1
                place = _angle(servo, servo.position_ticks(self.clock()))
                self._tell(f"servo {IDS[at]}: {state.position_rad[at]:.2f} rad read, it is at {place:.2f}; {active}")

    def _is_at(self, servo: SimulatedServo, position_rad: float, began: float) -> bool:
        """Whether a shaft can have been there between two moments."""
        moments = (began, self.clock())
        places = [_angle(servo, servo.drive.to_register(servo.plant.motion(t).position)) for t in moments]
        slack = 0.03 + SPEED_RAD_S * 2 * (self.clock() - began)
        return min(places) - slack <= position_rad <= max(places) + slack

    def _tell(self, what: str) -> None:
        if len(self.result.findings) < 10:
            self.result.findings.append(f"{self.name}, {self.clock():.2f} s: {what}")

    def finish(self) -> None:
        """Stop, and look which servos are on."""
        self.bus.close()
        self.result.left_on += sum(servo.torque for servo in self.wire.chain.servos)


def _angle(servo: SimulatedServo, ticks: float) -> float:
    return (ticks - servo.table.center) * servo.table.rad_per_tick


def groups(seed: int) -> deque[tuple[str, ...]]:
    """Every pair of faults once, in random order, every third with a third fault."""
    chosen = random.Random(seed)
    pairs: list[tuple[str, ...]] = list(itertools.combinations(FAULTS, 2))
    chosen.shuffle(pairs)
    return deque(pair + ((chosen.choice(FAULTS),) if at % 3 == 0 else ()) for at, pair in enumerate(pairs))


def soak(
    seconds: float, seed: int = 1, families: tuple[str, ...] = tuple(FAMILIES), *, all_pairs: bool = True
) -> Result:
    """Run heads for so many simulated seconds in all, or until every pair has come."""
    result, spent, turn = Result(), 0.0, 0
    result.wanted = len(groups(seed)) if all_pairs else 0
    waiting = groups(seed)
    for name in itertools.cycle(families):
        head = Head(name, seed + turn, result)
        head.start()
        for _ in range(10):
            if not waiting:
                waiting = groups(seed + 1 + turn)
            group = waiting.popleft()
            head.run(group)
            kinds = [each.partition(":")[0] for each in group]
            result.pairs |= {(min(pair), max(pair)) for pair in itertools.combinations(kinds, 2) if pair[0] != pair[1]}
            if spent + head.clock() >= seconds and len(result.pairs) >= result.wanted:
                break
        head.finish()
        spent, turn = spent + head.clock(), turn + 1
        print(f"{spent:.0f} simulated seconds, {len(result.pairs)} pairs", file=sys.stderr)  # noqa: T201  progress
        if spent >= seconds and len(result.pairs) >= result.wanted:
            return result
    raise AssertionError("there is a family")


def main() -> int:
    """Run, show what happened, and say whether it is as it must be."""
    seconds, seed = float(sys.argv[1]) if len(sys.argv) > 1 else 3600.0, int(sys.argv[2]) if len(sys.argv) > 2 else 1
    logging.getLogger("drivers").propagate = False
    logging.getLogger("drivers").addHandler(logging.NullHandler())
    began = time.monotonic()
    result = soak(seconds, seed)
    took = time.monotonic() - began
    title = f"{result.cycles * CYCLE_S:.0f} simulated seconds in {took:.0f} s"
    table = Table("what", "how many", title=title, title_justify="left")
    rows = {
        "groups of faults": result.groups,
        "pairs of faults": f"{len(result.pairs)} of {result.wanted}",
        "replugs": result.replugs,
        "wrong values": result.wrong,
        "wrong values with a right 8 bit checksum": result.unnoticed,
        "values of a second servo that answered alone": result.twins,
        "jumps": result.jumps,
        "healthy servos driven": f"{result.share:.3%}",
        "servos left on": result.left_on,
    }
    for name, value in (rows | {f"fault: {kind}": n for kind, n in sorted(result.faults.items())}).items():
        table.add_row(name, str(value))
    Console().print(table)
    for failure in result.failures:
        Console(stderr=True).print(failure, markup=False)
    return 1 if result.failures else 0


if __name__ == "__main__":
    sys.exit(main())
