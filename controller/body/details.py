"""Keeps what was logged for the window's panel."""

from __future__ import annotations

import logging
import threading
from collections import deque

_MOST = 50


class Notes(logging.Handler):
    """Keeps the newest warnings and errors of this process until they are taken; any thread may log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._kept: deque[str] = deque(maxlen=_MOST)
        self._taking = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Keep one."""
        with self._taking:
            self._kept.append(record.getMessage())

    def take(self) -> list[str]:
        """Those since the last time, oldest first; 50 at most."""
        with self._taking:
            taken = list(self._kept)
            self._kept.clear()
        return taken
