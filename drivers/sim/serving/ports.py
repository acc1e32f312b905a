"""Ports that simulated buses serve: pseudo-terminals, TCP sockets, and sockets within this process.

``memory://NAME`` lets programs on systems without pseudo-terminals use a bus that runs in a thread of theirs.
"""

from __future__ import annotations

import os
import secrets
import socket
import struct
import sys
from abc import ABC, abstractmethod
from collections import deque
from contextlib import suppress
from pathlib import Path

from drivers.base.errors import PortBusy, PortError
from drivers.port.endpoints import MEMORY_PORTS, address_of

_CHUNK = 65536

DEFAULT_SPEED = 38_400
"""Speed of a terminal that no client has set; no Dynamixel speaks it, so it is taken for "not set"."""

_TCGETS2 = 0x802C542A
_TERMIOS2 = struct.Struct("4IB19B2I")

Link = str | os.PathLike[str] | None
"""A path that shall point at a pseudo-terminal, ``socket://HOST:PORT``, ``rfc2217://HOST:PORT``, ``memory://NAME``,
or None."""


class ServedPort(ABC):
    """A port as its server uses it. What a client does not read is lost when there is no more room for it.

    path : what a client opens.
    dropped : bytes lost because the client did not read.
    """

    path = ""
    dropped = 0

    @property
    @abstractmethod
    def descriptors(self) -> list[int]:
        """What to wait on; empty while the port is closed."""

    @property
    def is_open(self) -> bool:
        """Whether clients may come."""
        return bool(self.descriptors)

    @abstractmethod
    def open(self, link: Link = None) -> None:
        """Offer the port (again after `close`), under another name where one is given; raises PortError."""

    @abstractmethod
    def close(self) -> None:
        """Take the port away: clients get errors. Harmless when closed."""

    @abstractmethod
    def read(self) -> bytes:
        """What the client has written; empty when there is nothing."""

    def write(self, data: bytes) -> None:
        """Send to the client, as much as it has room for."""
        sent = 0
        with suppress(OSError):
            sent = self._send(data)
        self.dropped += len(data) - sent

    @abstractmethod
    def _send(self, data: bytes) -> int: ...

    def baud(self) -> int | None:
        """Bit rate the client has set, or None where none was set or it cannot be known."""
        return None


class PtyPort(ServedPort):
    """A pseudo-terminal and, if wanted, a symbolic link to it at a path of the user's choice, which is its `path` then.

    It stays open at both ends, so clients may come and go, and it stays raw between them.

    link : path that shall point at the terminal, or None.

    Raises PortError: no pseudo-terminals here, or the link cannot be made.
    """

    def __init__(self, link: Link = None) -> None:
        self.device = ""
        self._link: Path | None = None
        self._master = self._slave = -1
        self.open(link)

    @property
    def descriptors(self) -> list[int]:
        return [self._master] if self._master >= 0 else []

    def open(self, link: Link = None) -> None:
        try:
            import tty  # a system without pseudo-terminals lacks it

            self._master, self._slave = os.openpty()
        except (ImportError, AttributeError, OSError) as error:
            raise PortError(
                f"cannot make a pseudo-terminal: {error}", hint="simulated ports need Linux or macOS"
            ) from error
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = self.device = os.ttyname(self._slave)
        if link is not None:
            try:
                self._link = _make_link(Path(link), self.device)
            except PortError:
                self.close()
                raise
            self.path = str(self._link)

    def close(self) -> None:
        if self._link is not None:
            with suppress(OSError):
                if os.readlink(self._link) == self.device:
                    self._link.unlink()
            self._link = None
        for descriptor in (self._master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self._master = self._slave = -1

    def read(self) -> bytes:
        try:
            return os.read(self._master, _CHUNK)
        except OSError:
            return b""

    def _send(self, data: bytes) -> int:
        return os.write(self._master, data)

    def baud(self) -> int | None:
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
        with suppress(OSError):
            part.unlink()
        raise PortError(f"cannot make the link {link}: {error.strerror}", hint=f"mkdir -p {link.parent}") from error
    return link


class _SocketPort(ServedPort):
    """A port with one client at a time, on a stream socket; a second client is turned away."""

    _listener: socket.socket | None = None
    _client: socket.socket | None = None

    def __init__(self, url: str) -> None:
        self.open(url)

    def open(self, link: Link = None) -> None:
        self.path = self.path if link is None else os.fspath(link)
        self._listener = self._listen()
        self._listener.setblocking(False)

    def close(self) -> None:
        if self._listener is not None:
            self._withdraw()
            self._listener.close()
            self._listener = None
        self._hang_up()

    @property
    def descriptors(self) -> list[int]:
        return [end.fileno() for end in (self._listener, self._client) if end and self._listener]

    def read(self) -> bytes:
        """What the client has written; accepts the next one when it has disconnected."""
        data = self._receive()
        with suppress(OSError):
            while True:
                client = self._accept()
                if self._client is not None:
                    client.close()
                    continue
                client.setblocking(False)
                self._client = client
        return data

    def _receive(self) -> bytes:
        if self._client is None:
            return b""
        try:
            data = self._client.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def _send(self, data: bytes) -> int:
        return self._client.send(data) if self._client else 0

    def _hang_up(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    @abstractmethod
    def _listen(self) -> socket.socket:
        """Let clients come; returns the socket that becomes readable when one does; raises PortError."""

    @abstractmethod
    def _accept(self) -> socket.socket:
        """The next client that waits; raises OSError where none does."""

    def _withdraw(self) -> None:
        """Let no more clients come."""


class TcpPort(_SocketPort):
    """Listens at ``socket://HOST:PORT``; port 0 takes a free one, and ``path`` then names it.

    scheme : of the URL.

    Raises PortError: the address cannot be listened at; PortBusy where another program does.
    """

    scheme, _option = "socket", "--tcp"

    def _listen(self) -> socket.socket:
        try:
            host, port = address_of(self.path)
            listener = socket.create_server((host, port))
        except (OSError, ValueError) as error:
            kind = PortBusy if isinstance(error, OSError) and "in use" in str(error) else PortError
            why = (error.strerror if isinstance(error, OSError) else None) or error
            raise kind(
                f"cannot listen at {self.path}: {why}", hint=f"for example {self._option} 127.0.0.1:4000"
            ) from error
        self.path = f"{self.scheme}://{host}:{listener.getsockname()[1]}"
        return listener

    def _accept(self) -> socket.socket:
        assert self._listener is not None
        client, _ = self._listener.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return client


class MemoryPort(_SocketPort):
    """Serves ``memory://NAME`` to this process. Raises PortBusy: the name is served already."""

    def _listen(self) -> socket.socket:
        self._waiting: deque[socket.socket] = deque()
        listener, self._wake = socket.socketpair()
        try:
            MEMORY_PORTS.serve(self._name, self._connect)
        except OSError as error:
            listener.close()
            self._wake.close()
            raise PortBusy(f"cannot serve {self.path}: {error.strerror}", hint="choose another name") from error
        return listener

    @property
    def _name(self) -> str:
        return self.path.partition("://")[2]

    def _connect(self, client: socket.socket) -> None:
        """A client connects, in its own thread: one byte wakes the server."""
        self._waiting.append(client)
        self._wake.send(b"x")

    def _accept(self) -> socket.socket:
        assert self._listener is not None
        self._listener.recv(1)
        return self._waiting.popleft()

    def _withdraw(self) -> None:
        MEMORY_PORTS.withdraw(self._name)
        for end in (*self._waiting, self._wake):
            end.close()
