"""Converts SIGINT, SIGTERM and SIGHUP to a flag, so that programs can end in order."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

TERMINATION_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that request the end of a process: from a service manager, and from a terminal that was closed."""


def termination_signals() -> tuple[signal.Signals, ...]:
    """Return the :data:`TERMINATION_SIGNALS` that are to end this process; under nohup, SIGHUP is not one of them."""
    return tuple(n for n in TERMINATION_SIGNALS if n == signal.SIGTERM or signal.getsignal(n) is not signal.SIG_IGN)


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Block SIGINT and :data:`TERMINATION_SIGNALS` in this block, and in processes that it starts.

    Such a process calls :func:`unblock_signals` itself. If a signal ended this program while it starts a process, that
    process would be left waiting for orders.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # otherwise it starts with the first process, and unblocks SIGINT
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
    """Whether the command line's handler of SIGINT was called, even if its KeyboardInterrupt was swallowed."""
    return bool(getattr(handler, "came", False))


@contextmanager
def stop_flag() -> Iterator[threading.Event]:
    """Yield an event that SIGINT or a termination signal sets; a second SIGINT raises KeyboardInterrupt.

    If an earlier SIGINT was swallowed, the event is set from the beginning. For the main thread only.
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
