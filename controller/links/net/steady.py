"""Provides a thread that calls a function at a steady rate until it is stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable


class SteadyThread:
    """Calls ``step`` with the time (s, monotonic clock) every ``period_s`` seconds; calls that are late are skipped.

    name : of the thread.
    """

    def __init__(self, name: str, period_s: float, step: Callable[[float], object]) -> None:
        self._period_s, self._step = period_s, step
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread, which makes the first call immediately."""
        self._thread.start()

    def stop(self) -> None:
        """Make no further call, and wait for the current one; may also be called before the start."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._stopping.wait(max(0.0, due_s - time.monotonic())):
            now_s = time.monotonic()
            self._step(now_s)
            due_s = max(due_s + self._period_s, now_s)
