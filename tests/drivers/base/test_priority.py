"""drivers.base.priority: what a thread gets of the processor, where the system gives it."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from drivers.base import priority

linux = pytest.mark.skipif(sys.platform != "linux", reason="scheduling as Linux has it")


def in_thread(work: Callable[[], object]) -> object:
    """What a function gives in a thread of its own, so that this one keeps its scheduling."""
    got: list[object] = []
    thread = threading.Thread(target=lambda: got.append(work()))
    thread.start()
    thread.join()
    return got[0]


def policy_after(*calls: Callable[[], object]) -> object:
    def work() -> int:
        for call in calls:
            call()
        return os.sched_getscheduler(0)

    return in_thread(work)


@linux
def test_real_time_is_taken_where_it_is_allowed_and_given_back() -> None:
    allowed = in_thread(priority.request_realtime)
    assert policy_after(priority.request_realtime) == (os.SCHED_FIFO if allowed else os.SCHED_OTHER)
    assert policy_after(priority.request_realtime, priority.restore_priority) == os.SCHED_OTHER


@linux
def test_a_priority_that_is_lowered_twice_is_lowered_once() -> None:
    """A test that runs a face in its own process must not slow down all tests after it more and more."""

    def lowered() -> int:
        priority.lower_process_priority()
        return os.getpriority(os.PRIO_PROCESS, 0)  # on Linux that of the calling thread

    assert in_thread(lambda: (lowered(), lowered())) == (5, 5)


@linux
def test_a_face_in_the_process_of_the_tests_leaves_it_its_priority() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    priority.lower_process_priority()
    assert os.getpriority(os.PRIO_PROCESS, 0) == before


@linux
def test_nobody_asks_for_real_time_who_was_told_not_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(priority.NO_REALTIME, "1")
    assert in_thread(priority.request_realtime) is False
    assert policy_after(priority.request_realtime) == os.SCHED_OTHER


@linux
def test_short_turns_are_asked_for_instead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(priority.NO_REALTIME, "1")

    def turn() -> tuple[bool, str]:
        nice = os.getpriority(os.PRIO_PROCESS, 0)
        priority.request_realtime()
        taken = priority.request_short_time_slice()
        assert os.getpriority(os.PRIO_PROCESS, 0) == nice
        told = Path(f"/proc/self/task/{threading.get_native_id()}/sched")
        return taken, told.read_text() if told.exists() else ""

    taken, told = in_thread(turn)
    turns = [line.split(":")[1].strip() for line in told.splitlines() if line.startswith("se.slice")]
    if not taken or not turns:
        pytest.skip("this kernel has no such request, or does not show it")
    assert turns == ["100000"]


def test_a_machine_nobody_knows_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(priority.platform, "machine", lambda: "pdp11")
    assert not priority.request_short_time_slice()


def test_the_system_call_has_its_number_on_each_machine() -> None:
    """Numbers of sched_setattr in the system call tables of Linux; arm64 and riscv share the generic one."""
    generic, arm, x86_32, x86_64 = 274, 380, 351, 314
    numbers = {"x86_64": x86_64, "aarch64": generic, "riscv64": generic, "armv7l": arm, "armv6l": arm, "i686": x86_32}
    assert numbers == priority._SCHED_SETATTR


@linux
def test_waits_end_on_time() -> None:
    get_timer_slack = 30  # PR_GET_TIMERSLACK of linux/prctl.h

    def slack_ns() -> tuple[int, int]:
        before = ctypes.CDLL(None).prctl(get_timer_slack)
        priority.reduce_timer_slack()
        return before, ctypes.CDLL(None).prctl(get_timer_slack)

    before, after = in_thread(slack_ns)  # type: ignore[misc]
    assert before != 1 and after <= 1, "0 in a thread with real-time priority, which has no slack"
