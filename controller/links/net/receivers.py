"""Provides receivers, which return the bytes that have arrived at a UDP, TCP or serial port or at standard input."""

from __future__ import annotations

import errno
import hmac
import os
import selectors
import socket
import sys
import time
from dataclasses import dataclass, field
from typing import Protocol

from controller.base.errors import LinkError
from controller.formats.frame import Refusals
from controller.links.access import WebRequests
from controller.links.net.address import Address
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort

Received = list[tuple[str, bytes]]
"""Sender and bytes: a datagram, or a piece of a stream; empty bytes when a stream has ended."""

MAX_DATAGRAMS = 4096
"""Number of datagrams that one call of ``receive`` returns at most."""
MAX_CONNECTIONS = 8
AUTH_TIMEOUT_S = 10.0
"""How long a client may take to send its token."""
_SOCKET_BUFFER_BYTES = 1 << 21
_MAX_READ_BYTES = 65_536
_RETRY_INTERVAL_S = 0.5
_KEEP_ALIVE = {"TCP_KEEPIDLE": 4, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
"""Seconds of silence until the first probe, seconds between probes, and number of probes that may go unanswered."""


class Receiver(Protocol):
    """Receives bytes from far ends.

    error : the last error, for people; empty if there is none.
    """

    error: str

    def receive(self, timeout_s: float) -> Received:
        """Wait at most ``timeout_s`` for something to arrive, and return everything that has arrived."""

    def close(self) -> None:
        """Close what was opened."""


@dataclass(frozen=True)
class Gate:
    """Checks that a stream, or each datagram, begins with ``AUTH token`` and the delimiter of its messages.

    turned_away : counts of those that were rejected.
    """

    token: str
    delimiter: bytes
    turned_away: Refusals = field(default_factory=Refusals)

    def reject(self, what: str) -> str:
        """Count a stream or datagram that did not begin with the token; return the error for people."""
        self.turned_away.add(f"{what} without the token")
        return f"{what} without the token, which was turned away"

    @property
    def prefix(self) -> bytes:
        """The first message, with its delimiter."""
        return auth_message(self.token) + self.delimiter

    def accepts(self, start: bytes) -> bool | None:
        """Whether a stream that begins with ``start`` has the token; None if more bytes are needed."""
        if len(start) < len(self.prefix):
            return None if self.delimiter not in start else False
        return hmac.compare_digest(start[: len(self.prefix)], self.prefix)

    def strip_token(self, datagram: bytes) -> bytes | None:
        """Return what follows the token in a datagram; None if the token is wrong or missing."""
        return datagram[len(self.prefix) :] if self.accepts(datagram) else None


def auth_message(token: str) -> bytes:
    """Return the message that gives a token at the beginning of a stream or datagram."""
    return f"AUTH {token}".encode()


class UdpReceiver:
    """Receives datagrams; a sender is named by its host. gate : checks the token of each; None: none is needed."""

    def __init__(self, address: Address, gate: Gate | None = None) -> None:
        self.error = ""
        self._gate = gate
        self._socket = bind_socket(address, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BUFFER_BYTES)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)

    def receive(self, timeout_s: float) -> Received:
        found: Received = []
        if not self._selector.select(timeout_s):
            return found
        receive = self._socket.recvfrom
        try:
            while len(found) < MAX_DATAGRAMS:
                data, sender = receive(_MAX_READ_BYTES)
                if content := data if self._gate is None else self._check_token(self._gate, data):
                    found.append((sender[0], content))
        except BlockingIOError:
            pass
        except OSError as error:  # such as an ICMP error for a datagram that was sent from this port
            self.error = str(error.strerror)
        return found

    def _check_token(self, gate: Gate, data: bytes) -> bytes:
        """Return the content of a datagram; empty without the token."""
        content = gate.strip_token(data)
        if content is None:
            self.error = gate.reject("a datagram")
        return content or b""

    def send(self, data: bytes, host: str, port: int) -> None:
        """Send a datagram from the same port. Raises OSError."""
        self._socket.sendto(data, (host, port))

    def close(self) -> None:
        self._selector.close()
        self._socket.close()


class _Connection:
    """One client of a listener, whose token is checked at the beginning of its stream."""

    def __init__(self, sender: str, gate: Gate | None) -> None:
        self.sender, self._gate = sender, gate
        self._web, self._start, self._since_s = WebRequests(), b"", time.monotonic()

    def reject_if_late(self) -> str:
        """Reject a client that has not sent its token in time, and return the error; empty for any other client."""
        if self._gate is None or time.monotonic() - self._since_s <= AUTH_TIMEOUT_S:
            return ""
        return self._gate.reject("a caller")

    def take(self, data: bytes) -> bytes:
        """Return the content of a piece of its stream. Raises ValueError: why the connection must be closed."""
        if self._web.begins(data):
            raise ValueError("a web browser, which was turned away")
        if self._gate is None:
            return data
        self._start += data
        match self._gate.accepts(self._start):
            case None:
                return b""
            case False:
                raise ValueError(self._gate.reject("a caller"))
        data, self._start = self._start[len(self._gate.prefix) :], b""
        self._gate = None
        return data


class TcpListener:
    """Receives the streams of clients; a sender is named by its host and port. gate : checks the token of each."""

    def __init__(self, address: Address, gate: Gate | None = None) -> None:
        self.error = ""
        self._gate = gate
        self._socket = bind_socket(address, socket.SOCK_STREAM)
        self._socket.listen(MAX_CONNECTIONS)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._connections: dict[socket.socket, _Connection] = {}

    def receive(self, timeout_s: float) -> Received:
        found: Received = []
        for key, _ in self._selector.select(timeout_s):
            if key.data is None:
                self._accept()
            else:
                found += self._read(key.fileobj, key.data)  # type: ignore[arg-type]
        for client, connection in [*self._connections.items()]:
            if why := connection.reject_if_late():
                self.error = why
                self._close_connection(client)
        return found

    def close(self) -> None:
        self._selector.close()
        for each in (*self._connections, self._socket):
            each.close()

    def _accept(self) -> None:
        try:
            client, sender = self._socket.accept()
        except OSError as error:
            self.error = str(error.strerror)
            return
        if len(self._connections) >= MAX_CONNECTIONS:
            client.close()
            self.error = f"more than {MAX_CONNECTIONS} connections"
            return
        client.setblocking(False)
        enable_keepalive(client)
        self._connections[client] = _Connection(f"{sender[0]}:{sender[1]}", self._gate)
        self._selector.register(client, selectors.EVENT_READ, self._connections[client])

    def _read(self, client: socket.socket, connection: _Connection) -> Received:
        """Read a piece of a stream: empty bytes when it has ended, nothing if it has no content yet."""
        try:
            data = client.recv(_MAX_READ_BYTES)
            if data:
                content = connection.take(data)
                return [(connection.sender, content)] if content else []
        except BlockingIOError:
            return []
        except ValueError as error:
            self.error = str(error)
        except OSError:
            pass  # the connection has ended in any case
        self._close_connection(client)
        return [(connection.sender, b"")]

    def _close_connection(self, client: socket.socket) -> None:
        self._selector.unregister(client)
        client.close()
        del self._connections[client]


class TcpCaller:
    """Receives the stream of a program that it connects to, again whenever the connection is closed."""

    def __init__(self, address: Address, greeting: bytes = b"") -> None:
        self.error = "not connected yet"
        self._address, self._greeting = address, greeting
        self._socket: socket.socket | None = None
        self._next_s = 0.0

    def receive(self, timeout_s: float) -> Received:
        if self._socket is None and not self._connect(timeout_s):
            return []
        assert self._socket is not None
        self._socket.settimeout(max(timeout_s, 1e-3))
        try:
            data = self._socket.recv(_MAX_READ_BYTES)
        except TimeoutError:
            return []
        except OSError as error:
            self._hang_up(error.strerror or type(error).__name__)
            return [(str(self._address), b"")]
        if not data:
            self._hang_up("the far end hung up")
        return [(str(self._address), data)]

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def _connect(self, timeout_s: float) -> bool:
        wait_s = self._next_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(min(wait_s, timeout_s))
            return False
        self._next_s = time.monotonic() + _RETRY_INTERVAL_S
        try:
            self._socket = socket.create_connection((self._address.host, self._address.port), _RETRY_INTERVAL_S)
            enable_keepalive(self._socket)
            self._socket.sendall(self._greeting)
        except OSError as error:
            self._hang_up(error.strerror or type(error).__name__)
            return False
        self.error = ""
        return True

    def _hang_up(self, why: str) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket, self.error = None, why


class SerialReceiver:
    """Receives the stream of a serial port, which is opened again after it has disappeared.

    port : the serial port; another thread may write to it at the same time.
    """

    def __init__(self, device: str, baud: int) -> None:
        self.error = ""
        self.port = SerialPort(device, baud)
        self.port.open()
        self._next_s = 0.0

    def receive(self, timeout_s: float) -> Received:
        try:
            if not self.port.is_open and not self._reopen(timeout_s):
                return []
            data = self.port.read(time.monotonic() + timeout_s)
        except PortError as error:
            self.port.close()
            self.error, self._next_s = str(error), time.monotonic() + _RETRY_INTERVAL_S
            return [(self.port.path, b"")]
        return [(self.port.path, data)] if data else []

    def close(self) -> None:
        self.port.close()

    def _reopen(self, timeout_s: float) -> bool:
        wait_s = self._next_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(min(wait_s, timeout_s))
            return False
        self.port.open()
        self.error = ""
        return True


class InputReceiver:
    """Receives standard input until it ends."""

    def __init__(self) -> None:
        self.error = ""
        self.ended = False
        self._file = os.dup(sys.stdin.fileno())
        self._selector: selectors.BaseSelector | None = None
        try:
            self._selector = selectors.DefaultSelector()
            self._selector.register(self._file, selectors.EVENT_READ)
        except PermissionError:  # a regular file, which is always ready
            self._selector = None

    def receive(self, timeout_s: float) -> Received:
        if self.ended:
            time.sleep(timeout_s)
            return []
        if self._selector is not None and not self._selector.select(timeout_s):
            return []
        data = os.read(self._file, _MAX_READ_BYTES)
        if not data:
            self.ended, self.error = True, "standard input has ended"
        return [("standard input", data)]

    def close(self) -> None:
        if self._selector is not None:
            self._selector.close()
        os.close(self._file)


def enable_keepalive(connection: socket.socket) -> None:
    """Make a connection fail about ten seconds after its far end has vanished, for instance when a cable is pulled."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEP_ALIVE.items():
        if hasattr(socket, name):  # not every system has all of them
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


_LISTEN_HINTS = {
    errno.EADDRINUSE: "another program listens there: end it, or choose another port: ss -lunpt | grep {port}",
    errno.EACCES: "choose a port from 1024 on: lower ones need special rights",
}


def bind_socket(address: Address, kind: socket.SocketKind) -> socket.socket:
    """Return a non-blocking socket that is bound to an address. Raises LinkError: it cannot be bound."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    created = socket.socket(family, kind)
    try:
        if kind == socket.SOCK_STREAM and os.name == "posix":
            created.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        created.bind((address.host, address.port))
    except OSError as error:
        created.close()
        hint = _LISTEN_HINTS.get(error.errno or 0, "give an address of this machine: ip address shows them")
        raise LinkError(
            f"{address}: cannot listen: {error.strerror or error}", hint=hint.format(port=address.port)
        ) from error
    created.setblocking(False)
    return created
