"""Clean up on every way out, and tell all that failed on it.

:func:`stop_on_signals` runs one clean-up exactly once on every way out of a program: end, exception, SIGINT,
SIGTERM, SIGHUP, exit.

A signal handler may interrupt a transaction half way, so it does not touch the bus itself: it raises, the
transaction unwinds, and the clean-up runs on the way out with further signals held back. What is raised while a
destructor or a callback runs is lost in Python; that is noticed, and raised once more. SIGKILL cannot be caught; the
servos' own bus watchdog covers it.
"""

from __future__ import annotations

import atexit
import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from types import FrameType, TracebackType
from typing import Any

from drivers.base.errors import DriverError

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
        with _raised_again_when_lost(previous):
            yield
    finally:
        _install(_hold_back, previous)
        try:
            once()
        finally:
            atexit.unregister(at_exit)
            for number, handler in previous.items():
                signal.signal(number, handler)


@contextmanager
def _raised_again_when_lost(numbers: Any) -> Iterator[None]:
    """Raise for a signal once more where what was raised had nowhere to go, as in a destructor."""
    if not numbers:
        yield
        return
    before = sys.unraisablehook

    def notice(lost: Any) -> None:
        number = _signal_of(lost.exc_value)
        if number is None or threading.current_thread() is not threading.main_thread():
            before(lost)
        else:
            _raise_in(_interrupted(lost.exc_traceback), number)

    sys.unraisablehook = notice
    try:
        yield
    finally:
        sys.unraisablehook = before


def _signal_of(error: BaseException | None) -> int | None:
    """The signal for which :func:`_raise_signal` raised this, if it did."""
    if isinstance(error, KeyboardInterrupt):
        return signal.SIGINT
    if isinstance(error, SystemExit) and isinstance(error.code, int) and error.code - 128 in SIGNALS:
        return error.code - 128
    return None


def _interrupted(traceback: TracebackType | None) -> FrameType | None:
    """What was running when the destructor or callback came, of which the error is."""
    if traceback is None:
        return sys._getframe(1).f_back
    return traceback.tb_frame.f_back


def _raise_in(frame: FrameType | None, number: int) -> None:
    """Raise for a signal at the next line of a frame: where we are now, it would be lost as well."""
    if frame is None:
        return

    def trace(*_: Any) -> None:
        sys.settrace(None)
        _raise_signal(number, None)

    sys.settrace(lambda *_: None)  # a frame is traced only while its thread is
    frame.f_trace = trace


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


class Closers(ExitStack):
    """An exit stack of which every callback runs, and every one that failed is told, not only the last.

    ``close`` raises what failed: the error itself where it is one, a :class:`~drivers.base.errors.DriverError` that
    names them all where there are more.
    """

    def __init__(self) -> None:
        super().__init__()
        self._failed: list[Exception] = []

    def callback(self, callback: Callable[..., Any], /, *args: Any, **kwds: Any) -> Callable[..., Any]:
        """Run this on the way out; what it raises is kept for :meth:`close`."""
        super().callback(self._try, callback, *args, **kwds)
        return callback

    def close(self) -> None:
        """Run everything, last come first served.

        Raises
        ------
        Exception : what failed.
        """
        super().close()
        failed, self._failed = self._failed, []
        if failed:
            raise combine_errors(failed)

    def _try(self, callback: Callable[..., object], *args: Any, **kwds: Any) -> None:
        try:
            callback(*args, **kwds)
        except Exception as error:  # noqa: BLE001  the others must run, and be told
            log.debug("on the way out: %s", error)
            self._failed.append(error)


def combine_errors(failed: Sequence[Exception]) -> Exception:
    """One error that tells several: their messages in order, each hint once, all servos."""
    if len(failed) == 1:
        return failed[0]
    hints = dict.fromkeys(hint for error in failed if (hint := getattr(error, "hint", "")))
    servos = dict.fromkeys(servo for error in failed for servo in getattr(error, "servo_ids", ()))
    message = f"{len(failed)} things failed: " + "; ".join(str(error) or type(error).__name__ for error in failed)
    return DriverError(message, hint="; ".join(hints), servo_ids=tuple(servos))


def combine_with_context(error: Exception) -> Exception:
    """The error together with those that were under way when it was raised, which it would hide; oldest first.

    One that it was raised from is in its message already, and is left out, as are those that are not for people.
    """
    found: list[Exception] = [error]
    step: BaseException = error
    while step.__context__ is not None:
        step, told = step.__context__, step.__context__ is step.__cause__
        if isinstance(step, Exception) and hasattr(step, "hint") and not told:
            found.append(step)
    return combine_errors(found[::-1])
