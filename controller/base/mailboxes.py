"""Shares the latest value of a vector between processes: one writer, any number of readers, no queue.

Layout of the mapped file, all native 8-byte words::

    sequence i64 | spare i64 | slot 0: stamp_ns i64, life 2 x f64, count x f64 | slot 1: the same

The writer fills the slot that readers do not look at and then raises ``sequence``, so a reader never waits;
it copies the slot ``sequence`` points at and reads again only if the writer lapped it meanwhile.
"""

from __future__ import annotations

import errno
import logging
import mmap
import os
import tempfile
from multiprocessing import reduction
from multiprocessing.connection import Connection
from typing import IO

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ControllerError

log = logging.getLogger(__name__)

MEMORY = "/dev/shm"
_HEADER = 2
_RETRIES = 100
_LIFE = 2

Life = tuple[float, float]
"""What the picture shows beside the parameters: mm by which a breath lifts the chest, and share by which pupils are
wider than the light makes them."""
REST: Life = (0.0, 0.0)


class Mailbox:
    """A vector of ``count`` float64 that another process can read at any time.

    Create one with :meth:`create`, hand it to another process with :meth:`send`, and take it there with
    :meth:`receive`. The file has no name, so nothing of it is left however the processes end.

    file : the mapped file. count : length of the vector.

    Attributes
    ----------
    life : what was published with the vector that was read last.
    """

    def __init__(self, file: IO[bytes], count: int) -> None:
        self.count, self.life = count, REST
        self._file = file
        self._map = mmap.mmap(file.fileno(), self._size(count))
        words = np.frombuffer(self._map, dtype=np.int64)
        self._head = words[:_HEADER]
        slot = 1 + _LIFE + count
        self._stamps = words[_HEADER::slot][:2]
        values = np.frombuffer(self._map, dtype=np.float64)[_HEADER:].reshape(2, slot)
        self._lives, self._slots = values[:, 1 : 1 + _LIFE], values[:, 1 + _LIFE :]

    @staticmethod
    def _size(count: int) -> int:
        return 8 * (_HEADER + 2 * (1 + _LIFE + count))

    @classmethod
    def create(cls, count: int) -> Mailbox:
        """A new mailbox of ``count`` zeros, in memory, or in the folder of temporary files where that is full.

        Raises ControllerError: there is no room in either.
        """
        return cls(_reserved(cls._size(count)), count)

    def send(self, pipe: Connection) -> None:
        """Hand the mailbox to the process at the other end of a pipe. Raises OSError: nobody is there."""
        reduction.send_handle(pipe, self._file.fileno(), None)

    @classmethod
    def receive(cls, pipe: Connection, count: int) -> Mailbox:
        """Take the mailbox of ``count`` that another process sends. Raises ControllerError: it does not come."""
        try:
            return cls(os.fdopen(reduction.recv_handle(pipe), "r+b"), count)
        except (EOFError, OSError, RuntimeError, ValueError) as error:
            raise ControllerError(f"the shared memory of the main process did not come: {error}") from error

    @property
    def sequence(self) -> int:
        """How often the vector was published."""
        return int(self._head[0])

    def publish(self, values: NDArray[np.float64], stamp_ns: int = 0, life: Life = REST) -> None:
        """Replace the vector. ``values`` : (count,) float64; ``stamp_ns`` and ``life`` travel with it."""
        following = int(self._head[0]) + 1
        self._slots[following % 2] = values
        self._lives[following % 2] = life
        self._stamps[following % 2] = stamp_ns
        self._head[0] = following

    def read(self, out: NDArray[np.float64]) -> tuple[int, int]:
        """Copy the newest vector into ``out`` : (count,) float64; returns ``(sequence, stamp_ns)``."""
        for _ in range(_RETRIES):
            sequence = int(self._head[0])
            out[:] = self._slots[sequence % 2]
            rise_mm, pupil = self._lives[sequence % 2].tolist()
            stamp = int(self._stamps[sequence % 2])
            if int(self._head[0]) - sequence < 1:
                break
        self.life = rise_mm, pupil
        return sequence, stamp

    def close(self) -> None:
        """Unmap the memory; it is free when every process has."""
        del self._head, self._stamps, self._lives, self._slots
        self._map.close()
        self._file.close()

    def __enter__(self) -> Mailbox:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _reserved(size: int) -> IO[bytes]:
    """A file of ``size`` zero bytes without a name whose pages exist: a write never meets a full file system."""
    failed: list[str] = []
    for folder in _folders():
        try:
            file = _filled(folder, size)
        except OSError as error:
            failed.append(f"{folder}: {error.strerror}")
            continue
        if failed:
            log.warning("%s; the face goes from process to process through %s instead", failed[0], folder)
        return file
    hint = f"make room in one of them: df -h {' '.join(_folders())}"
    raise ControllerError(f"no room for {size} bytes that two processes share: {'; '.join(failed)}", hint=hint)


def _folders() -> list[str]:
    """Where such a file can be: in memory first, then on the disk."""
    folders = [MEMORY] if os.path.isdir(MEMORY) else []
    try:
        return list(dict.fromkeys([*folders, tempfile.gettempdir()]))
    except OSError:  # none takes a file
        return folders or ["/tmp"]


def _filled(folder: str, size: int) -> IO[bytes]:
    """Zeros that are really there; a file that is only made longer has no pages before they are written."""
    file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115  the mailbox closes it
    try:
        if file.write(bytes(size)) != size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    except OSError:
        file.close()
        raise
    return file
