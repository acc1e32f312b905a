"""Writes lines to a file in its own thread, so that a slow or full disk does not delay the caller."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_WRITE_INTERVAL_S = 0.2
_MAX_PENDING_LINES = 200_000
_CLOSE_TIMEOUT_S = 5.0


class LineWriter:
    """A text file that is written line by line. After a write error it is truncated to its last whole line.

    path : the file; an existing one is overwritten. failed : called with the first error and never again, either in
    the writing thread or in the one that calls :meth:`put`.

    Attributes
    ----------
    error : the error that ended the writing; None while there is none.

    Raises OSError: the file cannot be opened.
    """

    def __init__(self, path: Path, failed: Callable[[Exception], object]) -> None:
        self.error: OSError | None = None
        self._error_lock = threading.Lock()
        self._path, self._failed = path, failed
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
        self._lines: deque[bytes] = deque()
        self._whole_line_bytes = 0  # length of the file up to the end of its last whole line
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"recording {path}", daemon=True)
        self._thread.start()

    def put(self, line: bytes) -> None:
        """Append a line, including its line break, without waiting for the disk. After an error it is dropped."""
        if self.error is not None:
            return
        if len(self._lines) >= _MAX_PENDING_LINES:
            self._fail(OSError(0, "the disk does not keep up", str(self._path)))
            return
        self._lines.append(line)

    def close(self) -> None:
        """Write the remaining lines and close the file; wait for that no longer than 5 s."""
        self._stopping.set()
        self._thread.join(_CLOSE_TIMEOUT_S)  # a hanging disk must not prevent the servos from stopping

    def _run(self) -> None:
        try:
            while not self._stopping.wait(_WRITE_INTERVAL_S):
                self._write()
            self._write()
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._whole_line_bytes)
            self._fail(OSError(error.errno, error.strerror, str(self._path)))
        finally:
            with suppress(OSError):
                os.close(self._file)

    def _write(self) -> None:
        data = b"".join(self._lines.popleft() for _ in range(len(self._lines)))
        done = 0
        while done < len(data):
            written = os.write(self._file, memoryview(data)[done:])
            done += written
            self._whole_line_bytes += data.rfind(b"\n", 0, done) + 1 - (data.rfind(b"\n", 0, done - written) + 1)

    def _fail(self, error: OSError) -> None:
        with self._error_lock:
            if self.error is not None:
                return
            self.error = error
        self._failed(error)
