"""Servos of Protocol 1.0 and 2.0 on one wire: each hears every byte and makes of it what its protocol says."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.protocol1 import Protocol1Chain
from drivers.sim.servos.protocol2 import Protocol2Chain
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Reader
from drivers.sim.wire.replies import Reply


class Heard(NamedTuple):
    """A packet that one of the two protocols understood."""

    part: int
    packet: Any


class TwoReaders:
    """Both protocols' readers on the same bytes. Packets of one are noise to the other.

    Parameters
    ----------
    readers : one for each part of the chain.
    """

    def __init__(self, readers: Iterable[Reader]) -> None:
        self._readers = tuple(readers)

    @property
    def pending(self) -> int:
        """Bytes that a reader holds back; where another has just understood them all, none."""
        return min(reader.pending for reader in self._readers)

    def feed(self, data: bytes) -> list[Heard]:
        """Packets completed by these bytes. What a reader kept of a whole packet of the other's it then forgets."""
        heard = [Heard(k, packet) for k, reader in enumerate(self._readers) for packet in reader.feed(data)]
        if heard and self.pending == 0:
            for reader in self._readers:
                reader.take_pending()
        return heard

    def flush(self) -> list[Heard]:
        """Give up on the incomplete packets."""
        return [Heard(k, packet) for k, reader in enumerate(self._readers) for packet in reader.flush()]

    def take_pending(self) -> bytes:
        """Forget the incomplete packets."""
        return max((reader.take_pending() for reader in self._readers), key=len)


class MixedChain(Chain):
    """A chain of each protocol on the same wire, with the same faults. See :class:`~drivers.sim.servos.chain.Chain`."""

    def __init__(
        self,
        servos: Iterable[SimulatedServo],
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        seed: int = 0,
    ) -> None:
        everyone = list(servos)
        by_protocol = [[servo for servo in everyone if servo.table.protocol == number] for number in (1, 2)]
        self.parts: tuple[Chain, ...] = (
            Protocol1Chain(by_protocol[0], now_s, seed=seed),
            Protocol2Chain(by_protocol[1], now_s, seed=seed),
        )
        super().__init__(everyone, now_s, (), seed)
        for part in self.parts:
            part.faults, part._heard = self.faults, self._heard
            for servo in part.servos:
                part._adopt(servo)
        self.faults.add(faults, now_s)

    def make_reader(self) -> TwoReaders:
        """Both protocols' readers."""
        return TwoReaders(part.reader for part in self.parts)

    def size(self, packet: Heard) -> int:
        """Bytes of an instruction packet on the wire."""
        return self.parts[packet.part].size(packet.packet)

    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        """A status packet of Protocol 2.0; servos of 1.0 make theirs in their own part."""
        return self.parts[1].encode_status(device_id, error, data)

    def carry_out(self, packet: Heard, now_s: float) -> list[Reply]:
        """What the servos of the packet's protocol make of it."""
        return self.parts[packet.part].carry_out(packet.packet, now_s)

    def set_line_baud(self, baud: int | None) -> None:
        """The port's bit rate was changed."""
        super().set_line_baud(baud)
        for part in self.parts:
            part.set_line_baud(baud)

    def _index(self) -> None:
        """Each part knows its own servos; an id may be there once in each protocol."""
        self._stale = False
        for part in self.parts:
            part._index()

    def catch_up(self, now_s: float) -> None:
        """What happened since the last packet, to all of them."""
        self._stale |= any(part._stale for part in self.parts)
        super().catch_up(now_s)

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault of the wire concerns all, one of a servo the part it is in."""
        if fault.kind in ("echo", "unplug"):
            super().fault_changed(fault, begins, now_s)
            return
        for part in self.parts:
            part.fault_changed(fault, begins, now_s)
        self._stale = True
