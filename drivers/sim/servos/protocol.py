"""Base class of the protocols of simulated servos: which servos receive and answer a packet, and instructions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any, ClassVar

from drivers.packets.packet import BROADCAST_ID, ErrorNumber, Instruction
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.wire.faults import FaultSet
from drivers.sim.wire.line import Reader
from drivers.sim.wire.timing import Reply, collide

ReadRequest = tuple[int, int, int]
"""(id, address, length)"""


class Protocol(ABC):
    """The servos of one protocol on a wire, with the instructions that Protocol 1.0 and 2.0 share.

    A packet is (id, instruction number, parameters). One servo answers an instruction with a status packet; one to
    the broadcast id is carried out by all and, except for a ping, answered by none.

    by_id, duplicates : the servos that receive packets, by id; further servos with an id that is taken.
    chain_stop : in reads of several servos no servo after a silent one answers; otherwise the next one does.
    """

    NUMBER: ClassVar[int]
    """1 or 2, as in the control tables."""
    WORD: ClassVar[int]
    """Bytes of an address, and of a length, in the parameters."""
    MALFORMED_READ_LEVEL: ClassVar[int]
    """Lowest Status Return Level at which a read without address or length is answered with an error."""

    def __init__(self, faults: FaultSet) -> None:
        self.faults = faults
        self.by_id: dict[int, SimulatedServo] = {}
        self.duplicates: dict[int, list[SimulatedServo]] = {}
        self.chain_stop = False
        self._muted: frozenset[int] = frozenset()

    @staticmethod
    @abstractmethod
    def make_reader() -> Reader:
        """A reader of the protocol's instruction packets."""

    @abstractmethod
    def size(self, packet: Any) -> int:
        """Bytes of an instruction packet on the wire."""

    @abstractmethod
    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        """A status packet of the protocol."""

    @abstractmethod
    def error_byte(self, servo: SimulatedServo, error: int) -> int:
        """Error byte of a status packet from one of Protocol 2.0 (`ALERT` and an `ErrorNumber`)."""

    @abstractmethod
    def identity(self, servo: SimulatedServo) -> bytes:
        """Parameters of the answer to a ping."""

    @abstractmethod
    def factory_reset(self, servo: SimulatedServo, packet: Any, now_s: float) -> int:
        """Reset a servo to the factory settings that a packet names; returns the error byte."""

    @abstractmethod
    def reboot(self, servo: SimulatedServo, now_s: float) -> int:
        """Reboot a servo; returns the error byte."""

    @abstractmethod
    def _sync_read(self, packet: Any, now_s: float) -> list[Reply]: ...

    @abstractmethod
    def _bulk_read(self, packet: Any, now_s: float) -> list[Reply]: ...

    @cached_property
    def handlers(self) -> dict[int, Callable[[Any, float], list[Reply]]]:
        """Functions that carry out instructions, by number; the numbers are the same in both protocols."""
        return {
            Instruction.PING: self._ping,
            Instruction.READ: self._read,
            Instruction.WRITE: self._write,
            Instruction.REG_WRITE: self._reg_write,
            Instruction.ACTION: lambda packet, now_s: self._act(packet, now_s, lambda servo: servo.action(now_s)),
            Instruction.FACTORY_RESET: lambda packet, now_s: self._act(
                packet, now_s, lambda servo: self.factory_reset(servo, packet, now_s)
            ),
            Instruction.REBOOT: lambda packet, now_s: self._act(packet, now_s, lambda servo: self.reboot(servo, now_s)),
            Instruction.SYNC_READ: self._sync_read,
            Instruction.SYNC_WRITE: self._sync_write,
            Instruction.BULK_READ: self._bulk_read,
        }

    def index(self, servos: Iterable[SimulatedServo]) -> None:
        """Take these servos, which are at the wire's bit rate, as the ones that receive packets."""
        self.by_id, self.duplicates = {}, {}
        for servo in servos:
            if self.by_id.setdefault(servo.id, servo) is not servo:
                self.duplicates.setdefault(servo.id, []).append(servo)
        muted = [fault for fault in self.faults.active if fault.kind == "mute"]
        self._muted = frozenset(i for i in self.by_id if any(fault.concerns(i) for fault in muted))

    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """Carry out a packet; returns the replies."""
        handler = self.handlers.get(packet[1])
        return handler(packet, now_s) if handler else self._refuse(packet, ErrorNumber.INSTRUCTION, now_s)

    # ------------------------------------------------------------ who is addressed
    def find(self, device_id: int, now_s: float) -> SimulatedServo | None:
        """The servo that receives packets to this id now, its health up to date."""
        servo = self.by_id.get(device_id)
        if servo is None or device_id in self._muted or now_s < servo.deaf_until:
            return None
        if now_s >= servo.next_health_s:
            servo.update(now_s)
        return servo

    def receivers(self, now_s: float) -> list[SimulatedServo]:
        """All servos that receive packets now, in order of id, those with the same id included."""
        receivers = []
        for device_id in sorted(self.by_id):
            if self.find(device_id, now_s):
                receivers += [self.by_id[device_id], *self.duplicates.get(device_id, ())]
        return receivers

    def addressed(self, device_id: int, now_s: float) -> list[SimulatedServo]:
        """Servos that carry out a write to an id: those that have it, else those with that secondary id."""
        servo = self.find(device_id, now_s)
        if servo is not None:
            return [servo, *self.duplicates.get(device_id, ())]
        if device_id in self.by_id:
            return []
        return [other for other in self.receivers(now_s) if other.secondary_id == device_id]

    # ------------------------------------------------------------ answers
    def status(self, servo: SimulatedServo, device_id: int, error: int, data: bytes) -> Reply | None:
        """One status packet as it arrives at the host; None where nothing does."""
        frame = self.encode_status(device_id, error, data)
        if not self.faults.reply_faults:
            return Reply(frame, servo)
        arrived, late_s = self.faults.corrupt(
            frame,
            device_id,
            first=4,
            shorten=lambda frame, size: self.encode_status(device_id, error, data[:size]),
            readdress=lambda frame, other: self.encode_status(other, error, data),
        )
        return None if arrived is None else Reply(arrived, servo, late_s)

    def answer(
        self, device_id: int, level: int, now_s: float, act: Callable[[SimulatedServo], tuple[int, bytes]]
    ) -> list[Reply]:
        """Let the servos with an id act; those with at least this Status Return Level answer, and replies collide."""
        replies = []
        for servo in self.addressed(device_id, now_s):
            answers = servo.id == device_id and servo.status_level >= level
            error, data = act(servo)
            if answers:
                replies.append(self.status(servo, device_id, self.error_byte(servo, error), data))
        return collide([reply for reply in replies if reply])

    def _act(self, packet: Any, now_s: float, act: Callable[[SimulatedServo], int], level: int = 2) -> list[Reply]:
        """Something every addressed servo does; one servo answers with an empty status, all with none."""
        if packet.id == BROADCAST_ID:
            for servo in self.receivers(now_s):
                act(servo)
            return []
        return self.answer(packet.id, level, now_s, lambda servo: (act(servo), b""))

    def _refuse(self, packet: Any, error: ErrorNumber, now_s: float, level: int = 2) -> list[Reply]:
        return self._act(packet, now_s, lambda servo: servo.alert | error, level)

    # ------------------------------------------------------------ instructions
    def _word(self, params: bytes, at: int = 0) -> int:
        return int.from_bytes(params[at : at + self.WORD], "little")

    def _ping(self, packet: Any, now_s: float) -> list[Reply]:
        """Answer a ping, whatever the Status Return Level; a broadcast is answered by all servos, in order of id."""
        ids = sorted(self.by_id) if packet.id == BROADCAST_ID else [packet.id]
        replies = []
        for device_id in ids:
            replies += self.answer(device_id, 0, now_s, lambda servo: (servo.alert, self.identity(servo)))
        return replies

    def _read(self, packet: Any, now_s: float) -> list[Reply]:
        """Answer a read; a secondary id does not answer."""
        params, word = packet.params, self.WORD
        if len(params) != 2 * word:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s, self.MALFORMED_READ_LEVEL)
        if packet.id == BROADCAST_ID:
            return []
        address, length = self._word(params), self._word(params, word)
        return self.answer(packet.id, 1, now_s, lambda servo: servo.read(address, length, now_s))

    def _write(self, packet: Any, now_s: float) -> list[Reply]:
        address, data = self._word(packet.params), packet.params[self.WORD :]
        if not data:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s)
        return self._act(packet, now_s, lambda servo: _write(servo, packet.id, address, data, now_s))

    def _reg_write(self, packet: Any, now_s: float) -> list[Reply]:
        address, data = self._word(packet.params), packet.params[self.WORD :]
        if not data:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s)
        return self._act(packet, now_s, lambda servo: servo.reg_write(address, data))

    def _sync_requests(self, packet: Any) -> list[ReadRequest]:
        """Reads that a sync read asks for: address, length, ids. Empty where it is malformed or not broadcast."""
        params, word = packet.params, self.WORD
        if packet.id != BROADCAST_ID or len(params) < 2 * word:
            return []
        address, length = self._word(params), self._word(params, word)
        return [(device_id, address, length) for device_id in params[2 * word :]]

    def _sync_write(self, packet: Any, now_s: float) -> list[Reply]:
        """Address, length, (id, data) repeated; an entry that is cut short is left out. Answered by none."""
        params, word = packet.params, self.WORD
        if packet.id == BROADCAST_ID and len(params) >= 2 * word:
            address, length = self._word(params), self._word(params, word)
            for at in range(2 * word, len(params) - length, length + 1):
                self._write_to(params[at], address, params[at + 1 : at + 1 + length], now_s)
        return []

    def _write_to(self, device_id: int, address: int, data: bytes, now_s: float) -> None:
        for servo in self.addressed(device_id, now_s):
            _write(servo, device_id, address, data, now_s)


def _write(servo: SimulatedServo, device_id: int, address: int, data: bytes, now_s: float) -> int:
    """A write to an id; one to a secondary id reaches RAM only. Returns the error byte of Protocol 2.0."""
    if servo.table.is_permanent(address) and servo.secondary_id == device_id != servo.id:
        return ErrorNumber.ACCESS
    return servo.write(address, data, now_s)
