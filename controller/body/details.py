"""Keeps logged warnings and errors for the window's panel."""

from __future__ import annotations

import logging
import threading
from collections import deque

_MAX_NOTES = 50


class Notes(logging.Handler):
    """Keeps the newest warnings and errors of this process until they are taken; any thread may log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._kept: deque[str] = deque(maxlen=_MAX_NOTES)
        self._lock = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the message of a record."""
        with self._lock:
            self._kept.append(record.getMessage())

    def take(self) -> list[str]:
        """Return and remove the kept messages, at most 50, oldest first."""
        with self._lock:
            taken = list(self._kept)
            self._kept.clear()
        return taken
