"""Clean-up that runs exactly once on every way out of a program: end, exception, exit, SIGINT, SIGTERM and SIGHUP.

A signal handler may interrupt a transaction on the bus, so it does not use the bus: it raises an exception, which
unwinds the transaction, and the clean-up runs afterwards while further signals are held back. Python drops exceptions
that are raised in destructors and callbacks; a hook raises those of signals again. SIGKILL cannot be caught; the
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
from types import FrameType, TracebackType
from typing import Any

from drivers.base.errors import DriverError

log = logging.getLogger(__name__)

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def stop_on_signals(stop: Callable[[], object]) -> Iterator[None]:
    """Context manager that runs ``stop``, as ``bus.close``, exactly once, however the context is left.

    Raises KeyboardInterrupt: on SIGINT, after ``stop`` ran. SystemExit: on SIGTERM and SIGHUP with code 128 + signal,
    after ``stop`` ran; also where the signal came while ``stop`` ran at the ordinary end of the context.

    Notes
    -----
    Only the main thread receives signals; in another thread the handlers stay unchanged, and all else still applies.
    SIGHUP stays ignored where it is, as under nohup.
    """
    first_call = threading.Lock()  # acquired by the first call and never released

    def stop_once() -> None:
        if first_call.acquire(blocking=False):
            stop()

    def at_exit() -> None:
        try:
            stop_once()
        except Exception:
            log.exception("clean-up at exit failed")

    held: list[int] = []

    def hold_back(number: int, frame: FrameType | None) -> None:
        _hold_back(number, frame)
        held.append(number)

    atexit.register(at_exit)
    previous = _install(_raise_signal)
    try:
        with _raise_dropped_signals_again(previous):
            yield
    finally:
        _install(hold_back, previous)
        try:
            stop_once()
        finally:
            atexit.unregister(at_exit)
            for number, handler in previous.items():
                signal.signal(number, signal.SIG_DFL if handler is None else handler)  # None: not set from Python
    if held:  # nothing else ends the program
        raise _signal_error(held[0])


@contextmanager
def _raise_dropped_signals_again(numbers: Any) -> Iterator[None]:
    """Raise again the exception of a signal that Python dropped, as in a destructor; does nothing without handlers."""
    if not numbers:
        yield
        return
    before = sys.unraisablehook

    def hook(dropped: Any) -> None:
        number = _signal_of(dropped.exc_value)
        if number is None or threading.current_thread() is not threading.main_thread():
            before(dropped)
        else:
            traceback: TracebackType | None = dropped.exc_traceback  # its first frame is the destructor or callback
            _raise_in(sys._getframe().f_back if traceback is None else traceback.tb_frame.f_back, number)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _signal_of(error: BaseException | None) -> int | None:
    """The signal for which :func:`_raise_signal` raised an error; None for any other error."""
    if isinstance(error, KeyboardInterrupt):
        return signal.SIGINT
    if isinstance(error, SystemExit) and isinstance(error.code, int) and error.code - 128 in SIGNALS:
        return error.code - 128
    return None


def _raise_in(frame: FrameType | None, number: int) -> None:
    """Raise for a signal at the next line of a frame; raised here it would be dropped as well."""
    if frame is None:
        return

    def trace(*_: Any) -> None:
        sys.settrace(None)
        _raise_signal(number, None)

    sys.settrace(lambda *_: None)  # f_trace works only while the thread has a trace function
    frame.f_trace = trace


def _install(handler: Callable[[int, FrameType | None], None], signals: Any = SIGNALS) -> dict[int, Any]:
    """Install a handler; return the handlers that it replaces. An ignored SIGHUP stays ignored."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    ignored = getattr(signal, "SIGHUP", None)
    ignored = ignored if ignored is not None and signal.getsignal(ignored) is signal.SIG_IGN else None
    return {number: signal.signal(number, handler) for number in signals if number != ignored}


def _raise_signal(number: int, frame: FrameType | None) -> None:
    _install(_hold_back)  # a second signal must not interrupt the way out
    raise _signal_error(number)


def _signal_error(number: int) -> BaseException:
    return KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number)


def _hold_back(number: int, frame: FrameType | None) -> None:
    log.warning("stopping the servos; signal %d waits until that is done", number)


class Closers(ExitStack):
    """An exit stack that runs every callback and raises all their errors, not only the last one, in :meth:`close`.

    As a context manager it only logs them, so that they do not replace an error that leaves the context.
    """

    def __init__(self) -> None:
        super().__init__()
        self._failed: list[Exception] = []

    def callback(self, callback: Callable[..., Any], /, *args: Any, **kwds: Any) -> Callable[..., Any]:
        """Register a callback; what it raises is kept for :meth:`close`."""
        super().callback(self._try, callback, *args, **kwds)
        return callback

    def close(self) -> None:
        """Run all callbacks, the last one first, then raise their errors; see :func:`combine_errors`."""
        super().close()
        failed, self._failed = self._failed, []
        if failed:
            raise combine_errors(failed)

    def _try(self, callback: Callable[..., object], *args: Any, **kwds: Any) -> None:
        try:
            callback(*args, **kwds)
        except Exception as error:  # noqa: BLE001  the other callbacks must run
            log.debug("clean-up: %s", error)
            self._failed.append(error)


def combine_errors(failed: Sequence[Exception]) -> Exception:
    """Return a single error unchanged, several as one DriverError with all messages, hints (each once) and servos."""
    if len(failed) == 1:
        return failed[0]
    hints = dict.fromkeys(hint for error in failed if (hint := getattr(error, "hint", "")))
    servos = dict.fromkeys(servo for error in failed for servo in getattr(error, "servo_ids", ()))
    message = f"{len(failed)} things failed: " + "; ".join(str(error) or type(error).__name__ for error in failed)
    return DriverError(message, hint="; ".join(hints), servo_ids=tuple(servos))


def combine_with_context(error: Exception) -> Exception:
    """Combine an error with the errors that were being handled when it was raised, oldest first.

    Left out are causes that it was raised from, which its message names already, and errors without a ``hint``.
    """
    found: list[Exception] = [error]
    step: BaseException = error
    while step.__context__ is not None:
        step, is_cause = step.__context__, step.__context__ is step.__cause__
        if isinstance(step, Exception) and hasattr(step, "hint") and not is_cause:
            found.append(step)
    return combine_errors(found[::-1])
