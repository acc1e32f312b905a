"""Damaged files of every kind omote reads, each read in a process of its own: ``make fuzz``.

Whatever a file holds, omote answers with one message and exit code 0 or 1, within two seconds of processor time and
500 MB of memory. Each process is forked from one that has imported everything, so that a file costs a few
milliseconds. Bounded by ``--count`` files of each kind; the same seed damages the same files in the same way.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import io
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from tests.fuzz.corpus import Kind, kinds
from tests.fuzz.mutators import mutate

PROCESSOR_S = 2.0
MEMORY_MB = 500
WALL_S = 20.0


@dataclass(frozen=True)
class Outcome:
    """How a process that read one file ended."""

    code: int
    processor_s: float
    memory_mb: float
    output: str

    @property
    def fault(self) -> str:
        """What is wrong with it; empty when nothing is."""
        if self.code < 0:
            return f"ended by {signal.Signals(-self.code).name}"
        if self.code not in (0, 1):
            return f"exit code {self.code}"
        if "Traceback" in self.output:
            return "a traceback"
        if self.code == 1 and self.output.count("error:") != 1:
            return f"{self.output.count('error:')} messages"
        if self.processor_s > PROCESSOR_S:
            return f"{self.processor_s:.1f} s of processor time"
        return f"{self.memory_mb:.0f} MB" if self.memory_mb > MEMORY_MB else ""


def attempt(read: Callable[[Path], int], path: Path) -> Outcome:
    """Read one file in a forked process with limits of its own."""
    with tempfile.TemporaryFile("w+") as output:
        child = os.fork()
        if child == 0:
            _read_limited(read, path, output.fileno())
        status, used = _wait(child)
        output.seek(0)
        grown = (used.ru_maxrss - resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024
        return Outcome(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, grown, output.read(20_000))


def _read_limited(read: Callable[[Path], int], path: Path, output: int) -> None:
    """What the forked process does; it never returns."""
    code = 99
    try:
        os.dup2(output, 1)
        os.dup2(output, 2)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        room = pages * resource.getpagesize() + (2 * MEMORY_MB << 20)
        resource.setrlimit(resource.RLIMIT_AS, (room, room))
        resource.setrlimit(resource.RLIMIT_CPU, (int(3 * PROCESSOR_S), int(3 * PROCESSOR_S)))
        code = read(path)
    except BaseException:  # noqa: BLE001  the parent judges by the code
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _wait(child: int) -> tuple[int, resource.struct_rusage]:
    end = time.monotonic() + WALL_S
    pause = 0.001
    while time.monotonic() < end:
        pid, status, used = os.wait4(child, os.WNOHANG)
        if pid:
            return status, used
        time.sleep(pause)
        pause = min(2 * pause, 0.02)
    os.kill(child, signal.SIGKILL)  # it waits for something
    _, status, used = os.wait4(child, 0)
    return status, used


def warm_up(kinds: list[Kind]) -> None:
    """Read every good file once in this process, so that what is forked from it has everything imported."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        for kind in kinds:
            path = Path(folder) / kind.name / kind.file
            path.parent.mkdir(parents=True, exist_ok=True)
            for name, data in kind.beside.items():
                (path.parent / name).write_bytes(data)
            for seed in kind.seeds:
                path.write_bytes(seed)
                with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                    kind.read(path)


def damaged(kind: Kind, count: int, seed: int) -> Iterator[bytes]:
    """`count` damaged files of a kind."""
    for number in range(count):
        draw = random.Random(f"{kind.name} {seed} {number}")
        yield mutate(draw.choice(kind.seeds), draw)


def run_kind(kind: Kind, count: int, seed: int, keep: Path | None = None) -> list[tuple[int, Outcome]]:
    """Outcomes of `count` damaged files, those with a fault first kept in the folder `keep`."""
    found = []
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        path = Path(folder) / kind.file
        path.parent.mkdir(parents=True, exist_ok=True)
        for name, data in kind.beside.items():
            (path.parent / name).write_bytes(data)
        for number, data in enumerate(damaged(kind, count, seed)):
            path.write_bytes(data)
            outcome = attempt(kind.read, path)
            found.append((number, outcome))
            if outcome.fault and keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{kind.name}-{seed}-{number}-{path.name}").write_bytes(data)
    return found


def _job(given: tuple[str, int, int, Path | None]) -> tuple[str, int, list[tuple[int, Outcome]]]:
    name, count, seed, keep = given
    found = run_kind(next(kind for kind in _KINDS if kind.name == name), count, seed, keep)
    return name, seed, found


_KINDS: list[Kind] = []


def main() -> int:
    """Run, print a table; exit code 1 where any file had a fault."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.files", description=str(__doc__).splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, help="files of each kind (default 1000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--minutes", type=float, default=600.0, help="begin nothing new after so long")
    parser.add_argument("--only", nargs="*", help="kinds (default all)")
    parser.add_argument("--keep", type=Path, help="folder for files that had a fault")
    given = parser.parse_args()
    _KINDS.extend(kind for kind in kinds() if not given.only or kind.name in given.only)
    warm_up(_KINDS)
    share = max(1, min(given.count // 10, 100))
    jobs = [
        (k.name, share, 1000 * given.seed + part, given.keep) for part in range(given.count // share) for k in _KINDS
    ]
    end = time.monotonic() + 60.0 * given.minutes
    totals: Counter[str] = Counter()
    faults: dict[str, list[str]] = {}
    worst: dict[str, tuple[float, float]] = {}
    with get_context("fork").Pool(given.jobs) as pool:
        for name, seed, found in pool.imap_unordered(_job, jobs):
            if time.monotonic() > end:
                break
            totals[name] += len(found)
            longest, largest = worst.get(name, (0.0, 0.0))
            worst[name] = (
                max(longest, *(o.processor_s for _, o in found)), max(largest, *(o.memory_mb for _, o in found))
            )  # fmt: skip
            for number, outcome in found:
                if outcome.fault:
                    last = (outcome.output.strip().splitlines() or [""])[0]
                    faults.setdefault(name, []).append(f"{seed}/{number}: {outcome.fault}: {last[:160]}")
    for name in sorted(totals):
        longest, largest = worst[name]
        bad = faults.get(name, [])
        print(f"{name:14} {totals[name]:7} files  {len(bad):5} faults  at most {longest:.2f} s  {largest:6.0f} MB")
        for line in bad[:5]:
            print(f"    {line}")
    return int(any(faults.values()))


if __name__ == "__main__":
    sys.exit(main())
