"""Base class of devices at the far end of a simulated wire, and the queue of their replies to the host."""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

from drivers.sim.wire.faults import KINDS, Fault, FaultSet
from drivers.sim.wire.timing import Reply, Timed, WireTiming, without_timing

PAUSE_S = 0.1
"""A packet that is not complete after this pause is given up."""


class Reader(Protocol):
    """Cuts a byte stream into packets."""

    @property
    def pending(self) -> int:
        """Bytes of a packet that is not complete."""

    def feed(self, data: bytes) -> list[Any]:
        """Packets completed by these bytes."""

    def flush(self) -> list[Any]:
        """Give up on the incomplete packet after a pause; returns packets found in its bytes."""

    def take_pending(self) -> bytes:
        """Remove and return the bytes of the incomplete packet."""


class BufferingReader(ABC):
    """A `Reader` that keeps the incomplete packet in ``_buffer`` for as long as its end does not arrive."""

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def pending(self) -> int:
        return len(self._buffer)

    @abstractmethod
    def feed(self, data: bytes) -> list[Any]:
        """Packets completed by these bytes."""

    def flush(self) -> list[Any]:
        return []

    def take_pending(self) -> bytes:
        data, self._buffer = self._buffer, b""
        return data


class FixedReader(BufferingReader):
    """Cuts a byte stream into packets of one length that begin with the same byte.

    head : first byte of every packet; bytes before one are passed over. length : of a packet, bytes.
    """

    def __init__(self, head: int, length: int) -> None:
        super().__init__()
        self._head, self._length = bytes((head,)), length

    def feed(self, data: bytes) -> list[bytes]:
        data, packets = self._buffer + data, []
        while (begin := data.find(self._head)) >= 0 and len(data) >= begin + self._length:
            packets.append(data[begin : begin + self._length])
            data = data[begin + self._length :]
        self._buffer = data[begin:] if begin >= 0 else b""
        return packets

    def flush(self) -> list[bytes]:
        self._buffer = b""
        return []


class Watcher(Protocol):
    """Watches the devices of a line; called with its lock held."""

    def before(self, now_s: float) -> None:
        """A packet will be carried out."""

    def after(self, now_s: float) -> None:
        """It was carried out."""


class Line(ABC):
    """A simulated bus without a port, whatever is on it.

    Parameters
    ----------
    seed : of random faults.
    kinds : faults it can have.

    Attributes
    ----------
    faults : the faults that are set.
    line_baud : bit rate of the port, or None while unknown.
    echo : the adapter echoes what it was sent.
    burst_s : replies reach the host in bursts so far apart, seconds; 0: at once.
    on_unplug : called with (fault, begins) when the port disappears or returns.
    packets : packets handled.
    watcher : called before and after each packet is carried out, or None.
    lock : held while a packet is handled; hold it to read the devices from another thread.
    """

    def __init__(self, seed: int = 0, kinds: Iterable[str] = KINDS) -> None:
        self.line_baud: int | None = None
        self.echo = False
        self.burst_s = 0.0
        self.on_unplug: Callable[[Fault, bool], None] = lambda fault, begins: None
        self.packets = 0
        self.watcher: Watcher | None = None
        self.lock = threading.RLock()
        self.reader = self.make_reader()
        self.faults = FaultSet(self.fault_changed, seed, kinds)

    @abstractmethod
    def make_reader(self) -> Reader:
        """A reader of what the host sends."""

    def size(self, packet: Any) -> int:
        """Bytes of a packet on the wire; by default its length."""
        return len(packet)

    @abstractmethod
    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """Carry out a packet; returns the replies."""

    @abstractmethod
    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """The state of each device, for people and tools."""

    def place(self, device_id: int, position: float, now_s: float) -> None:
        """Move a shaft by hand; ValueError where that cannot be done."""
        raise ValueError("nothing on this bus can be moved by hand")

    def feed(self, data: bytes, now_s: float) -> list[Reply]:
        """Bytes from the host; returns the replies, in order."""
        return [reply for packet in self.reader.feed(data) for reply in self.handle(packet, now_s)]

    def handle(self, packet: Any, now_s: float) -> list[Reply]:
        """One packet; returns the replies, in order."""
        with self.lock:
            self.catch_up(now_s)
            self.packets += 1
            if self.watcher is None:
                return self.carry_out(packet, now_s)
            self.watcher.before(now_s)
            replies = self.carry_out(packet, now_s)
            self.watcher.after(now_s)
            return replies

    def catch_up(self, now_s: float) -> None:
        """Update what changed since the last packet: faults begin and end."""
        if now_s >= self.faults.next_change_s:
            self.faults.advance(now_s)

    def heard(self, timed: list[Timed]) -> list[Timed]:
        """Times at which the host can read bytes that arrive at `timed`; later where it reads in bursts."""
        if not self.burst_s:
            return timed
        return [(math.ceil(time_s / self.burst_s) * self.burst_s, data) for time_s, data in timed]

    def set_line_baud(self, baud: int | None) -> None:
        """The port's bit rate was changed."""
        self.line_baud = baud

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault begins or ends; those of replies need nothing."""
        if fault.kind == "echo":
            self.echo = begins
        elif fault.kind == "slow-reader":
            self.burst_s = fault.value if begins else 0.0
        elif fault.kind == "unplug":
            self.on_unplug(fault, begins)


class ReplyQueue:
    """Passes bytes from the host to a line at its bit rate, and keeps the replies until the host can read them.

    Parameters
    ----------
    baud : bit rate while the line knows none.
    timing : time on the wire; None: bytes take no time.

    Attributes
    ----------
    replies : (time, bytes) at which the host can read them, in order.
    """

    def __init__(self, line: Line, baud: int, timing: WireTiming | None) -> None:
        self.replies: deque[Timed] = deque()
        self._line, self._baud, self._timing = line, baud, timing
        self._gives_up_s = math.inf

    @property
    def due_s(self) -> float:
        """When the next reply is due, a fault begins or ends, or a packet is given up; infinity: nothing is due."""
        reply_s = self.replies[0][0] if self.replies else math.inf
        return min(reply_s, self._line.faults.next_change_s, self._gives_up_s)

    def receive(self, data: bytes, now_s: float) -> None:
        """Bytes from the host."""
        if self._line.echo:
            self.replies += self._line.heard([(now_s, data)])
        self._handle(self._line.reader.feed(data), now_s)
        self._gives_up_s = now_s + PAUSE_S if self._line.reader.pending else math.inf

    def advance(self, now_s: float) -> None:
        """Begin and end faults that are due, and give up a packet whose end does not come."""
        if now_s >= self._line.faults.next_change_s:
            with self._line.lock:
                self._line.faults.advance(now_s)
        if now_s >= self._gives_up_s:
            self._gives_up_s = math.inf
            self._handle(self._line.reader.flush(), now_s)

    def clear(self) -> None:
        """Drop all replies, and the bytes of an incomplete packet."""
        self.replies.clear()
        self._line.reader.take_pending()

    def _handle(self, packets: list[Any], now_s: float) -> None:
        line, timing = self._line, self._timing
        for packet in packets:
            if timing is None:
                self.replies += line.heard(without_timing(line.handle(packet, now_s), now_s))
                continue
            baud = line.line_baud or self._baud
            at_s = timing.arrival(now_s, line.size(packet), baud)
            self.replies += line.heard(timing.deliveries(line.handle(packet, at_s), baud))
