"""Servos of Protocol 1.0 and 2.0 on one wire: each receives every byte and parses it by its own protocol."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.protocol1 import Protocol1Chain
from drivers.sim.servos.protocol2 import Protocol2Chain
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Reader
from drivers.sim.wire.timing import Reply


class PartPacket(NamedTuple):
    """A packet of one of the two protocols, and the index of the chain that speaks it."""

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
        """Bytes that a reader holds back; 0 where another has just completed a packet with them."""
        return min(reader.pending for reader in self._readers)

    def feed(self, data: bytes) -> list[PartPacket]:
        """Packets completed by these bytes. Bytes of a complete packet are removed from the other reader too."""
        packets = [PartPacket(k, packet) for k, reader in enumerate(self._readers) for packet in reader.feed(data)]
        if packets and self.pending == 0:
            self.take_pending()
        return packets

    def flush(self) -> list[PartPacket]:
        return [PartPacket(k, packet) for k, reader in enumerate(self._readers) for packet in reader.flush()]

    def take_pending(self) -> bytes:
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
        first, second = ([servo for servo in everyone if servo.table.protocol == number] for number in (1, 2))
        self.parts: tuple[Chain, ...] = Protocol1Chain(first, now_s), Protocol2Chain(second, now_s)
        super().__init__(everyone, now_s, (), seed)
        for part in self.parts:
            part.faults, part._last_instruction = self.faults, self._last_instruction
            for servo in part.servos:
                part._adopt(servo)
        self.faults.add(faults, now_s)

    def make_reader(self) -> TwoReaders:
        return TwoReaders(part.reader for part in self.parts)

    def size(self, packet: PartPacket) -> int:
        return self.parts[packet.part].size(packet.packet)

    def carry_out(self, packet: PartPacket, now_s: float) -> list[Reply]:
        return self.parts[packet.part].carry_out(packet.packet, now_s)

    def set_line_baud(self, baud: int | None) -> None:
        super().set_line_baud(baud)
        for part in self.parts:
            part.set_line_baud(baud)

    def _index(self) -> None:
        """Each part indexes its own servos; an id may be there once in each protocol."""
        self._outdated = False
        for part in self.parts:
            part._index()

    def catch_up(self, now_s: float) -> None:
        self._outdated |= any(part._outdated for part in self.parts)
        super().catch_up(now_s)

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault of the wire concerns all servos, one of a servo the part it is in."""
        if fault.kind in ("echo", "unplug"):
            super().fault_changed(fault, begins, now_s)
            return
        for part in self.parts:
            part.fault_changed(fault, begins, now_s)
        self._outdated = True
