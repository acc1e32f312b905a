"""Turns SIGINT, SIGTERM and SIGHUP into a flag, so that programs end in the ordinary way."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

TERMINATION_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a process to end: from a service manager, and from a terminal that was closed."""


def termination_signals() -> tuple[signal.Signals, ...]:
    """Those of :data:`TERMINATION_SIGNALS` that end this process; under nohup SIGHUP is ignored."""
    return tuple(n for n in TERMINATION_SIGNALS if n == signal.SIGTERM or signal.getsignal(n) is not signal.SIG_IGN)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block SIGINT and :data:`TERMINATION_SIGNALS`, also in a process started meanwhile, until that calls
    :func:`unblock_signals`.

    A program that was ended halfway through starting a process would leave one that cannot read what it shall do.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # else it starts with the first process, and unblocks SIGINT then
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, *TERMINATION_SIGNALS})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock_signals() -> None:
    """Unblock what :func:`signals_blocked` blocks, in a process that was started inside it."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, *TERMINATION_SIGNALS})


def was_interrupted(handler: object) -> bool:
    """Whether a handler of SIGINT of the command line has seen one, whatever became of its KeyboardInterrupt."""
    return bool(getattr(handler, "came", False))


@contextmanager
def stop_flag() -> Iterator[threading.Event]:
    """An event that SIGINT or a signal of :func:`termination_signals` sets; a second SIGINT raises KeyboardInterrupt.

    It is set from the beginning where an earlier SIGINT was swallowed. Main thread only.
    """
    flag = threading.Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, *termination_signals())}

    def set_flag(number: int, _frame: object) -> None:
        if flag.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        flag.set()

    for number in before:
        signal.signal(number, set_flag)
    if was_interrupted(before[signal.SIGINT]):
        flag.set()
    try:
        yield flag
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
