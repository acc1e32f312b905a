"""controller.panels.session.jobs"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

import pytest

from controller.base.errors import ConfigError, ControllerError
from controller.panels.session.jobs import Cancelled, Job, Jobs, run_program
from controller.panels.session.problems import Problems


def finished(jobs: Jobs) -> None:
    for job in list(jobs.running):
        job.join(30.0)
    jobs()


def test_results_are_taken_by_the_thread_that_asks_and_errors_told() -> None:
    problems = Problems()
    jobs, got = Jobs(problems), []

    def broken(job: Job) -> None:
        raise ConfigError("head: no such file", hint="choose another")

    jobs.start("counting", lambda _: 42, lambda found: got.append((found, threading.current_thread())))
    jobs.start("reading", broken, got.append)
    finished(jobs)
    assert got == [(42, threading.main_thread())] and jobs.running == []
    assert [problem.text for problem in problems.unread] == ["head: no such file (choose another)"]


def test_a_cancelled_or_replaced_job_changes_nothing() -> None:
    jobs, got, go = Jobs(Problems()), [], threading.Event()
    first = jobs.start("loading", lambda _: go.wait(30.0), lambda _: got.append("first"))
    jobs.start("loading", lambda _: go.wait(30.0), lambda _: got.append("second"))
    third = jobs.start("fitting", lambda _: go.wait(30.0), lambda _: got.append("third"))
    third.cancelled = True
    assert first.cancelled
    go.set()
    finished(jobs)
    assert got == ["second"]


def test_who_waits_for_a_job_hears_that_it_was_given_up_but_not_that_it_was_replaced() -> None:
    jobs, heard, go = Jobs(Problems()), [], threading.Event()

    def broken(job: Job) -> None:
        raise ConfigError("head: no such file")

    jobs.start("loading", lambda _: go.wait(30.0), heard.append, lambda: heard.append("replaced"))
    jobs.start("loading", lambda _: go.wait(30.0), heard.append, lambda: heard.append("cancelled")).cancelled = True
    jobs.start("reading", broken, heard.append, lambda: heard.append("failed"))
    jobs.start("counting", lambda _: go.wait(30.0), heard.append, lambda: heard.append("dropped"))
    jobs.drop("counting")
    go.set()
    finished(jobs)
    assert sorted(heard) == ["cancelled", "failed"]


def test_a_program_that_fails_says_why_and_a_cancelled_one_is_ended(tmp_path: Path) -> None:
    job = Job("fitting", lambda _: None, lambda _: None)
    with pytest.raises(ControllerError, match="fitting failed: no mesh here"):
        run_program(job, [sys.executable, "-c", "import sys; sys.exit('no mesh here')"])
    run_program(job, [sys.executable, "-c", "print('done')"])
    pid = tmp_path / "pid"
    wait = f"import os, time; open({str(pid)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    timer = threading.Timer(0.3, lambda: setattr(job, "cancelled", True))
    timer.start()
    with pytest.raises(Cancelled):
        run_program(job, [sys.executable, "-c", wait])
    if pid.exists():
        with pytest.raises(ProcessLookupError):
            os.kill(int(pid.read_text()), 0)
