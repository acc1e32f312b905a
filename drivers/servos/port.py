"""A serial port with the state of a conversation: who owes an answer, when the wire is free, who is talking."""

from __future__ import annotations

import threading

from drivers.base.errors import DriverError
from drivers.port.serialport import SerialPort, as_serial_port, reply_margin_s

BITS_PER_BYTE = 10


class Port:
    """An exclusive, blocking :class:`~drivers.port.serialport.SerialPort` for questions and answers.

    Methods have the names that dynamixel-sdk gives them.

    Parameters
    ----------
    path : device path, URL, or a :class:`~drivers.sim.serving.virtual.VirtualLink`.
    baud : any rate the adapter takes.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.

    Attributes
    ----------
    clock, sleep : monotonic seconds, and the way to let them pass.
    port_name : device path.
    suspects : ids that did not answer when they should have; see :class:`~drivers.servos.exchange.Exchanges`.
    stray : replies thrown away.
    """

    def __init__(self, path: str | SerialPort, baud: int = 1_000_000, margin_s: float | None = None) -> None:
        self.link = as_serial_port(path, baud)
        self.clock, self.sleep = self.link.clock, self.link.sleep
        self.port_name, self.baudrate = self.link.path, baud
        self.suspects: set[int] = set()
        self.stray = 0
        self.deadline_s = self._free_s = 0.0
        self._margin_s = margin_s
        self._busy = threading.Lock()
        self._tune()

    def _tune(self) -> None:
        self.margin_s = reply_margin_s(self.link.path) if self._margin_s is None else self._margin_s

    @property
    def _byte_s(self) -> float:
        return BITS_PER_BYTE / self.baudrate

    def setPortName(self, port_name: str) -> None:
        """Another device path for the next opening."""
        self.port_name = self.link.path = port_name

    def openPort(self) -> bool:
        """Open exclusively; raises PortMissing, PortBusy or PortPermission instead of returning False."""
        self.link.open()
        self.suspects.clear()
        self.is_using = False
        self._tune()
        return True

    def closePort(self) -> None:
        """Close; never raises."""
        self.link.close()
        self.is_using = False

    def clearPort(self) -> None:
        """Throw away all input."""
        self.link.drain()

    def transmit(self, packet: bytes) -> None:
        """Hand bytes to the system, and keep count of when the last of them will have left."""
        self._free_s = max(self.clock(), self._free_s) + len(packet) * self._byte_s
        self.link.write(packet)

    def expect(self, size: int) -> None:
        """Deadline for ``size`` bytes of reply to what was sent: time on the wire, both ways, plus the margin."""
        self.deadline_s = max(self.clock(), self._free_s) + size * self._byte_s + self.margin_s

    @property
    def is_using(self) -> bool:
        """True in the middle of a transaction. Setting it begins or ends one.

        Raises
        ------
        DriverError : another thread is in the middle of a transaction.
        """
        return self._busy.locked()

    @is_using.setter
    def is_using(self, value: bool) -> None:
        if not value:
            if self._busy.locked():
                self._busy.release()
        elif not self._busy.acquire(blocking=False):
            raise DriverError(
                f"port {self.port_name} is used from two threads at once",
                hint="let one thread do all reads and writes of a bus",
                port=self.port_name,
            )
