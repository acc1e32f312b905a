"""Processes that read damaged files: forked from one with everything imported, and limited in what they may use.

A :class:`Worker` reads many files one after the other, which takes as long as omote itself; :func:`attempt` forks a
process for one file alone, which tells what a file does from what those before it left behind.
"""

from __future__ import annotations

import gc
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import IO

from tests.fuzz.outcome import MEMORY_MB, MOST_TEXT, Outcome

WALL_S = 60.0
STATM = Path("/proc/self/statm")
PAGE_MB = resource.getpagesize() / 2**20

Job = Callable[[], int]


@dataclass(eq=False)
class Worker:
    """A forked process that does jobs one after the other and sends the outcome of each.

    heard_s : when it was last heard of. done : how many outcomes were received.
    """

    connection: Connection
    pid: int
    heard_s: float
    done: int = 0

    @classmethod
    def start(cls, jobs: Callable[[], Iterator[Job]], most_s: float) -> Worker:
        """Fork a process that does `jobs`, which it draws one at a time, each in so much processor time."""
        ours, theirs = get_context("fork").Pipe(duplex=False)
        pid = os.fork()
        if pid == 0:
            ours.close()
            _do_all(jobs, theirs, most_s)
        theirs.close()
        return cls(ours, pid, time.monotonic())

    def receive(self) -> Outcome | None:
        """The next outcome; None after the last one. Call it when the connection has something."""
        self.heard_s = time.monotonic()
        try:
            outcome: Outcome = self.connection.recv()
        except (EOFError, OSError):
            return None
        self.done += 1
        return outcome

    def is_stuck(self) -> bool:
        """Whether a file has taken too long by the clock."""
        return time.monotonic() - self.heard_s > WALL_S

    def end(self) -> int:
        """Wait for its end, after a signal where it is stuck; its exit code."""
        if self.is_stuck():
            os.kill(self.pid, signal.SIGKILL)
        self.connection.close()
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def attempt(job: Job, most_s: float) -> Outcome:
    """Do one job in a forked process of its own."""
    with tempfile.TemporaryFile() as output:
        before = int(STATM.read_text().split()[1]) * PAGE_MB  # what the child begins with; not this process's own peak
        child = os.fork()
        if child == 0:
            _do_alone(job, output, most_s)
        status, used = _wait(child, most_s)
        grown = used.ru_maxrss / 1024 - before
        text = _text_of(output)
        return Outcome(os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, grown, text, most_s)


def _wait(child: int, most_s: float) -> tuple[int, resource.struct_rusage]:
    end = time.monotonic() + WALL_S + 10 * most_s
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


def _do_alone(job: Job, output: IO[bytes], most_s: float) -> None:
    """What the forked process does; it never returns."""
    code = 99
    try:
        _limit(output)
        _allow_processor(most_s)
        code = _code_of(job)
    finally:
        os._exit(code)


def _do_all(jobs: Callable[[], Iterator[Job]], connection: Connection, most_s: float) -> None:
    """What the process of a worker does; it never returns."""
    try:
        gc.freeze()  # what was imported stays; searching it again and again would copy its pages
        with tempfile.TemporaryFile() as output:
            _limit(output)
            for job in jobs():
                connection.send(_measured(job, output, most_s))
    except BaseException:  # noqa: BLE001  the parent judges by the code
        os._exit(98)
    os._exit(0)


def _limit(output: IO[bytes]) -> None:
    """Bound the address space, and turn all output to a file."""
    os.dup2(output.fileno(), 1)
    os.dup2(output.fileno(), 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    room = int(int(STATM.read_text().split()[0]) * PAGE_MB + 2 * MEMORY_MB) << 20
    resource.setrlimit(resource.RLIMIT_AS, (room, room))


def _allow_processor(most_s: float) -> None:
    """Let the process run for so long from now on, and some more; then SIGXCPU ends it."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    resource.setrlimit(
        resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime + 3 * most_s) + 1, resource.RLIM_INFINITY)
    )


def _measured(job: Job, output: IO[bytes], most_s: float) -> Outcome:
    """Do one job in a worker."""
    os.ftruncate(output.fileno(), 0)
    os.lseek(output.fileno(), 0, os.SEEK_SET)
    Path("/proc/self/clear_refs").write_text("5")  # the largest memory so far is that of now
    base_mb = int(STATM.read_text().split()[1]) * PAGE_MB
    before_s = time_used()
    _allow_processor(most_s)
    code = _code_of(job)
    spent_s = time_used() - before_s
    own_kb = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    largest_mb = max(int(own_kb.split()[1]), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) / 1024
    return Outcome(code, spent_s, largest_mb - base_mb, _text_of(output), most_s)


def time_used() -> float:
    """Processor time (s) of this process and of those it started that have ended."""
    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(used.ru_utime + used.ru_stime for used in each)


def _code_of(job: Job) -> int:
    """The exit code of a job, all of whose output is written."""
    try:
        return job()
    except BaseException:  # noqa: BLE001  the parent judges by the code
        import traceback

        traceback.print_exc()
        return 99
    finally:
        sys.stdout.flush()
        sys.stderr.flush()


def _text_of(output: IO[bytes]) -> str:
    return os.pread(output.fileno(), MOST_TEXT, 0).decode(errors="replace")
