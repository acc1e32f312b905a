"""Sends messages to a UDP, TCP or serial port or to standard output, and drops those for which there is no room."""

from __future__ import annotations

import errno
import os
import select
import socket
import sys
import time
from contextlib import suppress
from typing import Protocol

from controller.links.net.address import Address
from controller.links.net.receivers import auth_message
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort

_RETRY_INTERVAL_S = 0.5
_MAX_READ_BYTES = 65_536


class Sender(Protocol):
    """Sends messages to a far end.

    error : the last error, for people; empty if there is none.
    """

    error: str

    def send(self, message: bytes) -> bool:
        """Send one message; return False if it was dropped, because the far end is not there or has no room."""

    def close(self) -> None:
        """Close what was opened."""


def open_sender(address: Address, delimiter: bytes, baud: int = 115_200, token: str | None = None) -> Sender:
    """Open and return the sender for an address.

    delimiter : ends each message of a stream. token : sent at the beginning of a TCP stream and of each datagram.

    Raises PortError: the serial port cannot be opened.
    """
    if address.transport == "udp":
        return UdpSender(address, b"" if token is None else auth_message(token) + delimiter)
    if address.transport == "tcp":
        return TcpSender(address, delimiter, token)
    if address.transport == "midi":
        from controller.links.net.midi import MidiSender  # imported lazily: few links need it

        return MidiSender(address.device)
    return SerialSender(address.device, delimiter, baud) if address.transport == "serial" else OutputSender(delimiter)


class UdpSender:
    """Sends datagrams, each of which begins with ``prefix``."""

    def __init__(self, address: Address, prefix: bytes = b"") -> None:
        self.error = ""
        self._prefix = prefix
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._to = address.host, address.port

    def send(self, message: bytes) -> bool:
        try:
            self._socket.sendto(self._prefix + message, self._to)
        except ConnectionRefusedError:
            pass  # reported for the previous datagram, to which nobody listened
        except OSError as error:
            self.error = error.strerror or type(error).__name__
            return False
        self.error = ""
        return True

    def close(self) -> None:
        self._socket.close()


class _Stream:
    """Writes messages to a stream without waiting; a new message is dropped while part of the last one is unsent."""

    def __init__(self, delimiter: bytes) -> None:
        self.error = ""
        self._delimiter, self._rest = delimiter, b""

    def send(self, message: bytes) -> bool:
        if self._rest:
            self._push()
        if self._rest or not self._ready():
            return False
        self._rest = message + self._delimiter
        self._push()
        return True

    def _push(self) -> None:
        raise NotImplementedError

    def _ready(self) -> bool:
        return True


class TcpSender(_Stream):
    """Sends a stream to a program that it connects to, again whenever the connection is closed."""

    def __init__(self, address: Address, delimiter: bytes, token: str | None = None) -> None:
        super().__init__(delimiter)
        self._address = address
        self._prefix = b"" if token is None else auth_message(token) + delimiter
        self._socket: socket.socket | None = None
        self._next_s = 0.0

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def _ready(self) -> bool:
        if self._socket is not None:
            return True
        if time.monotonic() < self._next_s:
            return False
        self._next_s = time.monotonic() + _RETRY_INTERVAL_S
        try:
            self._socket = socket.create_connection((self._address.host, self._address.port), _RETRY_INTERVAL_S)
        except OSError as error:
            self.error = error.strerror or type(error).__name__
            return False
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self.error = ""
        self._rest = self._prefix
        self._push()
        return self._socket is not None and not self._rest

    def _push(self) -> None:
        try:
            if self._socket is not None:
                self._discard_answers(self._socket)
                self._rest = self._rest[self._socket.send(self._rest) :]
        except BlockingIOError:
            pass
        except OSError as error:
            self.error, self._rest = error.strerror or type(error).__name__, b""
            self.close()
            self._socket = None

    @staticmethod
    def _discard_answers(connection: socket.socket) -> None:
        """Read and discard answers, so that they never block the far end. Raises OSError: the connection is closed."""
        with suppress(BlockingIOError):
            if not connection.recv(_MAX_READ_BYTES):
                raise ConnectionResetError(errno.ECONNRESET, "the far end hung up")


class SerialSender(_Stream):
    """Sends a stream to a serial port, which is opened again after it has disappeared."""

    def __init__(self, device: str, delimiter: bytes, baud: int) -> None:
        super().__init__(delimiter)
        self._port = SerialPort(device, baud)
        self._port.open()
        self._next_s = 0.0

    def close(self) -> None:
        self._port.close()

    def _ready(self) -> bool:
        if self._port.is_open:
            return True
        if time.monotonic() < self._next_s:
            return False
        try:
            self._port.open()
        except PortError as error:
            self.error, self._next_s = str(error), time.monotonic() + _RETRY_INTERVAL_S
            return False
        self.error = ""
        return True

    def _push(self) -> None:
        try:
            self._rest = self._rest[self._port.put(self._rest) :]
        except PortError as error:
            self.error, self._rest, self._next_s = str(error), b"", time.monotonic() + _RETRY_INTERVAL_S
            self._port.close()


class SerialAnswerer(_Stream):
    """Sends a stream to a serial port that a receiver opens, reopens and closes."""

    def __init__(self, port: SerialPort, delimiter: bytes) -> None:
        super().__init__(delimiter)
        self._port = port

    def close(self) -> None:
        pass  # the receiver closes the port

    def _ready(self) -> bool:
        return self._port.is_open

    def _push(self) -> None:
        try:
            self._rest, self.error = self._rest[self._port.put(self._rest) :], ""
        except PortError as error:
            self.error, self._rest = str(error), b""


class OutputSender:
    """Writes to standard output; messages are dropped while the reader does not read."""

    def __init__(self, delimiter: bytes) -> None:
        self.error = ""
        self._delimiter = delimiter
        self._file = os.dup(sys.stdout.fileno())

    def send(self, message: bytes) -> bool:
        try:
            if not select.select([], [self._file], [], 0.0)[1]:
                return False
            os.write(self._file, message + self._delimiter)
        except OSError as error:
            self.error = error.strerror or type(error).__name__
            return False
        return True

    def close(self) -> None:
        os.close(self._file)
