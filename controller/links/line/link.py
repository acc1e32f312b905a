"""Serves the line protocol on a serial port, in its own thread.

Replies and streamed lines are written without waiting. A peer that does not read loses lines, which are counted, and
does not delay the face. A port that disappears is opened again when it is back, and a subscription then continues.
Errors in the thread are logged and counted and do not end it; only :meth:`LineLink.stop` does.
"""

from __future__ import annotations

import threading
import time

from controller.layers.commands import CommandSink
from controller.links.line.session import LineSession
from controller.links.line.talk import Talk
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort

_POLL_INTERVAL_S = 0.05
_RETRY_INTERVAL_S = 0.5
_MAX_READ_BYTES = 65_536
_FAULT_PAUSE_S = 0.05


class LineLink:
    """Receives commands from a serial port and streams parameters back.

    Parameters
    ----------
    port : device path. baud : its rate.
    sink : receives accepted commands, with the time they arrived.
    checksum : when lines need a checksum, one of :data:`controller.links.line.checksums.CHECKSUMS`.
    retry_s : interval between attempts to open a lost port.

    Attributes
    ----------
    connected : whether the port is open. reconnects : how often it was opened again after it had disappeared.
    """

    def __init__(
        self, port: str, baud: int, sink: CommandSink, *, checksum: str = "latched", retry_s: float = _RETRY_INTERVAL_S
    ) -> None:
        self.port = port
        self.connected = False
        self.reconnects = 0
        self._serial = SerialPort(port, baud)
        self._session = LineSession(sink, time.monotonic_ns(), name=f"line {port}", checksum=checksum)
        self._talk = Talk(self._session)
        self._retry_s = retry_s
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"link {port}", daemon=True)

    def start(self) -> LineLink:
        """Open the port and start receiving. Raises PortError: the port cannot be opened; its subclass says why."""
        self._serial.open()
        self.connected = True
        self._thread.start()
        return self

    def stop(self) -> None:
        """Stop receiving and close the port."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._serial.close()
        self.connected = False

    def report(self) -> dict[str, object]:
        """Return counts of lines, bytes, errors and reconnects, and the rate and jitter of arriving lines."""
        return {
            "port": self.port,
            "connected": self.connected,
            "accepted": self._session.accepted,
            "refused": {str(code): count for code, count in sorted(self._session.refused.items())},
            "unanswered": self._session.unanswered,
            **self._talk.counts,
            "reconnects": self.reconnects,
            "faults": self._session.faults,
            "last_fault": self._session.last_fault,
            **self._talk.meter.report(time.monotonic()),
            "error": "" if self.connected else "the port is not there",
        }

    def __enter__(self) -> LineLink:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self._serve()
            except PortError:
                self._reconnect()
            except Exception as error:  # noqa: BLE001  nothing that arrives may end the link
                self._session.fault(error, "the link continues with the next line")
                self._session.drop()
                self._stopping.wait(_FAULT_PAUSE_S)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            self._talk.serve(self._read(), self._serial.put)

    def _read(self) -> bytes:
        """Read everything that has arrived, so that a STOP is found however much came before it."""
        data = self._serial.read(time.monotonic() + self._talk.wait_s(_POLL_INTERVAL_S))
        more = data
        while more and len(data) < _MAX_READ_BYTES:
            more = self._serial.read(0.0)
            data += more
        return data

    def _reconnect(self) -> None:
        """Wait for the port to come back; the face keeps its last commands."""
        self.connected = False
        self._talk.lose()
        while not self._stopping.wait(self._retry_s):
            try:
                self._serial.open()
            except PortError:
                continue
            self.connected = True
            self.reconnects += 1
            return
