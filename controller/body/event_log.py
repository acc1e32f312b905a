"""Writes what a show does, and when, to a table; sends its marks as markers of LSL (lab streaming layer)."""

from __future__ import annotations

import logging
import queue
import threading
import time
from pathlib import Path
from typing import Any

from controller.base.errors import ControllerError
from surface.base.extras import importing

log = logging.getLogger(__name__)

HEADER = "time_s,unix_s,event,text\n"
_STOP_S = 3.0


class EventLog:
    """A table of events: seconds since the first of them, seconds since 1970, ``mark`` or ``line``, and which.

    A thread of its own writes, so that a slow disk does not delay the face.

    lsl : send marks as a stream of LSL named ``omote``, too.

    Raises ControllerError: the file cannot be written. MissingPackage: pylsl is not installed.
    """

    def __init__(self, path: Path, *, lsl: bool = False) -> None:
        self._outlet = _outlet() if lsl else None
        try:
            self._file = path.open("w", encoding="utf-8")
            self._file.write(HEADER)
        except OSError as error:
            raise ControllerError(
                f"{path}: cannot be written: {error.strerror}", hint="choose another folder with -o"
            ) from error
        self._begin_ns: int | None = None
        self._waiting: queue.SimpleQueue[tuple[int, str, str] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"events {path}", daemon=True)
        self._thread.start()

    def note(self, now_ns: int, event: str, text: str) -> None:
        """Write an event of the tick at ``now_ns`` (monotonic clock)."""
        if self._outlet is not None and event == "mark":
            self._outlet.push_sample([text])
        self._waiting.put((now_ns, event, text))

    def close(self) -> None:
        """Write what waits."""
        self._waiting.put(None)
        self._thread.join(_STOP_S)

    def _run(self) -> None:
        with self._file:
            while (found := self._waiting.get()) is not None:
                now_ns, event, text = found
                self._begin_ns = now_ns if self._begin_ns is None else self._begin_ns
                unix_s = time.time() - (time.monotonic_ns() - now_ns) * 1e-9
                quoted = text.replace('"', '""')
                self._file.write(f'{(now_ns - self._begin_ns) * 1e-9:.6f},{unix_s:.6f},{event},"{quoted}"\n')
                self._file.flush()


def _outlet() -> Any:
    with importing("sending markers of LSL", "pylsl"):
        import pylsl  # optional: the extra lsl
    return pylsl.StreamOutlet(pylsl.StreamInfo("omote", "Markers", 1, 0, "string", "omote-marks"))
