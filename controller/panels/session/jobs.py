"""Long work in background threads: each job can be cancelled, and its result is delivered in the window's thread."""

from __future__ import annotations

import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from controller.base.errors import ControllerError
from controller.panels.session.problems import Problems

_LOOK_S = 0.05
_END_S = 5.0


class Cancelled(Exception):
    """A job was cancelled."""


class Job:
    """Work in a thread of its own.

    title : shown to the user. done : gets the result, in the window's thread. given_up : is called there instead if the
    user cancels the job or it fails.

    Attributes
    ----------
    cancelled : by the user. replaced : dropped for another job. since_s : when it began.
    """

    def __init__(
        self, title: str, work: Callable[[Job], Any], done: Callable[[Any], None],
        given_up: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.title, self._work, self._done, self._given_up = title, work, done, given_up
        self.cancelled = self.replaced = False
        self.since_s = time.monotonic()
        self._result: Any = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name=title, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._result = self._work(self)
        except BaseException as error:  # noqa: BLE001  finish() reports it
            self._error = error

    @property
    def running(self) -> bool:
        """Whether it still runs."""
        return self._thread.is_alive()

    def join(self, limit_s: float) -> None:
        """Wait for its end."""
        self._thread.join(limit_s)

    def finish(self, problems: Problems) -> None:
        """Deliver the result, or report the error; neither for a cancelled job."""
        if self.replaced:
            return
        try:
            if self.cancelled or self._error is not None:
                self._given_up()
            if self.cancelled:
                return
            if self._error is not None:
                raise self._error
            self._done(self._result)
        except Exception as error:  # noqa: BLE001  the window goes on
            problems.add(error)


class Jobs:
    """The jobs that run now; called once per frame.

    problems : hears of those that fail.
    """

    def __init__(self, problems: Problems) -> None:
        self.running: list[Job] = []
        self._problems = problems

    def start(
        self, title: str, work: Callable[[Job], Any], done: Callable[[Any], None],
        given_up: Callable[[], None] = lambda: None,
    ) -> Job:  # fmt: skip
        """Begin one; one of the same title that still runs is dropped."""
        self.drop(title)
        job = Job(title, work, done, given_up)
        self.running.append(job)
        return job

    def drop(self, title: str) -> None:
        """Drop jobs of a title: their results are no longer needed."""
        for job in self.running:
            if job.title == title:
                job.cancelled = job.replaced = True

    def __call__(self) -> None:
        """Deliver the results of jobs that have ended."""
        for job in [job for job in self.running if not job.running]:
            self.running.remove(job)
            job.finish(self._problems)


def run_program(job: Job, command: Sequence[str]) -> None:
    """Run a program as a job; it is ended where the job is cancelled.

    Raises ControllerError with the program's last words: it failed. Cancelled: it was ended.
    """
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as said:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
        try:
            while process.poll() is None:
                if job.cancelled:
                    raise Cancelled(job.title)
                time.sleep(_LOOK_S)
        finally:
            _end(process)
        said.seek(0)
        words = said.read().strip()
    if process.returncode:
        raise ControllerError(f"{job.title} failed: {' '.join(words.split())[-400:]}")


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
