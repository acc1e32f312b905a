"""Receives UDP datagrams from a program that sends them on request, and repeats the request while nothing arrives."""

from __future__ import annotations

import socket
import time

from controller.base.errors import LinkError
from controller.links.net.address import Address
from controller.links.net.receivers import Received, UdpReceiver

REQUEST_INTERVAL_S = 1.0
"""Time between requests while nothing arrives."""


class UdpCaller:
    """Receives the datagrams of one host on request.

    It listens on the interface that reaches the host, at the same port number as the host's, to which phones send.
    greeting : the request. error : why nothing arrives; empty while datagrams do.

    Raises LinkError: the host is unknown or cannot be reached, or the port is in use.
    """

    def __init__(self, address: Address, greeting: bytes) -> None:
        self._host, own = _hosts(address)
        self._port, self._greeting = address.port, greeting
        self._receiver = UdpReceiver(Address("udp", own, address.port))
        self._quiet_since_s = -REQUEST_INTERVAL_S
        self._requested = False  # since the last datagram
        self.error = ""

    def receive(self, timeout_s: float) -> Received:
        if time.monotonic() - self._quiet_since_s >= REQUEST_INTERVAL_S:
            self._request()
        found = [each for each in self._receiver.receive(timeout_s) if each[0] == self._host]
        if found:
            self._quiet_since_s, self._requested, self.error = time.monotonic(), False, self._receiver.error
        return found

    def close(self) -> None:
        self._receiver.close()

    def _request(self) -> None:
        self.error = self._receiver.error or (f"{self._host} has not answered the request" if self._requested else "")
        self._quiet_since_s, self._requested = time.monotonic(), True
        try:
            self._receiver.send(self._greeting, self._host, self._port)
        except OSError as error:
            self.error = error.strerror or type(error).__name__


def _hosts(address: Address) -> tuple[str, str]:
    """Return the numeric address of the far end, and that of this machine's interface that reaches it."""
    try:
        family, _, _, _, there = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)[0]
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect(there)  # sends nothing
            return str(there[0]), str(probe.getsockname()[0])
    except OSError as error:
        raise LinkError(
            f"{address}: cannot be reached: {error.strerror or error}",
            hint="give the address that the program shows, for example 192.168.1.20, and use the same network",
        ) from error
