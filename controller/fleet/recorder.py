"""Writes the faces that a conductor publishes for one head to a take: a table with time (s), jawOpen and so on."""

from __future__ import annotations

import logging
import threading
from pathlib import Path

from controller.base.errors import ControllerError
from controller.base.parameters import Floats, Parameters
from controller.takes.line_writer import LineWriter

log = logging.getLogger(__name__)


class Recording:
    """A table ``<stem>-<head>.csv``, which ``omote play`` reads.

    If it cannot be written any more, as on a full disk, that is logged, and the rows written so far are kept.

    Raises ControllerError: the file cannot be written.
    """

    def __init__(self, folder: Path, stem: str, head: str, parameters: Parameters) -> None:
        self.path = folder / f"{stem}-{head}.csv"
        try:
            self._writer = LineWriter(self.path, self._failed)
        except OSError as error:
            raise ControllerError(f"{self.path}: cannot be written: {error.strerror}",
                                  hint='another place: [zenoh] and record = "folder/name"') from error  # fmt: skip
        self._put(["time", *parameters.names])
        self._first_ns: int | None = None
        self._lock, self._closed = threading.Lock(), False

    def add(self, time_ns: int, values: Floats) -> None:
        """Write one row: a face of the tick that was due at ``time_ns`` of the conductor's clock."""
        with self._lock:
            if self._closed:
                return
            self._first_ns = time_ns if self._first_ns is None else self._first_ns
            self._put([f"{(time_ns - self._first_ns) * 1e-9:.6f}", *map(repr, values.tolist())])

    def close(self) -> None:
        """Write the remaining rows."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._writer.close()

    def _put(self, cells: list[str]) -> None:
        self._writer.put((",".join(cells) + "\n").encode())

    def _failed(self, error: Exception) -> None:
        why = getattr(error, "strerror", None) or error
        log.error("%s: the recording has ended: %s; the rows in it are kept, all else goes on", self.path, why)
