"""One wire with something at its far end: bytes in, replies out, the time given by the caller."""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, Protocol

from drivers.sim.wire.faults import KINDS, Fault, FaultSet
from drivers.sim.wire.replies import Reply
from drivers.sim.wire.timing import Timed


class Reader(Protocol):
    """Cuts a byte stream into packets."""

    @property
    def pending(self) -> int:
        """Bytes of a packet that is not complete."""

    def feed(self, data: bytes) -> list[Any]:
        """Packets completed by these bytes."""

    def flush(self) -> list[Any]:
        """Give up on the incomplete packet."""

    def take_pending(self) -> bytes:
        """Forget the incomplete packet."""


class FixedReader:
    """Cuts a byte stream into packets of one length that begin with the same byte.

    Parameters
    ----------
    head : first byte of every packet; bytes before one are passed over. length : of a packet, bytes.
    """

    def __init__(self, head: int, length: int) -> None:
        self._head, self._length, self._data = bytes((head,)), length, b""

    @property
    def pending(self) -> int:
        """Bytes of a packet that is not complete."""
        return len(self._data)

    def feed(self, data: bytes) -> list[bytes]:
        """Packets completed by these bytes."""
        self._data += data
        packets = []
        while (begin := self._data.find(self._head)) >= 0 and len(self._data) >= begin + self._length:
            packets.append(self._data[begin : begin + self._length])
            self._data = self._data[begin + self._length :]
        self._data = self._data[begin:] if begin >= 0 else b""
        return packets

    def flush(self) -> list[bytes]:
        """Give up on the incomplete packet."""
        self._data = b""
        return []

    def take_pending(self) -> bytes:
        """Forget the incomplete packet."""
        data, self._data = self._data, b""
        return data


class Line(ABC):
    """What a server needs to know of a simulated bus, whatever is on it.

    Parameters
    ----------
    seed : of random faults.
    kinds : faults it can have.

    Attributes
    ----------
    faults : the faults that are set.
    line_baud : bit rate of the port, or None while unknown.
    echo : the adapter gives back what it was sent.
    burst_s : what comes back reaches the host in bursts so far apart; 0: as it comes.
    on_unplug : called with (fault, begins) when the port goes away or comes back.
    packets : packets handled.
    lock : held while a packet is handled; hold it to look at the devices from another thread.
    """

    def __init__(self, seed: int = 0, kinds: Iterable[str] = KINDS) -> None:
        self.line_baud: int | None = None
        self.echo = False
        self.burst_s = 0.0
        self.on_unplug: Callable[[Fault, bool], None] = lambda fault, begins: None
        self.packets = 0
        self.lock = threading.RLock()
        self.reader = self.make_reader()
        self.faults = FaultSet(self.fault_changed, seed, kinds)

    @abstractmethod
    def make_reader(self) -> Reader:
        """A reader of what the host sends."""

    def size(self, packet: Any) -> int:
        """Bytes of a packet on the wire; as many as it has unless it is said otherwise."""
        return len(packet)

    @abstractmethod
    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """What a packet does, and who answers."""

    @abstractmethod
    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """The state of each device, for people and tools."""

    def place(self, device_id: int, position: float, now_s: float) -> None:
        """Move a shaft by hand; ValueError where that cannot be done."""
        raise ValueError("nothing on this bus can be moved by hand")

    def feed(self, data: bytes, now_s: float) -> list[Reply]:
        """Bytes from the host; returns what comes back, in order."""
        replies = []
        for packet in self.reader.feed(data):
            replies += self.handle(packet, now_s)
        return replies

    def handle(self, packet: Any, now_s: float) -> list[Reply]:
        """One packet; returns what comes back, in order."""
        with self.lock:
            self.catch_up(now_s)
            self.packets += 1
            return self.carry_out(packet, now_s)

    def catch_up(self, now_s: float) -> None:
        """What happened since the last packet."""
        if now_s >= self.faults.next_change_s:
            self.faults.advance(now_s)

    def heard(self, timed: list[Timed]) -> list[Timed]:
        """When the host gets to read what arrives at some times."""
        if not self.burst_s:
            return timed
        return [(math.ceil(time_s / self.burst_s) * self.burst_s, data) for time_s, data in timed]

    def set_line_baud(self, baud: int | None) -> None:
        """The port's bit rate was changed."""
        self.line_baud = baud

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault that is not about replies begins or ends."""
        if fault.kind == "echo":
            self.echo = begins
        elif fault.kind == "slow-reader":
            self.burst_s = fault.value if begins else 0.0
        elif fault.kind == "unplug":
            self.on_unplug(fault, begins)
