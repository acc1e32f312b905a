"""A simulated bus in time that does not pass by itself: hours of running in the time the processor needs.

:class:`VirtualLink` takes the place of a driver's port and hands the bytes to a chain of servos directly. Whoever
waits for bytes moves the clock on to when they arrive, or to the deadline, so nothing ever sleeps.
"""

from __future__ import annotations

from collections import deque

from drivers.errors import PortLost, PortMissing
from drivers.sim.chain import Chain
from drivers.sim.faults import Fault
from drivers.sim.wire import Timed, WireTiming


class VirtualClock:
    """Seconds that pass when somebody says so.

    Parameters
    ----------
    now_s : time to begin with.
    """

    def __init__(self, now_s: float = 0.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        """The time, as ``time.monotonic`` gives it."""
        return self.now_s

    def sleep(self, span_s: float) -> None:
        """Let time pass, as ``time.sleep`` does."""
        self.now_s += max(span_s, 0.0)

    def wait_until(self, time_s: float) -> None:
        """Let time pass up to a moment; one that has passed changes nothing."""
        self.now_s = max(self.now_s, time_s)


class VirtualLink:
    """A wire-timed chain of servos as a driver's port. Same methods as :class:`~drivers.serialport.SerialPort`.

    Parameters
    ----------
    chain : the servos.
    clock : the time of driver and servos.
    baud : bit rate.
    latency_s : USB latency timer.
    """

    serial = None

    def __init__(self, chain: Chain, clock: VirtualClock, baud: int = 1_000_000, latency_s: float = 0.0) -> None:
        self.path, self.baud = "virtual", baud
        self._chain, self._clock = chain, clock
        self._timing = WireTiming(latency_s)
        self._coming: deque[Timed] = deque()
        self._open = self._gone = False
        chain.on_unplug = self._unplug

    @property
    def is_open(self) -> bool:
        """True while a driver holds it."""
        return self._open

    def open(self) -> None:
        """Take it; raises PortMissing while it is unplugged."""
        self._advance()
        if self._gone:
            raise PortMissing("the virtual port is unplugged", port=self.path)
        self._open = True
        self._coming.clear()

    def close(self) -> None:
        """Give it back."""
        self._open = False

    def write(self, data: bytes) -> None:
        """Send; the servos act when the last byte of a packet has arrived."""
        self._advance()
        self._check()
        now_s = self._clock()
        if self._chain.echo:
            self._coming.append((now_s, data))
        for packet in self._chain.reader.feed(data):
            at_s = self._timing.arrival(now_s, self._chain.size(packet), self.baud)
            self._coming += self._timing.deliveries(self._chain.handle(packet, at_s), self.baud)

    def read(self, deadline_s: float) -> bytes:
        """What has arrived, waiting for the first byte until a deadline; see ``SerialPort.read``."""
        self._check()
        if not self._coming or self._coming[0][0] > max(deadline_s, self._clock()):
            self._clock.wait_until(deadline_s)
            self._advance()
            return b""
        self._clock.wait_until(self._coming[0][0])
        self._advance()
        self._check()
        return self._arrived()

    def drain(self, quiet_s: float = 0.0, limit_s: float = 0.2) -> int:
        """Throw away what has arrived; returns how many bytes that was."""
        self._clock.sleep(quiet_s)
        return len(self._arrived())

    def _arrived(self) -> bytes:
        data = b""
        while self._coming and self._coming[0][0] <= self._clock():
            data += self._coming.popleft()[1]
        return data

    def _advance(self) -> None:
        """Faults that are due now."""
        if self._clock() >= self._chain.faults.next_change_s:
            with self._chain.lock:
                self._chain.faults.advance(self._clock())

    def _check(self) -> None:
        if self._gone or not self._open:
            raise PortLost("the virtual port went away", port=self.path)

    def _unplug(self, fault: Fault, begins: bool) -> None:
        self._gone = begins
        self._coming.clear()
        self._chain.reader.take_pending()
