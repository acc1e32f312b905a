"""Writes the events of shows to a table with their times; sends marks as markers of LSL (lab streaming layer)."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from controller.base.errors import ControllerError
from controller.takes.line_writer import LineWriter
from surface.base.extras import importing

HEADER = b"time_s,unix_s,event,text\n"


class EventLog:
    """A table of events: seconds since the first event, seconds since 1970, ``mark`` or ``line``, and its text.

    A separate thread writes, so that a slow disk does not delay the face.

    lsl : also send marks as an LSL stream named ``omote``. failed : called from any thread when the file cannot be
    written any more; the file is then truncated to its last whole line.

    Raises ControllerError: the file cannot be written. MissingPackage: pylsl is not installed.
    """

    def __init__(self, path: Path, *, lsl: bool = False, failed: Callable[[Exception], object] | None = None) -> None:
        self._outlet = _open_outlet() if lsl else None
        try:
            self._writer = LineWriter(path, failed or (lambda _: None))
        except OSError as error:
            raise ControllerError(
                f"{path}: cannot be written: {error.strerror}", hint="choose another folder with -o"
            ) from error
        self._writer.put(HEADER)
        self._begin_ns: int | None = None

    def note(self, now_ns: int, event: str, text: str) -> None:
        """Write an event of the tick at ``now_ns`` (monotonic clock)."""
        if self._outlet is not None and event == "mark":
            self._outlet.push_sample([text])
        self._begin_ns = now_ns if self._begin_ns is None else self._begin_ns
        unix_s = time.time() - (time.monotonic_ns() - now_ns) * 1e-9
        quoted = text.replace('"', '""')
        self._writer.put(f'{(now_ns - self._begin_ns) * 1e-9:.6f},{unix_s:.6f},{event},"{quoted}"\n'.encode())

    def close(self) -> None:
        """Write the remaining events, and close the file."""
        self._writer.close()


def _open_outlet() -> Any:
    with importing("sending markers of LSL", "pylsl"):
        import pylsl  # optional: the extra lsl
    return pylsl.StreamOutlet(pylsl.StreamInfo("omote", "Markers", 1, 0, "string", "omote-marks"))
