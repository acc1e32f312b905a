"""Shares the latest value of a vector between processes: one writer, any number of readers, no queue.

Layout of the mapped file, all native 8-byte words::

    sequence i64 | spare i64 | slot 0: stamp_ns i64, count x f64 | slot 1: the same

The writer fills the slot that readers do not look at and then raises ``sequence``, so a reader never waits;
it copies the slot ``sequence`` points at and reads again only if the writer lapped it meanwhile.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_HEADER = 2
_RETRIES = 100


class Mailbox:
    """A vector of ``count`` float64 that another process can read at any time.

    Create one with :meth:`create`, open it elsewhere with ``Mailbox(path, count)``.

    path : the mapped file.
    count : length of the vector.
    """

    def __init__(self, path: str | os.PathLike[str], count: int) -> None:
        self.path = str(path)
        self.count = count
        self._owned = False
        with open(self.path, "r+b") as file:
            self._map = mmap.mmap(file.fileno(), self._size(count))
        words = np.frombuffer(self._map, dtype=np.int64)
        self._head = words[:_HEADER]
        slot = 1 + count
        self._stamps = words[_HEADER::slot][:2]
        values = np.frombuffer(self._map, dtype=np.float64)[_HEADER:].reshape(2, slot)
        self._slots = values[:, 1:]

    @staticmethod
    def _size(count: int) -> int:
        return 8 * (_HEADER + 2 * (1 + count))

    @classmethod
    def create(cls, count: int) -> Mailbox:
        """A new mailbox of ``count`` zeros in a private temporary file, removed by :meth:`close`."""
        memory = Path("/dev/shm")
        handle, path = tempfile.mkstemp(prefix="omote-", dir=memory if os.access(memory, os.W_OK) else None)
        with os.fdopen(handle, "wb") as file:
            file.truncate(cls._size(count))
        box = cls(path, count)
        box._owned = True
        return box

    @property
    def sequence(self) -> int:
        """How often the vector was published."""
        return int(self._head[0])

    def publish(self, values: NDArray[np.float64], stamp_ns: int = 0) -> None:
        """Replace the vector. ``values`` : (count,) float64; ``stamp_ns`` travels with it."""
        following = int(self._head[0]) + 1
        self._slots[following % 2] = values
        self._stamps[following % 2] = stamp_ns
        self._head[0] = following

    def read(self, out: NDArray[np.float64]) -> tuple[int, int]:
        """Copy the newest vector into ``out`` : (count,) float64; returns ``(sequence, stamp_ns)``."""
        for _ in range(_RETRIES):
            sequence = int(self._head[0])
            out[:] = self._slots[sequence % 2]
            stamp = int(self._stamps[sequence % 2])
            if int(self._head[0]) - sequence < 1:
                break
        return sequence, stamp

    def unlink(self) -> None:
        """Remove the file; processes that have mapped it keep it. Does nothing where a file in use must stay."""
        with suppress(OSError):
            Path(self.path).unlink()

    def close(self) -> None:
        """Unmap the memory; the process that created the file also removes it."""
        del self._head, self._stamps, self._slots
        self._map.close()
        if self._owned:
            Path(self.path).unlink(missing_ok=True)

    def __enter__(self) -> Mailbox:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
