"""Run drivers over a simulated bus in virtual time: hours of running in the time the processor needs.

:class:`VirtualBus` is a far end of any family with drivers over it. Its :class:`VirtualLink` takes the place of a
driver's port and passes the bytes to the far end directly. A read moves the clock on to when bytes arrive, or to its
deadline, so nothing ever sleeps, and the same run gives the same figures on every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import PortLost, PortMissing
from drivers.core.registry import open_bus
from drivers.sim.serving.simulated import ServoView
from drivers.sim.servos.chain import Chain
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Line, ReplyQueue
from drivers.sim.wire.simulator import make_line
from drivers.sim.wire.timing import WireTiming


class VirtualClock:
    """A clock that only its methods move, from ``now_s`` on."""

    def __init__(self, now_s: float = 0.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        """Return the time, as ``time.monotonic`` does."""
        return self.now_s

    def sleep(self, span_s: float) -> None:
        """Let time pass, as ``time.sleep`` does."""
        self.now_s += max(span_s, 0.0)

    def wait_until(self, time_s: float) -> None:
        """Let time pass up to a moment; one in the past changes nothing."""
        self.now_s = max(self.now_s, time_s)


class VirtualLink:
    """A wire-timed far end as a driver's port. Same methods as :class:`~drivers.port.serialport.SerialPort`.

    line : what is at the far end.
    clock : the time of driver and far end.
    baud : bit rate.
    latency_s : USB latency timer.
    """

    serial = None

    def __init__(self, line: Line, clock: VirtualClock, baud: int = 1_000_000, latency_s: float = 0.0) -> None:
        self.path, self.baud, self.low_latency = "virtual", baud, False
        self.clock, self.sleep = clock, clock.sleep
        self.tap: Callable[[bool, bytes], None] | None = None
        self._line = line
        self._queue = ReplyQueue(line, baud, WireTiming(latency_s))
        self._open = self._gone = False
        line.on_unplug = self._unplug

    @property
    def is_open(self) -> bool:
        """True while a driver holds it."""
        return self._open

    def open(self) -> None:
        """Open it; raises PortMissing while it is unplugged."""
        self._queue.advance(self.clock())
        if self._gone:
            raise PortMissing("no port virtual: it is unplugged", port=self.path)
        self._open = True
        self._line.set_line_baud(self.baud)
        self._queue.replies.clear()

    def close(self) -> None:
        """Close it."""
        self._open = False

    @property
    def due_s(self) -> float:
        """When the far end does something next, an answer or a fault; infinity: never by itself."""
        return self._queue.due_s

    def advance(self) -> None:
        """Let the far end do everything that is due now."""
        self._queue.advance(self.clock())

    def set_baud(self, baud: int) -> None:
        """Change the bit rate of the host."""
        self.baud = baud
        self._line.set_line_baud(baud)

    def write(self, data: bytes) -> None:
        """Send; the far end acts when the last byte of a packet has arrived."""
        self._queue.advance(self.clock())
        self._check()
        if self.tap is not None:
            self.tap(True, data)
        self._queue.receive(data, self.clock())

    def put(self, data: bytes) -> int:
        """Send; there is always room."""
        self.write(data)
        return len(data)

    def read(self, deadline_s: float) -> bytes:
        """What has arrived, waiting for the first byte until a deadline."""
        self._check()
        end_s = max(deadline_s, self.clock())
        while True:
            due_s = min(self._queue.due_s, end_s)
            self.clock.wait_until(due_s)
            self._queue.advance(self.clock())
            self._check()
            data = self._arrived()
            if data or due_s >= end_s:
                return data

    def read_now(self) -> bytes:
        """Return bytes that have arrived."""
        return self.read(self.clock())

    def drain(self, quiet_s: float = 0.0, limit_s: float = 0.2) -> int:
        """Discard bytes that have arrived; return their number."""
        self.sleep(quiet_s)
        self._check()
        return len(self._arrived())

    def _arrived(self) -> bytes:
        data, replies = b"", self._queue.replies
        while replies and replies[0][0] <= self.clock():
            data += replies.popleft()[1]
        if data and self.tap is not None:
            self.tap(False, data)
        return data

    def _check(self) -> None:
        if self._gone or not self._open:
            raise PortLost("port virtual went away: it was unplugged", port=self.path)

    def _unplug(self, fault: Fault, begins: bool) -> None:
        self._gone = begins
        self._queue.clear()


class VirtualBus:
    """A simulated bus of any family and its clock. Everything runs in the caller's thread.

    Parameters
    ----------
    family : a kind of bus, as ``drivers.kinds()`` lists them.
    driver : options of the drivers over it, such as ``{"margin_s": 0.05}``.
    faults, baud, latency_s, seed : see :class:`drivers.sim.SimulatedBus`.
    options : settings of the far end; None: those that the driver needs.

    Attributes
    ----------
    clock : the time; ``clock.sleep(1.0)`` lets a second pass.
    line, link : the far end, and the port to it.
    """

    def __init__(
        self,
        servos: Sequence[ServoSpec],
        family: str = "dynamixel",
        *,
        driver: Mapping[str, Any] = {},
        faults: Iterable[str] = (),
        baud: int = 1_000_000,
        latency_s: float = 0.0,
        seed: int = 0,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        self.servos, self.family, self.clock = tuple(servos), family, VirtualClock()
        self._driver = dict(driver)
        if options is None:
            options = open_bus(family, self.servos, port="", **self._driver).far_end()
        models = [(servo.id, servo.model) for servo in self.servos]
        self.line = make_line(family, models, self.clock(), baud=baud, seed=seed, options=options)
        self.link = VirtualLink(self.line, self.clock, baud, latency_s)
        self.fault(*faults)

    def bus(self, **options: Any) -> Bus:
        """A driver over it, closed."""
        return open_bus(self.family, self.servos, port=self.link, clock=self.clock, **self._driver | options)

    @property
    def chain(self) -> Chain:
        """The servos themselves; TypeError where it is a board."""
        if not isinstance(self.line, Chain):
            raise TypeError("a board has no servos to look at; see line")
        return self.line

    def servo(self, device_id: int) -> ServoView:
        """One servo; KeyError where none has the id."""
        return ServoView(self.chain, device_id, self.clock)

    def fault(self, *specs: str) -> None:
        """Set faults now; raises DriverError where one cannot be read."""
        self.line.faults.add(specs, self.clock())

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind; None: all."""
        self.line.faults.clear(kind, self.clock())
