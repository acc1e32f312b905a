"""A port over RFC 2217, the protocol of serial ports over TCP: clients also set the bit rate, as on a real adapter.

Telnet and the options of RFC 2217 are pyserial's (``serial.rfc2217.PortManager``). Clients open
``rfc2217://HOST:PORT`` with ``serial.serial_for_url``, also in a container or on Windows.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from serial.rfc2217 import PortManager

from drivers.sim.serving.ports import TcpPort

MAX_UNSENT = 1 << 16
"""Number of bytes kept for a client that does not read; further bytes are lost."""
MAX_OPTION = 1024
"""Greatest length of a telnet option, bytes; the longest of RFC 2217 has five."""
_WRONG = (ValueError, TypeError, LookupError, AttributeError, struct.error)
"""Errors that pyserial's manager raises for a client that violates the protocol."""


@dataclass
class _Settings:
    """What a client can set, named as pyserial's manager expects; only the bit rate has an effect."""

    baudrate: int = 0
    bytesize: int = 8
    parity: str = "N"
    stopbits: float = 1
    xonxoff: bool = False
    rtscts: bool = False
    dtr: bool = True
    rts: bool = True
    break_condition: bool = False
    cts: bool = True
    dsr: bool = True
    ri: bool = False
    cd: bool = True

    def reset_input_buffer(self) -> None:
        """Nothing is kept back."""

    def reset_output_buffer(self) -> None:
        """Nothing is kept back."""


@dataclass
class _Connection:
    """Where the manager writes telnet's own bytes."""

    write: Callable[[bytes], object]


class Rfc2217Port(TcpPort):
    """Listens at ``rfc2217://HOST:PORT``, one client at a time. Port 0 and errors as in the base class."""

    scheme, _option = "rfc2217", "--rfc2217"

    def __init__(self, url: str) -> None:
        self._settings, self._unsent = _Settings(), b""
        super().__init__(url)

    def baud(self) -> int | None:
        return self._settings.baudrate or None

    def _accept(self) -> socket.socket:
        client = super()._accept()
        if self._client is None:
            client.setblocking(False)
            self._settings, self._unsent = _Settings(), b""
            self._target = client
            self._manager = PortManager(self._settings, _Connection(self._push))
        return client

    def _receive(self) -> bytes:
        data = super()._receive()
        try:
            plain = b"".join(self._manager.filter(data)) if data else b""
            too_long = data and len(self._manager.suboption or b"") > MAX_OPTION
        except _WRONG:
            plain, too_long = b"", True
        if too_long:
            self._hang_up()
        return plain

    def _send(self, data: bytes) -> int:
        if self._client is None or not self._push(b""):
            return 0
        self._push(b"".join(self._manager.escape(data)))
        return len(data)

    def _push(self, data: bytes) -> bool:
        """Send bytes after those that wait; False where so many wait that no more should come."""
        self._unsent += data
        with suppress(OSError):
            self._unsent = self._unsent[self._target.send(self._unsent) :]
        return len(self._unsent) < MAX_UNSENT
