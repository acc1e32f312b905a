"""Simulated servos on one wire: the protocols they speak, bit rates, bus watchdogs, and the faults of servos."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.protocol import Protocol
from drivers.sim.servos.protocol1 import Protocol1
from drivers.sim.servos.protocol2 import Protocol2
from drivers.sim.servos.state import WATCHDOG_STEP_S, LastInstruction, same_rate
from drivers.sim.wire.faults import KINDS, Fault
from drivers.sim.wire.line import Line, Reader
from drivers.sim.wire.timing import Reply


class ProtocolReaders:
    """The readers of all protocols on the same bytes. Packets of one are noise to the other.

    A packet comes with the index of its protocol: (index, packet).
    """

    def __init__(self, readers: Iterable[Reader]) -> None:
        self._readers = tuple(readers)

    @property
    def pending(self) -> int:
        """Bytes that every reader holds back; 0 where one has just completed a packet with them."""
        return min(reader.pending for reader in self._readers)

    def feed(self, data: bytes) -> list[tuple[int, Any]]:
        """Packets completed by these bytes. Bytes of a complete packet are removed from the other readers too."""
        packets = [(k, packet) for k, reader in enumerate(self._readers) for packet in reader.feed(data)]
        if packets and self.pending == 0:
            self.take_pending()
        return packets

    def flush(self) -> list[tuple[int, Any]]:
        return [(k, packet) for k, reader in enumerate(self._readers) for packet in reader.flush()]

    def take_pending(self) -> bytes:
        return max((reader.take_pending() for reader in self._readers), key=len)


class Chain(Line):
    """Servos on one wire, of Protocol 1.0, 2.0 or both: each receives every byte and parses it by its own protocol.

    An id may be there once in each protocol.

    servos : any number; two with one id collide, as they do on a real wire.
    faults : specs as in ``drivers.sim.wire.faults``.
    protocols : the protocols that the servos speak; Protocol 2.0 where there are none.
    """

    def __init__(
        self,
        servos: Iterable[SimulatedServo],
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        seed: int = 0,
    ) -> None:
        self.servos = list(servos)
        numbers = {servo.table.protocol for servo in self.servos} or {2}
        self._kinds = [kind for kind in (Protocol1, Protocol2) if kind.NUMBER in numbers]
        self._last_instruction = LastInstruction(now_s)
        self._added: dict[Fault, list[SimulatedServo]] = {}
        self._outdated = True
        super().__init__(seed)
        self.protocols: list[Protocol] = [kind(self.faults) for kind in self._kinds]
        for servo in self.servos:
            self._adopt(servo)
        self.faults.add(faults, now_s)

    def servo(self, device_id: int) -> SimulatedServo:
        """The first servo that has this id now. Raises KeyError: none has it."""
        for servo in self.servos:
            if servo.id == device_id:
                return servo
        raise KeyError(f"no simulated servo has id {device_id}")

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """Id, model, position, goal, torque and latched errors of each servo."""
        return [
            {
                "id": servo.id,
                "model": servo.table.model,
                "position": servo.position_ticks(now_s),
                "goal": servo.goal,
                "torque": servo.torque,
                "error": servo.hardware_error,
            }
            for servo in self.servos
        ]

    def place(self, device_id: int, position: float, now_s: float) -> None:
        """Move a limp shaft by hand. Raises KeyError: no servo has the id. ValueError: the motor holds the shaft."""
        self.servo(device_id).place(position, now_s)

    def make_reader(self) -> ProtocolReaders:
        return ProtocolReaders(kind.make_reader() for kind in self._kinds)

    def size(self, packet: tuple[int, Any]) -> int:
        return self.protocols[packet[0]].size(packet[1])

    def carry_out(self, packet: tuple[int, Any], now_s: float) -> list[Reply]:
        return self.protocols[packet[0]].carry_out(packet[1], now_s)

    def set_line_baud(self, baud: int | None) -> None:
        if baud != self.line_baud:
            super().set_line_baud(baud)
            self._outdated = True

    def twins(self, device_id: int) -> list[SimulatedServo]:
        """Servos that the fault ``dup`` has added with this id; they answer alone where the first one is silent."""
        return [servo for added in self._added.values() for servo in added if servo.id == device_id]

    def _adopt(self, servo: SimulatedServo) -> None:
        servo.last_instruction = self._last_instruction
        servo.on_change = self._mark_outdated
        self._outdated = True

    def _mark_outdated(self) -> None:
        self._outdated = True

    def catch_up(self, now_s: float) -> None:
        """Update what changed since the last packet: faults begin and end, watchdogs trip."""
        super().catch_up(now_s)
        if now_s - self._last_instruction.at_s > WATCHDOG_STEP_S:
            for servo in self.servos:
                servo.check_watchdog(now_s)
        self._last_instruction.at_s = now_s
        if self._outdated:
            self._index()

    def _index(self) -> None:
        """Find the servos at the wire's bit rate."""
        self._outdated = False
        servos = self.servos + [servo for added in self._added.values() for servo in added]
        if self.line_baud is not None:
            servos = [servo for servo in servos if same_rate(servo.baud, self.line_baud)]
        for protocol in self.protocols:
            protocol.index(servo for servo in servos if servo.table.protocol == protocol.NUMBER)

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        super().fault_changed(fault, begins, now_s)
        if fault.kind == "chain-stop":
            for protocol in self.protocols:
                protocol.chain_stop = begins
        elif KINDS[fault.kind].scope == "servo":
            for servo in self.servos:
                if fault.concerns(servo.id):
                    self._change_servo(servo, fault, begins, now_s)
            self._outdated = True

    def _change_servo(self, servo: SimulatedServo, fault: Fault, begins: bool, now_s: float) -> None:
        if fault.kind == "baud":
            servo.force_baud(fault.value if begins else self.line_baud or 1_000_000)
        elif fault.kind == "dup" and begins:
            twin = SimulatedServo(
                servo.id, servo.table.number, now_s=now_s, baud=servo.baud, position=servo.table.center / 2
            )
            self._adopt(twin)
            self._added.setdefault(fault, []).append(twin)
        elif fault.kind == "dup":
            self._added.pop(fault, None)
        else:
            servo.change_fault(fault.kind, fault.value, begins, now_s)
