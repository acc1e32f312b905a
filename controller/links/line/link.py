"""Serves the line protocol on a serial port, in its own thread.

Replies and streamed lines are written without waiting: a peer that does not read loses lines, and never holds up the
face. A port that vanishes is opened again when it comes back, and a subscription goes on then. Only its owner ends the
thread: faults are logged and counted.
"""

from __future__ import annotations

import logging
import threading
import time

from controller.layers.commands import CommandSink
from controller.links.line.session import LineSession
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort

log = logging.getLogger(__name__)

_POLL_S = 0.05
_RETRY_S = 0.5
_OUT_LIMIT = 16_384
_FAULT_PAUSE_S = 0.05


class LineLink:
    """Takes commands from a serial port and streams parameters back.

    Parameters
    ----------
    port : device path. baud : its rate.
    sink : where accepted commands go, with the time they arrived.
    retry_s : how often a lost port is tried again.

    Attributes
    ----------
    connected : whether the port is there. reconnects : how often it came back.
    faults : how many errors there were besides those of the port; last_fault : the last of them.
    """

    def __init__(self, port: str, baud: int, sink: CommandSink, *, retry_s: float = _RETRY_S) -> None:
        self.port = port
        self.connected = False
        self.reconnects = 0
        self.faults = 0
        self.last_fault = ""
        self._serial = SerialPort(port, baud)
        self._session = LineSession(sink, time.monotonic_ns())
        self._out = bytearray()
        self._retry_s = retry_s
        self._counts = {"bytes_in": 0, "bytes_out": 0, "streamed": 0, "dropped": 0}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"link {port}", daemon=True)

    def start(self) -> LineLink:
        """Open the port and begin to listen. Raises PortError: the port cannot be opened; its subclasses say why."""
        self._serial.open()
        self.connected = True
        self._thread.start()
        return self

    def stop(self) -> None:
        """Stop listening and give the port back."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        self._serial.close()
        self.connected = False

    def report(self) -> dict[str, object]:
        """Counts: lines taken and refused (by code), bytes, streamed and dropped lines, reconnects."""
        return {
            "port": self.port,
            "connected": self.connected,
            "accepted": self._session.accepted,
            "refused": {str(code): count for code, count in sorted(self._session.refused.items())},
            **self._counts,
            "reconnects": self.reconnects,
            "faults": self.faults,
            "last_fault": self.last_fault,
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
            except Exception as error:  # noqa: BLE001  one line must not end the link
                self._log_fault(error)

    def _log_fault(self, error: Exception) -> None:
        """Log an error, once for each kind, and begin with the next line."""
        text = f"{type(error).__name__}: {error}"
        if text != self.last_fault:
            log.exception("link %s: %s; it goes on with the next line", self.port, text)
        self.faults, self.last_fault = self.faults + 1, text
        self._session.drop()
        self._stopping.wait(_FAULT_PAUSE_S)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            data = self._serial.read(self._wake_s())
            now_ns = time.monotonic_ns()
            if data:
                self._counts["bytes_in"] += len(data)
                self._reply(self._session.feed(data, now_ns))
                self._flush()
            self._stream(now_ns)
            self._flush()

    def _wake_s(self) -> float:
        """When to stop reading from the port next, on the monotonic clock."""
        now_s = time.monotonic()
        due_ns = self._session.due_ns()
        return now_s + _POLL_S if due_ns is None else min(now_s + _POLL_S, due_ns * 1e-9)

    def _reply(self, lines: bytes) -> None:
        if len(self._out) + len(lines) > _OUT_LIMIT:
            self._counts["dropped"] += lines.count(b"\n")
            return
        self._out += lines

    def _stream(self, now_ns: int) -> None:
        line = self._session.stream(now_ns)
        if not line:
            return
        if self._out:  # the peer does not keep up: this line is old before it is read
            self._counts["dropped"] += 1
            return
        self._out += line
        self._counts["streamed"] += 1

    def _flush(self) -> None:
        if not self._out:
            return
        sent = self._serial.put(bytes(self._out))
        self._counts["bytes_out"] += sent
        del self._out[:sent]

    def _reconnect(self) -> None:
        """Wait for the port to come back; the face keeps its last commands."""
        self.connected = False
        self._session.drop()
        self._out.clear()
        while not self._stopping.wait(self._retry_s):
            try:
                self._serial.open()
            except PortError:
                continue
            self.connected = True
            self.reconnects += 1
            return
