"""Defines the errors of the package ``controller``, and the tuple of all errors that the command line catches."""

from __future__ import annotations

import errno
import os

from drivers.base.errors import DriverError
from surface.base.errors import SurfaceError


class ControllerError(Exception):
    """Says what failed, where (file and key, port, line) and why; ``hint`` is the next thing to type, or empty."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class ConfigError(ControllerError):
    """A configuration file is wrong; the message lists every fault with its path in the file."""


class ParameterError(ControllerError):
    """An unknown parameter, or a value that is not a number."""


class LinkError(ControllerError):
    """A link to the outside cannot be opened or went away."""


class TakeError(ControllerError):
    """A recorded take cannot be read."""


_EXHAUSTED = {
    errno.EMFILE: "raise the limit of open files of this process: ulimit -n 1024",
    errno.ENFILE: "end programs that hold many files open: lsof | wc -l",
    errno.ENOMEM: "end programs that hold much memory: free -h",
    errno.EAGAIN: "end other processes, or raise their limit: ulimit -u",
    errno.ENOSPC: "make room: df -h",
}


def exhausted(error: BaseException) -> ControllerError | None:
    """Convert a system error about an exhausted resource to one with a hint; return None for any other error."""
    if isinstance(error, MemoryError):
        error = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    if not isinstance(error, OSError) or error.errno not in _EXHAUSTED:
        return None
    where = f"{error.filename}: " if error.filename else ""
    return ControllerError(f"{where}{os.strerror(error.errno)}", hint=_EXHAUSTED[error.errno])


_DENIED = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.ENAMETOOLONG, errno.ELOOP, errno.EIO)


def denied(error: BaseException) -> ControllerError | None:
    """Convert a system error about an unusable file to one that names it; return None for any other error."""
    if not isinstance(error, OSError) or error.errno not in _DENIED or not error.filename:
        return None
    return ControllerError(f"{error.filename}: {os.strerror(error.errno)}", hint=f"look at: ls -ld {error.filename}")


OMOTE_ERRORS = (ControllerError, DriverError, SurfaceError)
"""Base classes of all errors that omote raises on purpose; the command line prints the message and exits with 1."""
