"""Starts of ``omote run`` that are killed, stopped, or run out of disk, shared memory and descriptors.

Run ``python benchmarks/process_kill.py --count 300 [--seed 1]`` on Linux. Each start drives 24 servos of a simulated
bus and follows a simulated robot host. Then a signal hits one of its processes, or all of them, at a random moment, or
something is used up from the start. After each one the servos must be safe, which is torque off or the bus watchdog
tripped, and no process, shared memory or file may be left; the next start opens the same port. It ends with a table,
and with an error where that did not hold.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from drivers.sim import SimulatedBus

ROOT = Path(__file__).resolve().parent.parent
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGSTOP)
EXHAUSTED = ("disk", "memory", "descriptors")
IDS = range(1, 25)
TRIPPED = 255
END_S = 90.0
SAFE_S = 30.0
MARK = "OMOTE_PROCESS_KILL"
STAGE = (
    'name = "killed"\nrobots = ["robot.toml"]\nliveliness = 1.0\n[[links]]\nport = "simulated"\nscript = "everything"\n'
)


@dataclass
class Result:
    """What happened: starts by what was done to them, exit codes, and what was not as it must be."""

    done: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)


class Head:
    """A simulated head, and starts of ``omote run`` that drive it; a context manager.

    seed : of everything random.
    """

    def __init__(self, seed: int) -> None:
        self.random, self.result = random.Random(seed), Result()
        self._folder = Path(tempfile.mkdtemp(prefix="process-kill-"))
        self.bus = SimulatedBus(IDS)
        self._number = 0

    def __enter__(self) -> Head:
        self.bus.__enter__()
        robot = (ROOT / "configs/robots/head24.toml").read_text(encoding="utf-8")
        wire = f'kind = "dynamixel"\nport = "{self.bus.path}"\nmargin_s = 0.5'
        (self._folder / "robot.toml").write_text(robot.replace('kind = "simulated"', wire), encoding="utf-8")
        (self._folder / "stage.toml").write_text(STAGE, encoding="utf-8")
        return self

    def __exit__(self, *_: object) -> None:
        self.bus.__exit__(None, None, None)
        shutil.rmtree(self._folder, ignore_errors=True)

    def start(self, what: str | None = None) -> None:
        """One start; ``what`` is done to it, something random without."""
        self._number += 1
        what = what or self.random.choice([*(number.name for number in SIGNALS)] * 2 + [*EXHAUSTED])
        with tempfile.TemporaryDirectory(dir=self._folder) as own:
            run = Run(Path(own), self._folder / "stage.toml", f"{os.getpid()}-{self._number}", what, self.random)
            try:
                kind = run.attack()
                end = run.wait()
            finally:
                left = run.left()
            self.result.done[kind] += 1
            self.result.ends[f"{what}: {end}"] += 1
            faults = [*run.faults(), *left, *self._unsafe()]
            faults = [f"start {self._number}, {kind}: {fault}" for fault in faults]
            self.result.failures += faults
            for fault in faults:
                Console(stderr=True).print(fault, markup=False)

    def _unsafe(self) -> list[str]:
        def unsafe() -> list[int]:
            return [
                i for i in IDS if self.bus.servo(i).torque and self.bus.servo(i).register("Bus Watchdog") != TRIPPED
            ]

        wait_until(lambda: not unsafe(), SAFE_S)
        return [f"servos {found} drive on" for found in [unsafe()] if found]


class Run:
    """One ``omote run``: its processes, and what it leaves behind in a folder of its own."""

    def __init__(self, folder: Path, stage: Path, token: str, what: str, rng: random.Random) -> None:
        self._folder, self._token, self._what, self._random = folder, token, what, rng
        self._temporary = folder / "tmp"
        self._temporary.mkdir()
        self._said = folder / "said"
        words = ["run", str(stage), "--no-face"]
        if what in EXHAUSTED:
            words += ["--seconds", "2"]
        if what == "disk":
            words += ["--record", "/dev/full"]
        self._memory = set(os.listdir("/dev/shm"))
        self._ballast = exhaust_memory() if what == "memory" else None
        environment = os.environ | {MARK: token, "TMPDIR": str(self._temporary), "PYTHONPATH": str(ROOT)}
        with self._said.open("wb") as said:
            self._main = subprocess.Popen(
                [sys.executable, "-c", "from controller.cli import main; main()", *words],
                cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
                start_new_session=True, preexec_fn=self._few_descriptors if what == "descriptors" else None,
            )  # fmt: skip

    def _few_descriptors(self) -> None:
        most = 6 + int.from_bytes(os.urandom(1), "big") % 40
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    def attack(self) -> str:
        """Send the signal at a random moment; returns what was done to whom."""
        if self._what in EXHAUSTED:
            return f"no {self._what}"
        number = signal.Signals[self._what]
        wait_until(lambda: self._main.poll() is not None, self._random.uniform(0.0, 8.0))
        processes = self.processes()
        if not processes:
            return "nothing to hit"
        whole = self._random.random() < 0.2
        hit = processes if whole else [self._random.choice(processes)]
        whom = "all" if whole else "main" if hit[0] == self._main.pid else "a child"
        send(hit, number)
        if number == signal.SIGSTOP:
            time.sleep(self._random.uniform(0.2, 3.0))
            send(hit, self._random.choice([signal.SIGCONT, signal.SIGKILL]))
        time.sleep(self._random.uniform(0.0, 1.0))
        with suppress(ProcessLookupError):
            self._main.send_signal(signal.SIGINT)  # what goes on without the one that was hit
        return f"{self._what} to {whom}"

    def wait(self) -> str:
        """Wait for the end of the main process; returns its exit code in words."""
        try:
            code = self._main.wait(END_S)
        except subprocess.TimeoutExpired:
            return "no end"
        return str(code) if code >= 0 else signal.Signals(-code).name

    def faults(self) -> list[str]:
        """What is wrong with how it ended."""
        said = self._said.read_text(encoding="utf-8", errors="replace")
        found = [f"exit code 70: {said[-400:]}"] if self._main.returncode == 70 else []
        if self._main.returncode is None:
            found.append("it does not end")
        if "Traceback" in said:
            found.append("a traceback: " + said[max(0, said.index("Traceback") - 600) :][:5000])
        return found

    def left(self) -> list[str]:
        """What it left behind; ends what is left of its processes."""
        wait_until(lambda: not self.processes(), SAFE_S)
        processes = [(pid, command_of(pid)) for pid in self.processes()]
        send([pid for pid, _ in processes], signal.SIGKILL)
        self._main.wait()
        if self._ballast is not None:
            self._ballast.unlink()
        memory = {name for name in os.listdir("/dev/shm") if name.startswith(("omote", "psm_", "sem."))} - self._memory
        files = [path.name for path in self._temporary.iterdir()]
        found = {"processes": processes, "shared memory": sorted(memory), "files": files}
        return [f"{what} left: {which}" for what, which in found.items() if which]

    def processes(self) -> list[int]:
        """Every process of this start that has not ended, wherever it stands in the tree."""
        return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit() and self._is_own(path)]

    def _is_own(self, path: Path) -> bool:
        try:
            return f"{MARK}={self._token}\0".encode() in (path / "environ").read_bytes()
        except OSError:
            return False


def send(processes: list[int], number: signal.Signals) -> None:
    """Send a signal to processes; those that have ended are left out."""
    for pid in processes:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def command_of(pid: int) -> str:
    """The command line of a process; empty for one that has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")[-200:]
    except OSError:
        return ""


def exhaust_memory() -> Path:
    """Fill /dev/shm; only where it is this process's own, see :func:`main`."""
    ballast = Path("/dev/shm/ballast")
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while file.write(bytes(2**16)):
            pass
    return ballast


def wait_until(condition: Callable[[], object], seconds: float) -> None:
    """Wait for a condition, at most so long."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not condition():
        time.sleep(0.02)


def has_own_memory() -> bool:
    """Whether /dev/shm is the small one that :func:`main` makes; else nobody else's may be filled."""
    return os.statvfs("/dev/shm").f_blocks * os.statvfs("/dev/shm").f_frsize <= 2**20


def main() -> int:
    """Run, show what happened, and say whether it is as it must be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300, help="how many starts")
    parser.add_argument("--seed", type=int, default=1, help="of everything random")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no start after so long")
    options = parser.parse_args()
    if not has_own_memory():  # once more, with a /dev/shm of its own that is small enough to fill
        inside = 'mount -t tmpfs -o size=1m none /dev/shm && exec "$@"'
        words = ["unshare", "--mount", "sh", "-c", inside, "sh", sys.executable, *sys.argv]
        return subprocess.run(words, env=os.environ | {"PYTHONPATH": str(ROOT)}).returncode
    began = time.monotonic()
    with Head(options.seed) as head:
        while sum(head.result.done.values()) < options.count and time.monotonic() - began < options.seconds:
            head.start()
    result = head.result
    table = Table("what", "how many", title=f"{sum(result.done.values())} starts", title_justify="left")
    for title, counts in (("done", result.done), ("end after", result.ends)):
        for name, count in sorted(counts.items()):
            table.add_row(f"{title}: {name}", str(count))
    table.add_row("failures", str(len(result.failures)))
    Console().print(table)
    for failure in result.failures:
        Console(stderr=True).print(failure, markup=False)
    return 1 if result.failures else 0


if __name__ == "__main__":
    sys.exit(main())
