"""Standard input, output and error: there in every process, able to write any text, and their faults noticed."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any


class Output(io.TextIOWrapper):
    """A standard stream that keeps the first error of writing to it, whoever writes, and then writes to nowhere."""

    fault: OSError | None = None

    def write(self, text: str) -> int:
        """Write text; raises OSError the first time that it does not arrive."""
        return int(self._noting(super().write, text))

    def flush(self) -> None:
        """Pass on what was written; raises OSError the first time that it does not arrive."""
        self._noting(super().flush)

    def _noting(self, do: Callable[..., Any], *words: str) -> Any:
        try:
            return do(*words)
        except OSError as error:
            self.fault = self.fault or error
            with suppress(OSError):  # the interpreter would report it again when it ends
                os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            raise


def prepare_streams() -> None:
    """Open the standard streams that the caller closed, and let all of them write every character.

    What is opened in the place of a closed standard output refuses to be written to, as a full disk does. Without it,
    the first port or file that is opened would become the standard output.
    """
    for descriptor, flags in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, flags), True)  # the lowest number that is free: this one
    sys.stdin = sys.stdin or os.fdopen(0)
    sys.stdout, sys.stderr = _noted(sys.stdout or os.fdopen(1, "w")), _noted(sys.stderr or os.fdopen(2, "w"))


def _noted(stream: Any) -> Any:
    """The stream as an :class:`Output`; what a test or a caller has put in its place stays."""
    if type(stream) is not io.TextIOWrapper:
        return stream
    encoding, errors = stream.encoding, stream.errors if stream.errors != "strict" else "backslashreplace"
    lines, through = stream.line_buffering, stream.write_through
    return Output(stream.detach(), encoding, errors, None, lines, through)


def fault_of(stream: Any) -> OSError | None:
    """Why what was written to a stream has not arrived; None where it has."""
    with suppress(OSError):
        stream.flush()
    return getattr(stream, "fault", None)
