"""Non-blocking byte streams behind a port: serial device, TCP socket, socket in this process, or any URL of pyserial.

:class:`drivers.port.serialport.SerialPort` adds deadlines and one error tree. :data:`UNPLUGGED` is what a device raises
when it disappears.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

import serial

from drivers.base.permission import check_ports_allowed

try:
    import termios
    from termios import error as TermiosError
except ImportError:  # no termios outside POSIX
    termios = None  # type: ignore[assignment]

    class TermiosError(Exception):  # type: ignore[no-redef]
        """Replacement on systems without termios."""


UNPLUGGED = (OSError, serial.SerialException, TermiosError)
"""Everything that pyserial and the system raise when a device disappears."""

CONNECT_S = 3.0
"""Time limit for a TCP connection."""
_CHUNK = 4096
_HUNG_UP = "it hung up"


class Endpoint(ABC):
    """One open device or connection, read and written without blocking; ``device`` : the pyserial object or socket."""

    def __init__(self, device: Any) -> None:
        self.device = device

    @abstractmethod
    def take(self) -> bytes:
        """Return the bytes that have arrived; raises BlockingIOError if there are none, OSError if it is gone."""

    @abstractmethod
    def put(self, data: memoryview) -> int:
        """Write as many bytes as there is room for; return their number. Raises BlockingIOError if there is no room."""

    def wait(self, timeout_s: float, writing: bool) -> bool:
        """Wait until bytes have arrived or, where ``writing``, until there is room to write some.

        Return False after the time limit, and True where it is not known, so that the caller tries.
        """
        ends = [self.device]
        reading, room, _ = select.select([] if writing else ends, ends if writing else [], [], timeout_s)
        return bool(reading or room)

    def close(self) -> None:
        """Close it."""
        self.device.close()


def open_endpoint(path: str, baud: int) -> Endpoint:
    """Open what a path or URL names; raises OSError, SerialException or ValueError where that fails.

    Raises PortError where ports are forbidden (:mod:`drivers.base.permission`).
    """
    check_ports_allowed(f"open port {path}")
    scheme = urlsplit(path).scheme if "://" in path else ""
    if scheme == "socket":
        device = socket.create_connection(address_of(path), timeout=CONNECT_S)
        device.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a write waits for the ACK of the last one
        return SocketEnd(device)
    if scheme == "memory":
        return SocketEnd(MEMORY_PORTS.connect(path.partition("://")[2]))
    if scheme or termios is None:
        return UrlEnd(path, baud)
    return DeviceEnd(path, baud)


class DeviceEnd(Endpoint):
    """A serial device or pseudo-terminal of a POSIX system, opened exclusively."""

    def __init__(self, path: str, baud: int) -> None:
        super().__init__(serial.Serial(path, baud, timeout=0, exclusive=True))
        self._fd: int = self.device.fileno()
        _set_vmin(self._fd)
        with suppress(ValueError, NotImplementedError, AttributeError, *UNPLUGGED):
            self.device.set_low_latency_mode(True)  # pseudo-terminals and many adapters have none

    def take(self) -> bytes:
        data = os.read(self._fd, _CHUNK)
        if not data:
            self._raise_if_gone()
            raise BlockingIOError  # where VMIN is 0, an empty read is not the end
        return data

    def put(self, data: memoryview) -> int:
        return os.write(self._fd, data)

    def _raise_if_gone(self) -> None:
        poll = select.poll()
        poll.register(self._fd, select.POLLIN)
        if any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0)):
            raise OSError(errno.EIO, _HUNG_UP)


class SocketEnd(Endpoint):
    """A stream socket: TCP without Nagle's delay, or one end of a socket pair in this process."""

    def __init__(self, device: socket.socket) -> None:
        super().__init__(device)
        device.setblocking(False)

    def take(self) -> bytes:
        data: bytes = self.device.recv(_CHUNK)
        if not data:
            raise ConnectionResetError(errno.ECONNRESET, _HUNG_UP)
        return data

    def put(self, data: memoryview) -> int:
        return int(self.device.send(data))


class UrlEnd(Endpoint):
    """Any other URL of pyserial (``loop://``, ``rfc2217://...``), and ``COM3``; waits by pyserial's own time-outs."""

    def __init__(self, path: str, baud: int) -> None:
        super().__init__(serial.serial_for_url(path, baudrate=baud, timeout=0))
        self._first = b""

    def take(self) -> bytes:
        data = self._first + bytes(self.device.read(min(self.device.in_waiting, _CHUNK)))
        self._first = b""
        if not data:
            raise BlockingIOError
        return data

    def put(self, data: memoryview) -> int:
        return int(self.device.write(bytes(data)) or len(data))

    def wait(self, timeout_s: float, writing: bool) -> bool:
        """Wait for a byte; ``write`` of pyserial waits for room by itself."""
        if not writing and not self._first:
            self.device.timeout = timeout_s
            self._first = self.device.read(1)
        return True


class MemoryPorts:
    """The ports ``memory://NAME`` of this process, each with the function that accepts its clients."""

    def __init__(self) -> None:
        self._servers: dict[str, Callable[[socket.socket], None]] = {}

    def serve(self, name: str, accept: Callable[[socket.socket], None]) -> None:
        """Offer a port; `accept` gets a socket for each client. Raises OSError when the name is in use."""
        if self._servers.setdefault(name, accept) is not accept:
            raise OSError(errno.EADDRINUSE, f"memory://{name} is served already")

    def withdraw(self, name: str) -> None:
        """Stop offering a port."""
        self._servers.pop(name, None)

    def connect(self, name: str) -> socket.socket:
        """Return a client's socket; raises OSError where nothing serves the name."""
        accept = self._servers.get(name)
        if accept is None:
            raise FileNotFoundError(errno.ENOENT, f"nothing in this process serves memory://{name}")
        ours, theirs = socket.socketpair()
        accept(theirs)
        return ours


MEMORY_PORTS = MemoryPorts()


def address_of(url: str) -> tuple[str, int]:
    """Parse host and port of ``socket://host:port``, or of another scheme; raises ValueError for another form."""
    parts = urlsplit(url)
    if not parts.hostname or parts.port is None:
        raise ValueError(f"{url!r} is not {parts.scheme or 'socket'}://HOST:PORT")
    return parts.hostname, parts.port


def _set_vmin(fd: int) -> None:
    """Set VMIN to 1: with pyserial's 0 a read without data looks like the end of the file."""
    if sys.platform == "win32" or termios is None:
        return
    with suppress(*UNPLUGGED):
        attributes = termios.tcgetattr(fd)
        attributes[6][termios.VMIN] = 1
        termios.tcsetattr(fd, termios.TCSANOW, attributes)
