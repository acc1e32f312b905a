"""Receivers: what has arrived at a UDP port, a TCP port, a serial port or standard input."""

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
"""Who sent it, and the bytes: one datagram, or a piece of a stream; no bytes where a stream ended."""

MOST_AT_ONCE = 4096
"""Datagrams, or pieces of a stream, that are read before any is looked at."""
MOST_CONNECTIONS = 8
AUTH_S = 10.0
"""How long a caller may take to give its token."""
_BUFFER = 1 << 21
_CHUNK = 65_536
_RETRY_S = 0.5
_KEEP_ALIVE = {"TCP_KEEPIDLE": 4, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}
"""Seconds of silence until the first question, between two, and how many may stay without an answer."""


class Receiver(Protocol):
    """Bytes from far ends.

    error : what went wrong last, for people; empty while all is well.
    """

    error: str

    def receive(self, timeout_s: float) -> Received:
        """Wait for something at most so long, and return all that is there."""

    def close(self) -> None:
        """Give back what was opened."""


@dataclass(frozen=True)
class Gate:
    """What a stream, or each datagram, must begin with: ``AUTH token`` and the delimiter of its messages.

    turned_away : how many did not.
    """

    token: str
    delimiter: bytes
    turned_away: Refusals = field(default_factory=Refusals)

    def turn_away(self, what: str) -> str:
        """Count one that did not begin so; says what, for people."""
        self.turned_away.add(f"{what} without the token")
        return f"{what} without the token, which was turned away"

    @property
    def first(self) -> bytes:
        """The first message, with its end."""
        return auth_message(self.token) + self.delimiter

    def lets_in(self, start: bytes) -> bool | None:
        """Whether a stream that begins so may go on; None where that cannot be said yet."""
        if len(start) < len(self.first):
            return None if self.delimiter not in start else False
        return hmac.compare_digest(start[: len(self.first)], self.first)

    def behind(self, datagram: bytes) -> bytes | None:
        """What of a datagram follows the token; None where that is not right."""
        return datagram[len(self.first) :] if self.lets_in(datagram) else None


def auth_message(token: str) -> bytes:
    """What says a token at the beginning of a stream."""
    return f"AUTH {token}".encode()


class UdpReceiver:
    """Datagrams; a sender is its host. ``gate`` : what each must begin with."""

    def __init__(self, address: Address, gate: Gate | None = None) -> None:
        self.error = ""
        self._gate = gate
        self._socket = bound(address, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)

    def receive(self, timeout_s: float) -> Received:
        found: Received = []
        if not self._selector.select(timeout_s):
            return found
        receive = self._socket.recvfrom
        try:
            while len(found) < MOST_AT_ONCE:
                data, sender = receive(_CHUNK)
                if counted := data if self._gate is None else self._behind(self._gate, data):
                    found.append((sender[0], counted))
        except BlockingIOError:
            pass
        except OSError as error:  # an answer of the network to what another program sent
            self.error = str(error.strerror)
        return found

    def _behind(self, gate: Gate, data: bytes) -> bytes:
        counted = gate.behind(data)
        if counted is None:
            self.error = gate.turn_away("a datagram")
        return counted or b""

    def send(self, data: bytes, host: str, port: int) -> None:
        """Send a datagram from the same port. Raises OSError."""
        self._socket.sendto(data, (host, port))

    def close(self) -> None:
        self._selector.close()
        self._socket.close()


class _Call:
    """One caller of a listener; ``start`` : how its stream begins, until that is known to be right."""

    def __init__(self, sender: str, gate: Gate | None) -> None:
        self.sender, self._gate = sender, gate
        self._web, self._start, self._since_s = WebRequests(), b"", time.monotonic()

    def late(self) -> str:
        """What it is, where it has not given its token in time."""
        if self._gate is None or time.monotonic() - self._since_s <= AUTH_S:
            return ""
        return self._gate.turn_away("a caller")

    def take(self, data: bytes) -> bytes:
        """What of a piece of its stream counts. Raises ValueError: it must hang up; says why."""
        if self._web.begins(data):
            raise ValueError("a web browser, which was turned away")
        if self._gate is None:
            return data
        self._start += data
        match self._gate.lets_in(self._start):
            case None:
                return b""
            case False:
                raise ValueError(self._gate.turn_away("a caller"))
        data, self._start = self._start[len(self._gate.first) :], b""
        self._gate = None
        return data


class TcpListener:
    """Streams of those who call; a sender is its host and port. ``gate`` : what they must begin with."""

    def __init__(self, address: Address, gate: Gate | None = None) -> None:
        self.error = ""
        self._gate = gate
        self._socket = bound(address, socket.SOCK_STREAM)
        self._socket.listen(MOST_CONNECTIONS)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._calls: dict[socket.socket, _Call] = {}

    def receive(self, timeout_s: float) -> Received:
        found: Received = []
        for key, _ in self._selector.select(timeout_s):
            if key.data is None:
                self._accept()
            else:
                found += self._read(key.fileobj, key.data)  # type: ignore[arg-type]
        for call, caller in [*self._calls.items()]:
            if late := caller.late():
                self.error = late
                self._hang_up(call)
        return found

    def close(self) -> None:
        self._selector.close()
        for each in (*self._calls, self._socket):
            each.close()

    def _accept(self) -> None:
        try:
            call, sender = self._socket.accept()
        except OSError as error:
            self.error = str(error.strerror)
            return
        if len(self._calls) >= MOST_CONNECTIONS:
            call.close()
            self.error = f"more than {MOST_CONNECTIONS} connections"
            return
        call.setblocking(False)
        notice_loss(call)
        self._calls[call] = _Call(f"{sender[0]}:{sender[1]}", self._gate)
        self._selector.register(call, selectors.EVENT_READ, self._calls[call])

    def _read(self, call: socket.socket, caller: _Call) -> Received:
        """A piece of a stream; no bytes where it ended, nothing where none of it counts yet."""
        try:
            data = call.recv(_CHUNK)
            if data:
                counted = caller.take(data)
                return [(caller.sender, counted)] if counted else []
        except BlockingIOError:
            return []
        except ValueError as error:
            self.error = str(error)
        except OSError:
            pass  # it ended, however it did
        self._hang_up(call)
        return [(caller.sender, b"")]

    def _hang_up(self, call: socket.socket) -> None:
        self._selector.unregister(call)
        call.close()
        del self._calls[call]


class TcpCaller:
    """The stream of a program that is called, greeted, and called again where it hangs up."""

    def __init__(self, address: Address, greeting: bytes = b"") -> None:
        self.error = "not connected yet"
        self._address, self._greeting = address, greeting
        self._socket: socket.socket | None = None
        self._next_s = 0.0

    def receive(self, timeout_s: float) -> Received:
        if self._socket is None and not self._call(timeout_s):
            return []
        assert self._socket is not None
        self._socket.settimeout(max(timeout_s, 1e-3))
        try:
            data = self._socket.recv(_CHUNK)
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

    def _call(self, timeout_s: float) -> bool:
        wait_s = self._next_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(min(wait_s, timeout_s))
            return False
        self._next_s = time.monotonic() + _RETRY_S
        try:
            self._socket = socket.create_connection((self._address.host, self._address.port), _RETRY_S)
            notice_loss(self._socket)
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
    """The stream of a serial port, which is opened again where it vanishes.

    port : the serial port; another thread may write to it meanwhile.
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
            self.error, self._next_s = str(error), time.monotonic() + _RETRY_S
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
    """Standard input, until it ends."""

    def __init__(self) -> None:
        self.error = ""
        self.ended = False
        self._file = os.dup(sys.stdin.fileno())
        self._selector: selectors.BaseSelector | None = None
        try:
            self._selector = selectors.DefaultSelector()
            self._selector.register(self._file, selectors.EVENT_READ)
        except PermissionError:  # a file is always ready
            self._selector = None

    def receive(self, timeout_s: float) -> Received:
        if self.ended:
            time.sleep(timeout_s)
            return []
        if self._selector is not None and not self._selector.select(timeout_s):
            return []
        data = os.read(self._file, _CHUNK)
        if not data:
            self.ended, self.error = True, "standard input has ended"
        return [("standard input", data)]

    def close(self) -> None:
        if self._selector is not None:
            self._selector.close()
        os.close(self._file)


def notice_loss(call: socket.socket) -> None:
    """Let a connection end about ten seconds after its far end went without a word, as where a cable is pulled."""
    call.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEP_ALIVE.items():
        if hasattr(socket, name):  # not every system has all of them
            call.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


_LISTEN_HINTS = {
    errno.EADDRINUSE: "another program listens there: end it, or choose another port: ss -lunpt | grep {port}",
    errno.EACCES: "choose a port from 1024 on: those below are for programs with rights",
}


def bound(address: Address, kind: socket.SocketKind) -> socket.socket:
    """A socket at an address that does not block. Raises LinkError."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    made = socket.socket(family, kind)
    try:
        if kind == socket.SOCK_STREAM and os.name == "posix":
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((address.host, address.port))
    except OSError as error:
        made.close()
        hint = _LISTEN_HINTS.get(error.errno or 0, "give an address of this machine: ip address shows them")
        raise LinkError(
            f"{address}: cannot listen: {error.strerror or error}", hint=hint.format(port=address.port)
        ) from error
    made.setblocking(False)
    return made
