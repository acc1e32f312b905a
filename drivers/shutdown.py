"""Run one clean-up exactly once on every way out of a program: end, exception, SIGINT, SIGTERM, SIGHUP, exit.

A signal handler may interrupt a transaction half way, so it does not touch the bus itself: it raises, the
transaction unwinds, and the clean-up runs on the way out with further signals held back. SIGKILL cannot be
caught; the servos' own bus watchdog covers it.
"""

from __future__ import annotations

import atexit
import logging
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any

log = logging.getLogger(__name__)

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class _Once:
    """Calls a function the first time only, whichever thread comes first."""

    def __init__(self, function: Callable[[], object]) -> None:
        self._function = function
        self._lock = threading.Lock()
        self._done = False

    def __call__(self) -> None:
        with self._lock:
            if self._done:
                return
            self._done = True
        self._function()


@contextmanager
def stop_on_signals(stop: Callable[[], object]) -> Iterator[None]:
    """Context in which ``stop`` will run exactly once, however it is left.

    Parameters
    ----------
    stop : for example ``bus.stop`` or ``bus.close``.

    Raises
    ------
    KeyboardInterrupt : on SIGINT, after ``stop`` ran.
    SystemExit : on SIGTERM and SIGHUP with code 128 + signal, after ``stop`` ran.

    Notes
    -----
    Only the main thread receives signals; in another thread the handlers are left alone, all else still holds.
    """
    once = _Once(stop)
    at_exit = partial(_quietly, once)
    atexit.register(at_exit)
    previous = _install(_raise_signal)
    try:
        yield
    finally:
        _install(_hold_back, previous)
        try:
            once()
        finally:
            atexit.unregister(at_exit)
            for number, handler in previous.items():
                signal.signal(number, handler)


def _install(handler: Callable[[int, FrameType | None], None], only: Any = SIGNALS) -> dict[int, Any]:
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {number: signal.signal(number, handler) for number in only}


def _raise_signal(number: int, frame: FrameType | None) -> None:
    _install(_hold_back)  # a second signal must not interrupt the way out
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


def _hold_back(number: int, frame: FrameType | None) -> None:
    log.warning("stopping the servos; signal %d waits until that is done", number)


def _quietly(once: _Once) -> None:
    """At exit nobody is left to catch anything."""
    try:
        once()
    except Exception:
        log.exception("clean-up at exit failed")
