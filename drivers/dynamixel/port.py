"""The SDK's port handler, mended: exclusive, blocking, monotonic, with timeouts that fit the wire.

See drivers/dynamixel/sdk.py for the list of faults that the numbers S1 to S14 refer to.
"""

from __future__ import annotations

from dynamixel_sdk import port_handler

from drivers.port.serialport import SerialPort
from drivers.servos import port

NAP_LEAST_S = 0.0005
"""A shorter sleep costs more than it saves."""
NAP_EARLY_S = 0.0006
"""How much before the last byte a sleep through a reply ends."""
DOZE_S = 0.00002
"""From then on sleeps are so short: a processor that is not switched off finds its caches as it left them, and what is
done with the reply then takes a third of the time."""
DOZE_LATE_S = 0.0005
"""How long after the last byte was due that goes on."""


class Port(port.Port, port_handler.PortHandler):  # type: ignore[misc]  # without types
    """The SDK's port handler as a :class:`~drivers.servos.port.Port`, which mends S5 to S7 and S9.

    Parameters
    ----------
    path, baud, margin_s : see :class:`~drivers.servos.port.Port`.
    """

    def __init__(
        self,
        path: str | SerialPort,
        baud: int = 1_000_000,
        margin_s: float | None = None,
    ) -> None:
        super().__init__(path, baud, margin_s)
        self._held = bytearray()
        self.is_open, self.ser = False, None
        self.packet_start_time = self.packet_timeout = 0.0

    def _tune(self) -> None:
        super()._tune()
        self.tx_time_per_byte = 1000.0 * self._byte_s  # milliseconds, the SDK's unit

    def openPort(self) -> bool:
        """Open exclusively; raises PortMissing, PortBusy or PortPermission instead of returning False."""
        return self.setupPort(self.baudrate)

    def setupPort(self, cflag_baud: int) -> bool:
        """As ``openPort``, at a rate."""
        self.link.baud = self.baudrate = cflag_baud
        self.is_open = super().openPort()
        self.ser = self.link.serial
        self._held.clear()
        return True

    def setBaudRate(self, baudrate: int) -> bool:
        """Any rate, not only those of the SDK's list (4.5 Mbaud is real)."""
        return self.setupPort(baudrate)

    def closePort(self) -> None:
        """Close; never raises."""
        super().closePort()
        self.is_open = False

    def clearPort(self) -> None:
        """Throw away all input (S3)."""
        if self._held:
            self._held.clear()
        self.link.drain()

    def getBytesAvailable(self) -> int:
        """Bytes that can be read without waiting."""
        self._held += self.link.read(0.0)
        return len(self._held)

    def readPort(self, length: int) -> bytes:
        """At most ``length`` bytes, waiting for the first until the packet timeout (S12)."""
        if not self._held:
            self._held += self.link.read(self.deadline_s)
        data = bytes(self._held[:length])
        del self._held[:length]
        return data

    def writePort(self, packet: bytes) -> int:
        """Send; returns the count sent."""
        self.transmit(bytes(packet))
        return len(packet)

    def more(self, missing: int) -> bytes:
        """What comes next of a reply that lacks so many bytes: asleep while the wire carries them, lightly at the end.

        Returns
        -------
        bytes : empty when nothing came until the deadline.
        """
        due_s = min(self.clock() + missing * self._byte_s, self.deadline_s)
        pause = due_s - NAP_EARLY_S - self.clock()
        if pause > NAP_LEAST_S:
            self.sleep(pause)
        end_s = min(due_s + DOZE_LATE_S, self.deadline_s)
        while (now := self.clock()) < end_s:
            if data := self.link.read(min(now + DOZE_S, end_s)):
                return data
        return self.link.read(self.deadline_s)

    def setPacketTimeout(self, packet_length: int) -> None:
        """Deadline for a reply of ``packet_length`` bytes: wire time plus margin (S7)."""
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self.margin_s * 1000.0)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Deadline so many milliseconds from now."""
        super().setPacketTimeoutMillis(msec)
        self.deadline_s = self.clock() + msec / 1000.0

    def isPacketTimeout(self) -> bool:
        """True behind the deadline."""
        return self.clock() > self.deadline_s

    def getCurrentTime(self) -> float:
        """Milliseconds on the monotonic clock (S8)."""
        return self.clock() * 1000.0
