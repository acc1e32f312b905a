"""Writes the faces that a conductor published for one head: a take, ``time,jawOpen,...`` in seconds and values."""

from __future__ import annotations

import threading
from pathlib import Path

from controller.base.errors import ControllerError
from controller.base.parameters import Floats, Parameters


class Recording:
    """A table ``<stem>-<head>.csv``, which ``omote play`` reads.

    Raises ControllerError: the file cannot be written.
    """

    def __init__(self, folder: Path, stem: str, head: str, parameters: Parameters) -> None:
        self.path = folder / f"{stem}-{head}.csv"
        try:
            self._file = self.path.open("w", encoding="utf-8")
            self._file.write(",".join(["time", *parameters.names]) + "\n")
        except OSError as error:
            raise ControllerError(f"{self.path}: cannot be written: {error.strerror}",
                                  hint='another place: [zenoh] and record = "folder/name"') from error  # fmt: skip
        self._first_ns: int | None = None
        self._lock = threading.Lock()

    def add(self, time_ns: int, values: Floats) -> None:
        """Write one row: a face mixed at ``time_ns`` of the conductor's clock."""
        with self._lock:
            if self._file.closed:
                return
            self._first_ns = time_ns if self._first_ns is None else self._first_ns
            row = [f"{(time_ns - self._first_ns) * 1e-9:.6f}", *map(repr, values.tolist())]
            self._file.write(",".join(row) + "\n")

    def close(self) -> None:
        """Write what waits."""
        with self._lock:
            self._file.close()
