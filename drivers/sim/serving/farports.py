"""The far ends of ports that simulated buses serve: pseudo-terminals, TCP, and lines within this process.

``memory://NAME`` lets programs on systems without pseudo-terminals use a bus that runs in a thread of theirs.
"""

from __future__ import annotations

import os
import select
import socket
from abc import ABC, abstractmethod
from collections import deque
from contextlib import suppress
from typing import Protocol

from drivers.base.errors import PortBusy, PortError
from drivers.port.endpoints import MEMORY_PORTS, address_of
from drivers.sim.serving.ptyport import PtyPort

_CHUNK = 65536


class FarPort(Protocol):
    """What a server needs of a port.

    Attributes
    ----------
    dropped : bytes lost because the client did not read.
    """

    dropped: int

    @property
    def path(self) -> str:
        """What a client opens."""

    @property
    def is_open(self) -> bool:
        """Whether clients may come."""

    @property
    def descriptors(self) -> list[int]:
        """What to wait on."""

    def open(self, link: str | os.PathLike[str] | None = None) -> None:
        """Come back after ``close``, under another name where one is given."""

    def close(self) -> None:
        """Pull the plug."""

    def read(self) -> bytes:
        """What the client has written; empty when there is nothing."""

    def write(self, data: bytes) -> None:
        """Send to the client, as much as it has room for."""

    def baud(self) -> int | None:
        """Bit rate the client has set, where that is known."""


def make_port(link: str | os.PathLike[str] | None) -> FarPort:
    """The port that a link asks for: a path or nothing makes a pseudo-terminal, a URL what it names.

    Raises
    ------
    PortError : it cannot be made.
    """
    text = "" if link is None else os.fspath(link)
    if text.startswith("socket://"):
        return TcpPort(text)
    if text.startswith("memory://"):
        return MemoryPort(text)
    return PtyPort(link)


class _SocketPort(ABC):
    """A port with one client at a time, on a stream socket."""

    def __init__(self, url: str) -> None:
        self.dropped = 0
        self.path = url
        self.is_open = False
        self._client: socket.socket | None = None
        self.open()

    def open(self, link: str | os.PathLike[str] | None = None) -> None:
        """Offer the port."""
        self.path = self.path if link is None else os.fspath(link)
        self._offer()
        self.is_open = True

    def close(self) -> None:
        """Hang up, and offer it no longer."""
        if self.is_open:
            self.is_open = False
            self._withdraw()
        self._hang_up()

    @property
    def descriptors(self) -> list[int]:
        """What to wait on: the client's bytes, and clients to come."""
        if not self.is_open:
            return []
        return [self._door(), *([self._client.fileno()] if self._client else [])]

    def read(self) -> bytes:
        """What the client has written; lets the next one in when it has gone."""
        data = self._receive()
        while (caller := self._admit()) is not None:
            if self._client is not None:
                caller.close()  # a port has one user
                continue
            caller.setblocking(False)
            self._client = caller
        return data

    def write(self, data: bytes) -> None:
        """Send to the client, as much as it has room for."""
        sent = 0
        with suppress(OSError):
            sent = self._client.send(data) if self._client else 0
        self.dropped += len(data) - sent

    def baud(self) -> int | None:
        """Nobody sets one on a socket."""
        return None

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

    def _hang_up(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    @abstractmethod
    def _offer(self) -> None:
        """Let clients come; raises PortError."""

    @abstractmethod
    def _withdraw(self) -> None:
        """Let none come any more."""

    @abstractmethod
    def _door(self) -> int:
        """Descriptor that becomes ready when a client comes."""

    @abstractmethod
    def _admit(self) -> socket.socket | None:
        """The next client at the door."""


class TcpPort(_SocketPort):
    """Listens at ``socket://HOST:PORT``; port 0 takes a free one, and ``path`` then names it.

    Raises
    ------
    PortError : the address cannot be listened at; PortBusy where somebody else does.
    """

    def _offer(self) -> None:
        try:
            host, port = address_of(self.path)
            self._listener = socket.create_server((host, port))
        except (OSError, ValueError) as error:
            kind = PortBusy if isinstance(error, OSError) and "in use" in str(error) else PortError
            raise kind(f"cannot listen at {self.path}: {error}", hint="for example --tcp 127.0.0.1:4000") from error
        self._listener.setblocking(False)
        self.path = f"socket://{host}:{self._listener.getsockname()[1]}"

    def _withdraw(self) -> None:
        self._listener.close()

    def _door(self) -> int:
        return self._listener.fileno()

    def _admit(self) -> socket.socket | None:
        try:
            caller, _ = self._listener.accept()
        except OSError:
            return None
        caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return caller


class MemoryPort(_SocketPort):
    """Serves ``memory://NAME`` to this process.

    Raises
    ------
    PortBusy : the name is served already.
    """

    def _offer(self) -> None:
        self._waiting: deque[socket.socket] = deque()
        self._bell, self._ring = socket.socketpair()
        self._bell.setblocking(False)
        try:
            MEMORY_PORTS.serve(self._name, self._call)
        except OSError as error:
            self._bell.close()
            self._ring.close()
            raise PortBusy(f"cannot serve {self.path}: {error.strerror}", hint="choose another name") from error

    @property
    def _name(self) -> str:
        return self.path.partition("://")[2]

    def _call(self, caller: socket.socket) -> None:
        """A client comes, in its own thread."""
        self._waiting.append(caller)
        self._ring.send(b"x")

    def _withdraw(self) -> None:
        MEMORY_PORTS.withdraw(self._name)
        for end in (*self._waiting, self._bell, self._ring):
            end.close()

    def _door(self) -> int:
        return self._bell.fileno()

    def _admit(self) -> socket.socket | None:
        if not self._waiting:
            return None
        if select.select([self._bell], [], [], 0.0)[0]:
            self._bell.recv(1)
        return self._waiting.popleft()
