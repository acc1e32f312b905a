"""The far end of a pseudo-terminal that looks like a serial port to any program."""

from __future__ import annotations

import contextlib
import os
import secrets
import struct
import sys
from pathlib import Path

from drivers.base.errors import PortBusy, PortError

DEFAULT_SPEED = 38_400
"""Speed of a terminal that nobody has set; no Dynamixel speaks it, so it is taken for "not set"."""

_TCGETS2 = 0x802C542A
_TERMIOS2 = struct.Struct("4IB19B2I")


class PtyPort:
    """A pseudo-terminal and, if wanted, a symbolic link to it at a path of the user's choice.

    The port itself stays open at both ends, so clients may come and go, and it stays raw between them. What a
    client does not read is lost when the terminal's buffer is full, as on a real adapter.

    Parameters
    ----------
    link : path that shall point at the terminal, or None.

    Attributes
    ----------
    path : what a client opens: the link, or the terminal's own name.
    dropped : bytes lost because the client did not read.

    Raises
    ------
    PortError : no pseudo-terminals here, or the link cannot be made.
    """

    def __init__(self, link: str | os.PathLike[str] | None = None) -> None:
        self.dropped = 0
        self.device = ""
        self._link: Path | None = None
        self._master = self._slave = -1
        self.open(link)

    @property
    def path(self) -> str:
        """What a client opens."""
        return str(self._link) if self._link else self.device

    @property
    def is_open(self) -> bool:
        """Whether the terminal exists."""
        return self._master >= 0

    @property
    def descriptors(self) -> list[int]:
        """What to wait on."""
        return [self._master] if self.is_open else []

    def open(self, link: str | os.PathLike[str] | None = None) -> None:
        """Make the terminal (a new one after `close`) and the link."""
        try:
            import tty  # a system without pseudo-terminals lacks it

            self._master, self._slave = os.openpty()
        except (ImportError, AttributeError, OSError) as error:
            raise PortError(
                f"cannot make a pseudo-terminal: {error}", hint="simulated ports need Linux or macOS"
            ) from error
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.device = os.ttyname(self._slave)
        if link is not None:
            try:
                self._link = _make_link(Path(link), self.device)
            except PortError:
                self.close()
                raise

    def close(self) -> None:
        """Pull the plug: clients get errors, the terminal and the link disappear."""
        if self._link is not None:
            with contextlib.suppress(OSError):
                if os.readlink(self._link) == self.device:
                    self._link.unlink()
            self._link = None
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def read(self) -> bytes:
        """What clients have written; empty when there is nothing."""
        try:
            return os.read(self._master, 65536)
        except (BlockingIOError, OSError):
            return b""

    def write(self, data: bytes) -> None:
        """Send to the client, as much as it has room for."""
        try:
            sent = os.write(self._master, data)
        except BlockingIOError:
            sent = 0
        self.dropped += len(data) - sent

    def baud(self) -> int | None:
        """Bit rate the client has set, or None where none was set or it cannot be known."""
        if sys.platform != "linux":
            return None
        import fcntl  # other systems lack it

        try:
            raw = fcntl.ioctl(self._slave, _TCGETS2, bytes(_TERMIOS2.size))
        except OSError:
            return None
        speed: int = _TERMIOS2.unpack(raw)[-1]
        return None if speed in (0, DEFAULT_SPEED) else speed


def _make_link(link: Path, device: str) -> Path:
    """Point `link` at `device` in one step; only an older link is replaced."""
    if link.exists() and not link.is_symlink():
        raise PortBusy(f"cannot make the link {link}: there is a file of that name", hint="choose another path")
    part = link.with_name(f".{link.name}.{secrets.token_hex(4)}")
    try:
        part.symlink_to(device)
        part.replace(link)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        raise PortError(f"cannot make the link {link}: {error.strerror}", hint=f"mkdir -p {link.parent}") from error
    return link
