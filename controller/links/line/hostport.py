"""The robot host's end of a pseudo-terminal: a port that the controller opens like any serial device."""

from __future__ import annotations

import os
import select
from pathlib import Path
from types import TracebackType

from controller.base.errors import LinkError

_CHUNK = 65_536
_WRITE_LIMIT_S = 0.2


class HostPort:
    """A pseudo-terminal whose other end is at :attr:`path`.

    Parameters
    ----------
    link : where to make a symbolic link to the other end; None for none.

    Attributes
    ----------
    path : what the controller opens. dropped : bytes that the other side did not take in time.

    Raises
    ------
    LinkError : the system has no pseudo-terminals, or ``link`` cannot be made.
    """

    def __init__(self, link: Path | None = None) -> None:
        try:
            import pty  # not on Windows
            import tty  # not on Windows

            self._fd, self._other = pty.openpty()
            tty.setraw(self._other)  # no echo and no line editing, as on a wire
        except (ImportError, OSError) as error:
            raise LinkError(
                f"no pseudo-terminal: {error}", hint="simulated ports need Linux or macOS; use a real port"
            ) from error
        os.set_blocking(self._fd, False)
        self.path = os.ttyname(self._other)
        self.dropped = 0
        self._link = link
        if link is not None:
            self._make_link(link)

    def read(self, timeout_s: float) -> bytes:
        """What has arrived; waits for the first byte, empty after ``timeout_s``."""
        ready, _, _ = select.select([self._fd], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            return os.read(self._fd, _CHUNK)
        except OSError:
            return b""

    def write(self, data: bytes) -> None:
        """Hand bytes to the wire; what nobody takes within 0.2 s is dropped, as on a wire, and counted."""
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self._fd, view) :]
            except OSError:
                if not select.select([], [self._fd], [], _WRITE_LIMIT_S)[1]:
                    self.dropped += len(view)
                    return

    def close(self) -> None:
        """Take the port away; whoever has it open finds it gone. May be called again."""
        if self._fd < 0:
            return
        if self._link is not None and self._link.is_symlink() and os.readlink(self._link) == self.path:
            self._link.unlink()
        os.close(self._other)
        os.close(self._fd)
        self._fd = -1

    def __enter__(self) -> HostPort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _make_link(self, link: Path) -> None:
        try:
            if link.is_symlink():
                link.unlink()
            link.symlink_to(self.path)
        except OSError as error:
            self._link = None
            self.close()
            raise LinkError(f"cannot make the link {link}: {error.strerror}", hint="choose another path") from error
