"""The far ends a port can have: a serial device, a TCP socket, an object of this process, or any URL of pyserial.

Each gives bytes without waiting and can wait for them; :class:`drivers.port.serialport.SerialPort` gives all of them
one behaviour and one error tree. What a device raises when it goes away is in :data:`UNPLUGGED`.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial

try:
    import termios
    from termios import error as TermiosError
except ImportError:  # no termios outside POSIX
    termios = None  # type: ignore[assignment]

    class TermiosError(Exception):  # type: ignore[no-redef]
        """Stands in where there is no termios."""


UNPLUGGED = (OSError, serial.SerialException, TermiosError)
"""Everything that pyserial and the system raise when a device goes away."""

CONNECT_S = 3.0
"""A far end in the network that is not connected after this time is given up."""
_CHUNK = 4096
_HUNG_UP = "it hung up"


class Endpoint(Protocol):
    """One open far end.

    Attributes
    ----------
    device : what is underneath, a pyserial object or a socket. low_latency : the adapter's fast mode is on.
    """

    device: Any
    low_latency: bool

    def take(self) -> bytes:
        """What has arrived; raises BlockingIOError when there is nothing, OSError when it is gone."""

    def put(self, data: memoryview) -> int:
        """Hand over as many bytes as there is room for; raises BlockingIOError when there is none."""

    def wait(self, timeout_s: float, writing: bool) -> None:
        """Until bytes have arrived, or there is room for some, at most so long."""

    def close(self) -> None:
        """Give it back."""


def open_endpoint(path: str, baud: int) -> Endpoint:
    """Open what a path or URL names.

    Raises
    ------
    OSError, SerialException, ValueError : it cannot be opened.
    """
    scheme = urlsplit(path).scheme if "://" in path else ""
    if scheme == "socket":
        return SocketEnd(_connected(path))
    if scheme == "memory":
        return SocketEnd(_from_memory(path))
    if scheme or termios is None:
        return UrlEnd(path, baud)
    return DeviceEnd(path, baud)


class DeviceEnd:
    """A serial device or pseudo-terminal of a POSIX system, held exclusively."""

    def __init__(self, path: str, baud: int) -> None:
        self.device = serial.Serial(path, baud, timeout=0, exclusive=True)
        self._fd: int = self.device.fileno()
        _tell_empty_from_gone(self._fd)
        self.low_latency = _ask_low_latency(self.device)

    def take(self) -> bytes:
        """What has arrived."""
        data = os.read(self._fd, _CHUNK)
        if not data:
            self._raise_if_gone()
            raise BlockingIOError  # where VMIN is 0, nothing is no end
        return data

    def put(self, data: memoryview) -> int:
        """Hand over what there is room for."""
        return os.write(self._fd, data)

    def wait(self, timeout_s: float, writing: bool) -> None:
        """Until it is ready."""
        fds = [self._fd]
        select.select([] if writing else fds, fds if writing else [], [], timeout_s)

    def close(self) -> None:
        """Give it back."""
        self.device.close()

    def _raise_if_gone(self) -> None:
        poll = select.poll()
        poll.register(self._fd, select.POLLIN)
        if any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poll.poll(0)):
            raise OSError(errno.EIO, _HUNG_UP)


class SocketEnd:
    """A stream socket: TCP without Nagle's delay, or one end of a pair in this process."""

    low_latency = False

    def __init__(self, device: socket.socket) -> None:
        self.device = device
        device.setblocking(False)

    def take(self) -> bytes:
        """What has arrived."""
        data = self.device.recv(_CHUNK)
        if not data:
            raise ConnectionResetError(errno.ECONNRESET, _HUNG_UP)
        return data

    def put(self, data: memoryview) -> int:
        """Hand over what there is room for."""
        return self.device.send(data)

    def wait(self, timeout_s: float, writing: bool) -> None:
        """Until it is ready."""
        ends = [self.device]
        select.select([] if writing else ends, ends if writing else [], [], timeout_s)

    def close(self) -> None:
        """Give it back."""
        self.device.close()


class UrlEnd:
    """Whatever pyserial opens (``loop://``, ``rfc2217://...``, ``COM3``), waited for by its own time-outs."""

    low_latency = False

    def __init__(self, path: str, baud: int) -> None:
        self.device = serial.serial_for_url(path, baudrate=baud, timeout=0)
        self._first = b""

    def take(self) -> bytes:
        """What has arrived."""
        data = self._first + bytes(self.device.read(min(self.device.in_waiting, _CHUNK)))
        self._first = b""
        if not data:
            raise BlockingIOError
        return data

    def put(self, data: memoryview) -> int:
        """Hand it over; pyserial waits for room by itself."""
        return int(self.device.write(bytes(data)) or len(data))

    def wait(self, timeout_s: float, writing: bool) -> None:
        """Until a byte has come; room for writing is not asked about."""
        if not writing and not self._first:
            self.device.timeout = timeout_s
            self._first = self.device.read(1)

    def close(self) -> None:
        """Give it back."""
        self.device.close()


class MemoryPorts:
    """The ports ``memory://NAME`` of this process: who serves one, and how a client gets a line to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._servers: dict[str, Callable[[socket.socket], None]] = {}

    def serve(self, name: str, take: Callable[[socket.socket], None]) -> None:
        """Offer a port; ``take`` gets its end of the line of each client. Raises OSError when the name is taken."""
        with self._lock:
            if name in self._servers:
                raise OSError(errno.EADDRINUSE, f"memory://{name} is served already")
            self._servers[name] = take

    def withdraw(self, name: str) -> None:
        """Offer it no longer."""
        with self._lock:
            self._servers.pop(name, None)

    def connect(self, name: str) -> socket.socket:
        """A client's end of a line; raises OSError where nobody serves the name."""
        with self._lock:
            take = self._servers.get(name)
        if take is None:
            raise FileNotFoundError(errno.ENOENT, f"nobody in this process serves memory://{name}")
        ours, theirs = socket.socketpair()
        take(theirs)
        return ours


MEMORY_PORTS = MemoryPorts()


def address_of(url: str) -> tuple[str, int]:
    """Host and port of ``socket://host:port``.

    Raises
    ------
    ValueError : it is not of that form.
    """
    parts = urlsplit(url)
    if not parts.hostname or parts.port is None:
        raise ValueError(f"{url!r} is not socket://HOST:PORT")
    return parts.hostname, parts.port


def _connected(url: str) -> socket.socket:
    device = socket.create_connection(address_of(url), timeout=CONNECT_S)
    device.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a write waits for the ACK of the one before
    return device


def _from_memory(url: str) -> socket.socket:
    return MEMORY_PORTS.connect(url.partition("://")[2])


def _ask_low_latency(device: serial.Serial) -> bool:
    """Ask the driver for its low-latency mode; pseudo-terminals and many adapters have none."""
    try:
        device.set_low_latency_mode(True)
    except (ValueError, NotImplementedError, AttributeError, *UNPLUGGED):
        return False
    return True


def _tell_empty_from_gone(fd: int) -> None:
    """Set VMIN to 1: with pyserial's 0 a read without data looks like the end of the file."""
    if sys.platform == "win32" or termios is None:
        return
    with suppress(*UNPLUGGED):
        attributes = termios.tcgetattr(fd)
        attributes[6][termios.VMIN] = 1
        termios.tcsetattr(fd, termios.TCSANOW, attributes)
