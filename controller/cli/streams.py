"""Prepares standard input, output and error: opens closed ones, accepts every character, and records write errors."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


class Output(io.TextIOWrapper):
    """A standard stream that keeps its first write error in ``fault`` and discards what is written afterwards."""

    fault: OSError | None = None

    def write(self, text: str) -> int:
        """Write text; raises OSError at the first failure."""
        return int(self._record_error(super().write, text))

    def flush(self) -> None:
        """Flush the buffer; raises OSError at the first failure."""
        self._record_error(super().flush)

    def _record_error(self, do: Callable[..., Any], *words: str) -> Any:
        try:
            return do(*words)
        except OSError as error:
            self.fault = self.fault or error
            with suppress(OSError):  # otherwise the interpreter would report the error again at its exit
                os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            raise


def prepare_streams() -> None:
    """Open the standard streams that the caller closed, and make output and error accept every character.

    A standard output that was closed is opened read-only, so that writing to it fails as on a full disk. If it stayed
    closed, the first port or file that is opened would become the standard output.
    """
    for descriptor, flags in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, flags), True)  # open takes the lowest free number, which is this one
    sys.stdin = sys.stdin or os.fdopen(0)
    sys.stdout, sys.stderr = _as_output(sys.stdout or os.fdopen(1, "w")), _as_output(sys.stderr or os.fdopen(2, "w"))


def _as_output(stream: Any) -> Any:
    """Return the stream as an :class:`Output`, or unchanged if a test or a caller has replaced it."""
    if type(stream) is not io.TextIOWrapper:
        return stream
    encoding, errors = stream.encoding, stream.errors if stream.errors != "strict" else "backslashreplace"
    lines, through = stream.line_buffering, stream.write_through
    return Output(stream.detach(), encoding, errors, None, lines, through)


def fault_of(stream: Any) -> OSError | None:
    """Flush a stream, and return its first write error, or None if everything was written."""
    with suppress(OSError):
        stream.flush()
    return getattr(stream, "fault", None)
