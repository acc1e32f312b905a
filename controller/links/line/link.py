"""Serves the line protocol on a serial port, in its own thread.

Replies and streamed lines are written without waiting: a peer that does not read loses lines, which are counted, and
never holds up the face. A port that vanishes is opened again when it comes back, and a subscription goes on then. Only
its owner ends the thread: faults are logged and counted.
"""

from __future__ import annotations

import threading
import time

from controller.layers.commands import CommandSink
from controller.links.line.outbox import Outbox
from controller.links.line.session import LineSession
from drivers.base.errors import PortError
from drivers.port.serialport import SerialPort

_POLL_S = 0.05
_RETRY_S = 0.5
_READ_LIMIT = 65_536
_FAULT_PAUSE_S = 0.05


class LineLink:
    """Takes commands from a serial port and streams parameters back.

    Parameters
    ----------
    port : device path. baud : its rate.
    sink : where accepted commands go, with the time they arrived.
    checksum : when lines must have one, of :data:`controller.links.line.checksums.CHECKSUMS`.
    retry_s : how often a lost port is tried again.

    Attributes
    ----------
    connected : whether the port is there. reconnects : how often it came back.
    """

    def __init__(
        self, port: str, baud: int, sink: CommandSink, *, checksum: str = "latched", retry_s: float = _RETRY_S
    ) -> None:
        self.port = port
        self.connected = False
        self.reconnects = 0
        self._serial = SerialPort(port, baud)
        self._session = LineSession(sink, time.monotonic_ns(), name=f"line {port}", checksum=checksum)
        self._out = Outbox()
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
        """Counts: lines taken, refused (by code) and not answered, bytes, streamed and dropped lines, reconnects."""
        return {
            "port": self.port,
            "connected": self.connected,
            "accepted": self._session.accepted,
            "refused": {str(code): count for code, count in sorted(self._session.refused.items())},
            "unanswered": self._session.unanswered,
            **self._counts,
            "reconnects": self.reconnects,
            "faults": self._session.faults,
            "last_fault": self._session.last_fault,
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
                self._session.fault(error, "it goes on with the next line")
                self._session.drop()
                self._stopping.wait(_FAULT_PAUSE_S)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            data = self._read()
            now_ns = time.monotonic_ns()
            for answer in self._session.answers(data, now_ns) if data else ():
                self._reply(answer)
            self._flush()
            self._stream(now_ns)
            self._flush()

    def _read(self) -> bytes:
        """All that has arrived, so that a STOP is found however much came before it."""
        data = self._serial.read(self._wake_s())
        more = data
        while more and len(data) < _READ_LIMIT:
            more = self._serial.read(0.0)
            data += more
        self._counts["bytes_in"] += len(data)
        return data

    def _wake_s(self) -> float:
        """When to stop reading from the port next, on the monotonic clock."""
        now_s = time.monotonic()
        due_ns = self._session.due_ns()
        return now_s + _POLL_S if due_ns is None else min(now_s + _POLL_S, due_ns * 1e-9)

    def _reply(self, line: bytes) -> None:
        if self._out.add(line, answer=True):
            return
        self._flush()
        if not self._out.add(line, answer=True):
            self._counts["dropped"] += 1
            self._session.unanswered += 1

    def _stream(self, now_ns: int) -> None:
        line = self._session.stream(now_ns)
        if line:
            self._counts["streamed" if self._out.add(line, answer=False) else "dropped"] += 1

    def _flush(self) -> None:
        self._counts["bytes_out"] += self._out.flush(self._serial.put)

    def _reconnect(self) -> None:
        """Wait for the port to come back; the face keeps its last commands."""
        self.connected = False
        self._session.drop()
        self._session.unanswered += self._out.clear()
        while not self._stopping.wait(self._retry_s):
            try:
                self._serial.open()
            except PortError:
                continue
            self.connected = True
            self.reconnects += 1
            return
