"""Writes lines to a file in its own thread, so that neither a slow disk nor a full one holds up who has the lines."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_EVERY_S = 0.2
_MOST_LINES = 200_000
_CLOSE_S = 5.0


class LineWriter:
    """A file of lines; when it cannot be written any more it keeps the whole lines that are in it.

    path : the file; what is there is replaced. failed : called once, from any thread, with the error.

    Attributes
    ----------
    error : what ended the writing; None while all is well.

    Raises OSError: the file cannot be opened.
    """

    def __init__(self, path: Path, failed: Callable[[Exception], object]) -> None:
        self.error: OSError | None = None
        self._path, self._failed = path, failed
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
        self._lines: deque[bytes] = deque()
        self._whole = 0  # bytes of whole lines in the file
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"recording {path}", daemon=True)
        self._thread.start()

    def put(self, line: bytes) -> None:
        """Take a line; never waits. After an error it is dropped."""
        if self.error is not None:
            return
        if len(self._lines) >= _MOST_LINES:
            self._fail(OSError(0, "the disk does not keep up", str(self._path)))
            return
        self._lines.append(line)

    def close(self) -> None:
        """Write the remaining lines and close the file."""
        self._stopping.set()
        self._thread.join(_CLOSE_S)  # a disk that does not answer must not keep the servos from stopping

    def _run(self) -> None:
        try:
            while not self._stopping.wait(_EVERY_S):
                self._write()
            self._write()
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._whole)
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
            self._whole += data.rfind(b"\n", 0, done) + 1 - (data.rfind(b"\n", 0, done - written) + 1)

    def _fail(self, error: OSError) -> None:
        if self.error is None:
            self.error = error
            self._failed(error)
