"""SIGINT, SIGTERM and SIGHUP as a flag, so that every way out is the ordinary one."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end: from a service manager, and from a terminal that was closed."""


def endings() -> tuple[signal.Signals, ...]:
    """Those of :data:`ENDINGS` that end this process: under nohup it does not mind that its terminal was closed."""
    return tuple(n for n in ENDINGS if n == signal.SIGTERM or signal.getsignal(n) is not signal.SIG_IGN)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Keep SIGINT waiting, also for a process started meanwhile, which lets it through when it is ready."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # else it starts with the first process, and lets SIGINT through as it does
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_interrupts_through() -> None:
    """End what :func:`interrupts_held` left a new process with."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


@contextmanager
def stop_flag() -> Iterator[threading.Event]:
    """An event that SIGINT or any of :func:`endings` sets; a second SIGINT interrupts at once. Main thread only."""
    flag = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *endings())}

    def note(number: int, _frame: object) -> None:
        if flag.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        flag.set()

    for number in before:
        signal.signal(number, note)
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
