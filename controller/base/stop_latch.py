"""The latch of STOP: once set, every servo stays off until START, whatever else is commanded.

Links and panels set it, the bus loops look at it before anything else in each of their cycles, and STATUS reports it.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass


@dataclass(frozen=True)
class Stopped:
    """Who commanded the stop, such as ``line /dev/ttyUSB0``, and when (monotonic clock, ns)."""

    who: str
    at_ns: int


class StopLatch:
    """Set by STOP, released by START; any thread may read and change it."""

    def __init__(self) -> None:
        self._stopped: Stopped | None = None
        self._lock = threading.Lock()
        self.stops = 0

    @property
    def stopped(self) -> Stopped | None:
        """Who stopped the servos and when; None while they may move."""
        return self._stopped

    def stop(self, who: str, now_ns: int) -> bool:
        """Keep the servos off from now on; False where they were stopped already: the first stop is kept."""
        with self._lock:
            if self._stopped is not None:
                return False
            self._stopped = Stopped(who, now_ns)
            self.stops += 1
            return True

    def start(self) -> bool:
        """Let the servos move again; False where nothing had stopped them."""
        with self._lock:
            was, self._stopped = self._stopped, None
            return was is not None
