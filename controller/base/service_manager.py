"""Reports to systemd that a program is ready, alive or stopping, by datagrams as sd_notify(3) describes them.

Outside of a service, where ``NOTIFY_SOCKET`` is not set, nothing is sent.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

PINGS = 3.0
"""Pings within the time after which systemd gives the program up (sd_watchdog_enabled(3) advises two)."""


class ServiceManager:
    """The service manager that started this process, if one did.

    environment : with ``NOTIFY_SOCKET`` and ``WATCHDOG_USEC``. clock : monotonic seconds.
    """

    def __init__(
        self, environment: Mapping[str, str] = os.environ, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._address = environment.get("NOTIFY_SOCKET", "")
        given = environment.get("WATCHDOG_USEC", "")
        self._period_s = int(given) / 1e6 / PINGS if given.isdigit() else 0.0
        self._clock, self._next_s, self._seen = clock, 0.0, -1

    @property
    def watches(self) -> bool:
        """Whether a service manager waits for signs of life."""
        return bool(self._address and self._period_s)

    def ready(self) -> None:
        """The servos are up."""
        self._send("READY=1")

    def stopping(self) -> None:
        """The servos are being brought to rest."""
        self._send("STOPPING=1")

    def alive(self, sequence: int) -> None:
        """Ping where that is due, and only if ``sequence`` moved on since the last ping: work is still being done."""
        if not self.watches or self._clock() < self._next_s or sequence == self._seen:
            return
        self._next_s, self._seen = self._clock() + self._period_s, sequence
        self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if not self._address or not hasattr(socket, "AF_UNIX"):
            return
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.sendto(text.encode(), address)
