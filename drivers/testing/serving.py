"""Serves the simulated servos of a test: on a port that any program can open, in real time, or without a port, in time
that the test steps."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable

from drivers.base.errors import DriverError
from drivers.sim.serving.simulated import SimulatedBus
from drivers.sim.serving.virtual import VirtualClock, VirtualLink
from drivers.sim.wire.line import Line
from drivers.testing.records import Record
from drivers.testing.steppedserial import SteppedSerial


class Serving(ABC):
    """Serves a line.

    line : what is at the far end. port : what a program opens; empty in stepped time. baud : rate while none is set.
    """

    line: Line
    baud: int

    @property
    @abstractmethod
    def port(self) -> str:
        """What a program opens."""

    @abstractmethod
    def clock(self) -> float:
        """The line's time, seconds."""

    @abstractmethod
    def record_to(self, record: Record) -> None:
        """Report bytes that pass to a record from now on."""

    @abstractmethod
    def sync(self) -> None:
        """Wait until everything that was written to the port has been carried out."""

    @abstractmethod
    def fault(self, specs: Iterable[str]) -> None:
        """Set faults."""

    @abstractmethod
    def clear(self, kind: str | None) -> None:
        """End faults."""

    @abstractmethod
    def close(self) -> None:
        """Take the port away."""


class OnPort(Serving):
    """Behind a port of a :class:`~drivers.sim.serving.simulated.SimulatedBus` whose servos are in this process."""

    def __init__(self, bus: SimulatedBus) -> None:
        self._bus, self.baud = bus.__enter__(), bus.baud
        self.line = bus.line

    @property
    def port(self) -> str:
        return self._bus.path

    def clock(self) -> float:
        return time.monotonic()

    def record_to(self, record: Record) -> None:
        self._bus.tap = lambda sent, data: record.passed(sent, len(data), time.monotonic())

    def sync(self) -> None:
        self._bus.sync()

    def fault(self, specs: Iterable[str]) -> None:
        self._bus.fault(*specs)

    def clear(self, kind: str | None) -> None:
        self._bus.clear(kind)

    def close(self) -> None:
        self._bus.close()


class Stepped(Serving):
    """In this process, in time that passes only when the test, or a read of its program, lets it.

    link : what omote's drivers take as a port. now : the clock.
    """

    port = ""

    def __init__(self, line: Line, now: VirtualClock, baud: int, latency_s: float) -> None:
        self.line, self.now, self.baud = line, now, baud
        self.link = VirtualLink(line, now, baud, latency_s)

    def clock(self) -> float:
        return self.now()

    def record_to(self, record: Record) -> None:
        self.link.tap = lambda sent, data: record.passed(sent, len(data), self.now())

    def sync(self) -> None:
        """Nothing waits."""

    def fault(self, specs: Iterable[str]) -> None:
        self.line.faults.add(specs, self.now())

    def clear(self, kind: str | None) -> None:
        self.line.faults.clear(kind, self.now())

    def close(self) -> None:
        """There is no port."""

    def step(self, span_s: float) -> None:
        """Let time pass."""
        self.now.sleep(span_s)
        self.link.advance()

    def serial(self, timeout: float | None) -> SteppedSerial:
        """An open port with the methods of pyserial's."""
        return SteppedSerial(self.link, timeout)


def stepped(serving: Serving) -> Stepped:
    """Serving in stepped time; raises DriverError where time runs by itself."""
    if isinstance(serving, Stepped):
        return serving
    raise DriverError("the time of a port runs by itself", hint="ask the fixture for stepped=True")
