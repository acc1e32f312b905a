"""Damaged files of every kind omote reads, each read in a limited process: ``make fuzz``.

Whatever a file holds, omote answers with one message and exit code 0 or 1, within two seconds of processor time and
500 MB of memory. Files are read by what ``omote check`` or ``omote fit`` call, in processes with everything imported;
what is found is tried again in a process of its own, and by ``--commands`` each file is given to the whole command in
one. Kinds take turns until ``--count`` files of each or ``--minutes`` are through; the same seed damages the same files
in the same way.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import argparse
import io
import os
import random
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from contextlib import nullcontext, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path

from tests.fuzz.corpus import Kind, kinds
from tests.fuzz.mutators import mutate
from tests.fuzz.outcome import PROCESSOR_S, Outcome
from tests.fuzz.processes import Job, Worker, attempt
from tests.fuzz.reading import quickened

TURN = 250  # files of a kind, then comes the next kind
PROGRESS_S = 10.0
MOST_SHOWN = 5  # faults of a kind


def damaged(kind: Kind, seed: int, number: int) -> bytes:
    """One damaged file of a kind; the same for the same seed and number."""
    draw = random.Random(f"{kind.name} {seed} {number}")
    return mutate(draw.choice(kind.seeds), draw)


@dataclass
class Turn:
    """Some files of a kind: the numbers from `first` on."""

    kind: Kind
    first: int
    count: int


@dataclass
class Tally:
    """What came of the files of one kind; faults are (number, fault, first line of the message)."""

    files: int = 0
    refused: int = 0
    longest_s: float = 0.0
    largest_mb: float = 0.0
    faults: list[tuple[int, str, str]] = field(default_factory=list)

    def add(self, number: int, outcome: Outcome) -> None:
        """Count one file."""
        self.files += 1
        self.refused += outcome.code == 1
        self.longest_s = max(self.longest_s, outcome.processor_s)
        self.largest_mb = max(self.largest_mb, outcome.memory_mb)
        if outcome.fault:
            text = (outcome.output.strip().splitlines() or [""])[0]
            self.faults.append((number, outcome.fault, text[:200]))

    def __str__(self) -> str:
        return (
            f"{self.files:7} files  {self.refused:7} refused  {len(self.faults):4} faults  "
            f"at most {self.longest_s:5.2f} s  {self.largest_mb:4.0f} MB"
        )


class Fuzzer:
    """Reads damaged files with several processes and counts what comes of them.

    seed : of all damages. keep : folder for files with a fault. commands : whole commands, a process for each.
    most_s : processor time allowed, but for commands that allow more.
    """

    def __init__(
        self, seed: int, keep: Path | None = None, *, commands: bool = False, most_s: float = PROCESSOR_S
    ) -> None:
        self.tallies: dict[str, Tally] = {}
        self._seed, self._keep, self._commands, self._most_s = seed, keep, commands, most_s
        self._running: dict[Worker, Turn] = {}
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-", dir=_memory())
        self._began_s = self._shown_s = time.monotonic()

    def run(self, turns: Iterator[Turn], jobs: int, end_s: float) -> None:
        """Take all turns, or as many as begin before a time."""
        todo: deque[Turn] = deque()
        with self._folder, nullcontext() if self._commands else quickened():
            while True:
                while len(self._running) < jobs and time.monotonic() < end_s:
                    turn = todo.popleft() if todo else next(turns, None)
                    if turn is None:
                        break
                    self._begin(turn)
                if not self._running:
                    break
                todo += self._listen()
                self._show(last=False)
        self._show(last=True)

    @property
    def faults(self) -> int:
        """How many files had a fault."""
        return sum(len(tally.faults) for tally in self.tallies.values())

    def print_table(self) -> None:
        """A line for each kind, and its first faults with the seed and the number of the file."""
        for name, tally in sorted(self.tallies.items()):
            print(f"{name:14} {tally}")
            for number, fault, text in tally.faults[:MOST_SHOWN]:
                print(f"    {self._seed}/{number}: {fault}: {text}")

    def _begin(self, turn: Turn) -> None:
        def jobs() -> Iterator[Job]:
            with tempfile.TemporaryDirectory(dir=self._folder.name) as folder:
                path = turn.kind.lay_out(Path(folder))
                for number in range(turn.first, turn.first + turn.count):
                    path.write_bytes(damaged(turn.kind, self._seed, number))
                    yield lambda: turn.kind.read(path)

        if self._commands:
            for number in range(turn.first, turn.first + turn.count):
                self._note(turn.kind, number, self._alone(turn.kind, number))
                self._show(last=False)
        else:
            self._running[Worker.start(jobs, self._most_s)] = turn

    def _alone(self, kind: Kind, number: int) -> Outcome:
        """Read a file in a process of its own: by the whole command, or as the workers do."""
        with tempfile.TemporaryDirectory(dir=self._folder.name) as folder:
            path = kind.lay_out(Path(folder))
            path.write_bytes(damaged(kind, self._seed, number))
            if self._commands:
                return attempt(lambda: kind.command(path), kind.most_s)
            return attempt(lambda: kind.read(path), self._most_s)

    def _listen(self) -> Iterator[Turn]:
        """Take what the workers send; gives what those left undone that ended early."""
        connections = {worker.connection: worker for worker in self._running}
        ready = [connections[each] for each in wait(list(connections), timeout=1.0)]  # type: ignore[index]
        for worker in [*ready, *(each for each in self._running if each.is_stuck())]:
            turn = self._running.get(worker)
            outcome = worker.receive() if turn is not None and not worker.is_stuck() else None
            if turn is None:
                continue
            if outcome is not None:
                self._judge(turn.kind, turn.first + worker.done - 1, outcome)
                continue
            del self._running[worker]
            code = worker.end()
            if worker.done == turn.count:
                continue
            self._judge(turn.kind, turn.first + worker.done, Outcome(code, 0.0, 0.0, ""))
            if worker.done + 1 < turn.count:
                yield Turn(turn.kind, turn.first + worker.done + 1, turn.count - worker.done - 1)

    def _judge(self, kind: Kind, number: int, outcome: Outcome) -> None:
        """Count an outcome; what looks like a fault is that of the file only if it alone shows it, too."""
        if outcome.fault:
            alone = self._alone(kind, number)
            if alone.fault:
                outcome = alone
            elif outcome.code not in (0, 1):
                said = f"only after other files: {outcome.fault}: {outcome.output[-1000:]}"
                outcome = Outcome(outcome.code, alone.processor_s, alone.memory_mb, said)
            else:
                outcome = alone
        self._note(kind, number, outcome)

    def _note(self, kind: Kind, number: int, outcome: Outcome) -> None:
        self.tallies.setdefault(kind.name, Tally()).add(number, outcome)
        if outcome.fault and self._keep is not None:
            self._keep.mkdir(parents=True, exist_ok=True)
            stem = f"{kind.name}-{self._seed}-{number}"
            (self._keep / f"{stem}-{Path(kind.file).name}").write_bytes(damaged(kind, self._seed, number))
            (self._keep / f"{stem}.txt").write_text(f"{outcome.fault}\n{outcome.output}", encoding="utf-8")

    def _show(self, *, last: bool) -> None:
        """A line of progress now and then."""
        now_s = time.monotonic()
        if now_s - self._shown_s < PROGRESS_S and not last:
            return
        self._shown_s = now_s
        files = sum(tally.files for tally in self.tallies.values())
        rate = files / max(now_s - self._began_s, 1e-3)
        print(f"{files} files, {rate:.0f} a second, {self.faults} faults", file=sys.stderr, flush=True)


def _memory() -> str | None:
    """A folder in memory, where there is one with room."""
    shared = Path("/dev/shm")
    roomy = shared.is_dir() and os.statvfs(shared).f_bavail * os.statvfs(shared).f_frsize > 1 << 30
    return str(shared) if roomy and os.access(shared, os.W_OK) else None


def turns_of(every: list[Kind], count: int) -> Iterator[Turn]:
    """Turns in which all kinds come to `count` files at about the same time."""
    for first in range(0, count, TURN):
        for kind in every:
            yield Turn(kind, first, min(TURN, count - first))


def warm_up(every: list[Kind]) -> None:
    """Read every good file once in this process, so that what is forked from it has everything imported."""
    for kind in every:
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            path = kind.lay_out(Path(folder))
            for seed in kind.seeds:
                path.write_bytes(seed)
                said = io.StringIO()
                with redirect_stdout(said), redirect_stderr(said):
                    code = kind.read(path)
                if code != 0:
                    raise RuntimeError(f"{kind.name}: a good file is refused: {said.getvalue()}")


def main() -> int:
    """Run, print a table; exit code 1 where any file had a fault."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.files", description=str(__doc__).splitlines()[0])
    parser.add_argument("--count", type=int, default=1000, help="files of each kind (default 1000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: processors)")
    parser.add_argument("--minutes", type=float, default=600.0, help="begin nothing new after so long")
    parser.add_argument("--only", nargs="*", help="kinds (default all)")
    parser.add_argument("--keep", type=Path, help="folder for files that had a fault, with what was said")
    parser.add_argument("--commands", action="store_true", help="give each file to the whole command in a new process")
    given = parser.parse_args()
    every = [kind for kind in kinds() if not given.only or kind.name in given.only]
    warm_up(every)
    if given.commands:
        every = [kind for kind in every if kind.words or kind.read is Kind.read]
    fuzzer = Fuzzer(given.seed, given.keep, commands=given.commands)
    try:
        fuzzer.run(turns_of(every, given.count), given.jobs, time.monotonic() + 60.0 * given.minutes)
    except KeyboardInterrupt:
        print("interrupted: what was read so far", file=sys.stderr)
    finally:
        fuzzer.print_table()
    return int(fuzzer.faults > 0)


if __name__ == "__main__":
    sys.exit(main())
