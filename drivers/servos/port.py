"""Serial port for request-reply transactions: dynamixel-sdk's port handler with its known faults overridden.

It is exclusive and blocking, keeps reply deadlines on a monotonic clock, and knows the servos whose replies are late.
See drivers/dynamixel/sdk.py for the list of faults that the numbers S3 to S12 refer to.
"""

from __future__ import annotations

import threading

from dynamixel_sdk import port_handler

from drivers.base.errors import DriverError
from drivers.base.waking import WakeDelay
from drivers.port.latency import ReplyDelays
from drivers.port.serialport import SerialPort, as_serial_port, reply_margin_s

BITS_PER_BYTE = 10
MIN_SLEEP_S = 0.0005
"""A shorter sleep costs more than it saves."""
POLL_BEFORE_S = 0.0006
"""Polling begins this long before the last byte of a reply is due; until then the thread sleeps."""
POLL_INTERVAL_S = 0.00002
"""Longest wait of one poll. A processor that does not sleep keeps its caches, and then processes the reply in a third
of the time."""
POLL_AFTER_S = 0.0005
"""Polling ends this long after the last byte was due."""
MIN_WAKE_DELAY_S = 0.00004
"""Replies are polled for if nine of ten waits end later than this."""
SLEEP_PERIOD = 32
"""After a reply that came in pieces, the thread sleeps until the last byte is due for so many replies. One in so many
replies that are polled for without a sleep is slept for, to keep measuring how late the system wakes threads."""


class Port(port_handler.PortHandler):  # type: ignore[misc]  # without types
    """An exclusive, blocking :class:`~drivers.port.serialport.SerialPort` for requests and replies (S5 to S9).

    Methods have the names that dynamixel-sdk gives them.

    Parameters
    ----------
    path : device path, URL, or a :class:`~drivers.sim.serving.virtual.VirtualLink`.
    baud : any rate the adapter takes.
    margin_s : longest wait for a reply beyond its time on the wire; None takes it from the latency timer.

    Attributes
    ----------
    clock, sleep : functions that return monotonic seconds, and wait for seconds.
    port_name : device path.
    suspects : ids that missed a deadline and may still reply late; see :class:`~drivers.servos.exchange.Exchanges`.
    stray : number of replies that were discarded.
    delays : delays of the newest replies of single servos, beyond their time on the wire.
    """

    def __init__(self, path: str | SerialPort, baud: int = 1_000_000, margin_s: float | None = None) -> None:
        self._busy = threading.Lock()
        self.link = as_serial_port(path, baud)
        self.clock, self.sleep = self.link.clock, self.link.sleep
        super().__init__(self.link.path)
        self.baudrate = baud
        self.suspects: set[int] = set()
        self.stray = 0
        self.delays = ReplyDelays()
        self.deadline_s = self._free_s = 0.0
        self._sleeps = self._polled = 0
        self._wakes = WakeDelay(0.1, 2 * MIN_WAKE_DELAY_S)
        self._held = bytearray()
        self._margin_s = margin_s
        self._tune()

    def _tune(self) -> None:
        self.margin_s = reply_margin_s(self.link.path) if self._margin_s is None else self._margin_s
        self._byte_s = BITS_PER_BYTE / self.baudrate
        self.tx_time_per_byte = 1000.0 * self._byte_s  # milliseconds, the SDK's unit

    # ------------------------------------------------------------------ opening and closing

    def setPortName(self, port_name: str) -> None:
        """Set the device path for the next opening."""
        self.port_name = self.link.path = port_name

    def openPort(self) -> bool:
        """Open exclusively; raises PortMissing, PortBusy or PortPermission instead of returning False."""
        return self.setupPort(self.baudrate)

    def setupPort(self, cflag_baud: int) -> bool:
        """Open as ``openPort``, at a baud rate."""
        self.link.baud = self.baudrate = cflag_baud
        self.link.open()
        self.suspects.clear()
        self.delays.clear()
        self.is_using = False
        self._sleeps = 0
        self._tune()
        self.is_open, self.ser = True, self.link.serial
        self._held.clear()
        return True

    def setBaudRate(self, baudrate: int) -> bool:
        """Open again at any baud rate, also one that is not in the SDK's list, such as 4.5 Mbaud."""
        return self.setupPort(baudrate)

    def closePort(self) -> None:
        """Close; never raises."""
        self.link.close()
        self.is_using = self.is_open = False

    # ------------------------------------------------------------------ bytes

    def clearPort(self) -> None:
        """Discard all input (S3)."""
        self._held.clear()
        self.link.drain()

    def getBytesAvailable(self) -> int:
        """Number of bytes that can be read without waiting."""
        self._held += self.link.read(0.0)
        return len(self._held)

    def readPort(self, length: int) -> bytes:
        """Read at most ``length`` bytes, waiting for the first until the packet timeout (S12)."""
        if not self._held:
            self._held += self.link.read(self.deadline_s)
        data = bytes(self._held[:length])
        del self._held[:length]
        return data

    def writePort(self, packet: bytes) -> int:
        """Send bytes; return their number."""
        self.transmit(bytes(packet))
        return len(packet)

    def transmit(self, packet: bytes) -> None:
        """Pass bytes to the system, and compute when the last of them will have left."""
        self._free_s = max(self.clock(), self._free_s) + len(packet) * self._byte_s
        self.link.write(packet)

    def first(self) -> bytes:
        """Return the first bytes of an expected reply, empty when none came until the deadline.

        Where replies come in pieces, it sleeps until the whole reply is due, so that the thread wakes once per reply.
        """
        if not self._sleeps:
            return self.link.read(self.deadline_s)
        self._sleeps -= 1
        return self._await(self.deadline_s - self.margin_s)

    def more(self) -> bytes:
        """Return the next bytes of a reply that came in part, empty when none came until the deadline."""
        self._sleeps = SLEEP_PERIOD
        return self._await(self.deadline_s - self.margin_s)

    def _await(self, due_s: float) -> bytes:
        """Sleep until bytes are due, and read them; poll for them at the end where the system wakes threads late."""
        now = self.clock()
        polls = self._decide_poll(due_s - now)
        wake_s = due_s - POLL_BEFORE_S if polls else due_s
        if wake_s - now > MIN_SLEEP_S:
            self.sleep(wake_s - now)
            self._wakes.note(self.clock() - wake_s)
            if not polls and (data := self.link.read_now()):
                return data
        return self._poll(due_s) if polls else self.link.read(self.deadline_s)

    def _decide_poll(self, pause_s: float) -> bool:
        """Decide whether to poll at the end of a pause; counts the pauses without a sleep."""
        if self._wakes.late_s <= MIN_WAKE_DELAY_S:
            return False
        if not MIN_SLEEP_S < pause_s <= MIN_SLEEP_S + POLL_BEFORE_S:
            return True
        self._polled = (self._polled + 1) % SLEEP_PERIOD
        return self._polled > 0

    def _poll(self, due_s: float) -> bytes:
        end_s = min(due_s + POLL_AFTER_S, self.deadline_s)
        while (now := self.clock()) < end_s:
            if data := self.link.read(min(now + POLL_INTERVAL_S, end_s)):
                return data
        return self.link.read(self.deadline_s)

    # ------------------------------------------------------------------ deadlines

    def expect(self, size: int) -> None:
        """Set the deadline for a reply of ``size`` bytes: time of request and reply on the wire, plus the margin."""
        self.deadline_s = max(self.clock(), self._free_s) + size * self._byte_s + self.margin_s

    def note_delay(self, size: int) -> None:
        """Store the delay, beyond its time on the wire, of a reply of ``size`` bytes that was just received."""
        self.delays.add(self.clock() - self._free_s - size * self._byte_s)

    def setPacketTimeout(self, packet_length: int) -> None:
        """Set the deadline for a reply of ``packet_length`` bytes: time on the wire plus margin (S7)."""
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self.margin_s * 1000.0)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Set the deadline to so many milliseconds from now."""
        super().setPacketTimeoutMillis(msec)
        self.deadline_s = self.clock() + msec / 1000.0

    def isPacketTimeout(self) -> bool:
        """Whether the deadline has passed."""
        return self.clock() > self.deadline_s

    def getCurrentTime(self) -> float:
        """Milliseconds on the monotonic clock (S8)."""
        return self.clock() * 1000.0

    # ------------------------------------------------------------------ transactions

    @property
    def is_using(self) -> bool:
        """Whether a transaction is in progress. Setting it begins or ends one.

        Raises DriverError where another thread has a transaction in progress (S9).
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
