"""A wire with simulated Dynamixel servos: what each instruction packet does, and who answers what.

This is the bus without a port: bytes or packets in, replies out, the time given by the caller. ``ptyport`` and
``serve`` put it behind a pseudo-terminal.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

from drivers.dynamixel.packet import (
    BROADCAST_ID,
    ErrorNumber,
    Instruction,
    InstructionPacket,
    InstructionReader,
    crc16,
    encode_fast_head,
    encode_fast_part,
    encode_status,
)
from drivers.sim.device import WATCHDOG_STEP_S, Heard, SimulatedServo
from drivers.sim.faults import Fault, FaultSet
from drivers.sim.replies import Reply, collide
from drivers.sim.requests import (
    ReadRequest,
    WriteRequest,
    bulk_reads,
    bulk_writes,
    sync_reads,
    sync_writes,
    words,
)

FACTORY_BROADCAST_FIRMWARE = 42
"""From here on a broadcast factory reset of everything is ignored."""


class SimulatedChain:
    """Servos on one wire.

    Parameters
    ----------
    servos : any number; two with one id collide, as they do on a real wire.
    now_s : time.
    faults : specs as in ``drivers.sim.faults``.
    seed : of random faults.

    Attributes
    ----------
    servos : the servos, in the order given.
    line_baud : bit rate of the port, or None while unknown; servos set to another rate do not hear it.
    echo : the adapter gives back what it was sent.
    chain_stop : in reads of several servos nobody answers behind a silent one; otherwise the next one does.
    on_unplug : called with (fault, begins) when the port goes away or comes back.
    packets : instruction packets handled.
    lock : held while a packet is handled; hold it to look at servos from another thread.
    """

    def __init__(
        self,
        servos: Iterable[SimulatedServo],
        now_s: float = 0.0,
        faults: Iterable[str | Fault] = (),
        seed: int = 0,
    ) -> None:
        self.servos = list(servos)
        self.line_baud: int | None = None
        self.echo = self.chain_stop = False
        self.on_unplug: Callable[[Fault, bool], None] = lambda fault, begins: None
        self.packets = 0
        self.lock = threading.RLock()
        self.reader = InstructionReader()
        self._heard = Heard(now_s)
        self._muted: frozenset[int] = frozenset()
        self._by_id: dict[int, SimulatedServo] = {}
        self._twins: dict[int, list[SimulatedServo]] = {}
        self._extra: dict[Fault, list[SimulatedServo]] = {}
        self._stale = True
        for servo in self.servos:
            self._adopt(servo)
        self._handlers = self._handlers_by_instruction()
        self.faults = FaultSet(self._fault_changed, seed)
        self.faults.add(faults, now_s)

    def servo(self, device_id: int) -> SimulatedServo:
        """The first servo that has this id now.

        Raises
        ------
        KeyError : nobody has it.
        """
        for servo in self.servos:
            if servo.id == device_id:
                return servo
        raise KeyError(f"no simulated servo has id {device_id}")

    def feed(self, data: bytes, now_s: float) -> list[Reply]:
        """Bytes from the host; returns what comes back, in order."""
        replies = []
        for packet in self.reader.feed(data):
            replies += self.handle(packet, now_s)
        return replies

    def handle(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """One instruction packet; returns what comes back, in order."""
        with self.lock:
            self._catch_up(now_s)
            self.packets += 1
            handler = self._handlers.get(packet.instruction)
            return handler(packet, now_s) if handler else self._unknown(packet, now_s)

    def set_line_baud(self, baud: int | None) -> None:
        """The port's bit rate was changed."""
        if baud != self.line_baud:
            self.line_baud = baud
            self._stale = True

    def _adopt(self, servo: SimulatedServo) -> None:
        servo.heard = self._heard
        servo.on_change = self._mark_stale
        self._stale = True

    def _mark_stale(self) -> None:
        self._stale = True

    def _catch_up(self, now_s: float) -> None:
        """What happened on the wire since the last packet: faults that are due, watchdogs that tripped."""
        if now_s >= self.faults.next_change_s:
            self.faults.advance(now_s)
        if now_s - self._heard.at_s > WATCHDOG_STEP_S:
            for servo in self.servos:
                servo.watch(now_s)
        self._heard.at_s = now_s
        if self._stale:
            self._index()

    def _index(self) -> None:
        """Who hears the wire, by id. Servos at another bit rate do not."""
        self._stale = False
        self._by_id, self._twins = {}, {}
        everyone = self.servos + [twin for twins in self._extra.values() for twin in twins]
        for servo in everyone:
            if self.line_baud is not None and servo.baud != self.line_baud:
                continue
            if servo.id in self._by_id:
                self._twins.setdefault(servo.id, []).append(servo)
            else:
                self._by_id[servo.id] = servo

    # ------------------------------------------------------------ who is addressed
    def _find(self, device_id: int, now_s: float) -> SimulatedServo | None:
        """The servo that hears this id now, caught up with the time."""
        servo = self._by_id.get(device_id)
        if servo is None or device_id in self._muted or now_s < servo.deaf_until:
            return None
        if now_s >= servo.next_health_s:
            servo.look(now_s)
        return servo

    def _everyone(self, now_s: float) -> list[SimulatedServo]:
        """All servos that hear, in order of id, twins included."""
        heard = []
        for device_id in sorted(self._by_id):
            if self._find(device_id, now_s):
                heard += [self._by_id[device_id], *self._twins.get(device_id, ())]
        return heard

    def _group(self, device_id: int, now_s: float) -> list[SimulatedServo]:
        """Servos that carry out a write to an id: its owner and twins, else those with that secondary id."""
        servo = self._find(device_id, now_s)
        if servo is not None:
            return [servo, *self._twins.get(device_id, ())]
        if device_id in self._by_id:
            return []
        return [other for other in self._everyone(now_s) if other.secondary_id == device_id]

    # ------------------------------------------------------------ answers
    def _status(self, servo: SimulatedServo, device_id: int, error: int, data: bytes) -> Reply | None:
        """One status packet as it arrives at the host; None where nothing does."""
        frame = encode_status(device_id, error, data)
        if not self.faults.spoilers:
            return Reply(frame, servo)
        spoilt, late_s = self.faults.spoil_status(frame, device_id, error, data)
        return None if spoilt is None else Reply(spoilt, servo, late_s)

    def _answer(
        self, device_id: int, level: int, now_s: float, act: Callable[[SimulatedServo], tuple[int, bytes]]
    ) -> list[Reply]:
        """Let the servo (and its twins) act; the replies of twins collide on the wire."""
        group = self._group(device_id, now_s)
        replies = []
        for servo in group:
            answers = servo.id == device_id and servo.status_level >= level
            error, data = act(servo)
            if answers:
                replies.append(self._status(servo, device_id, error, data))
        return collide([reply for reply in replies if reply])

    def _handlers_by_instruction(
        self,
    ) -> dict[int, Callable[[InstructionPacket, float], list[Reply]]]:
        return {
            Instruction.PING: self._ping,
            Instruction.READ: self._read,
            Instruction.WRITE: self._write,
            Instruction.REG_WRITE: self._reg_write,
            Instruction.ACTION: self._action,
            Instruction.FACTORY_RESET: self._factory_reset,
            Instruction.REBOOT: self._reboot,
            Instruction.CLEAR: self._clear,
            Instruction.SYNC_READ: lambda packet, now_s: self._read_many(sync_reads(packet), now_s),
            Instruction.SYNC_WRITE: lambda packet, now_s: self._write_many(sync_writes(packet), now_s),
            Instruction.FAST_SYNC_READ: lambda packet, now_s: self._read_fast(sync_reads(packet), now_s),
            Instruction.BULK_READ: lambda packet, now_s: self._read_many(bulk_reads(packet), now_s),
            Instruction.BULK_WRITE: lambda packet, now_s: self._write_many(bulk_writes(packet), now_s),
            Instruction.FAST_BULK_READ: lambda packet, now_s: self._read_fast(bulk_reads(packet), now_s),
        }

    # ------------------------------------------------------------ instructions to one servo
    def _ping(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """Always answered, whatever the Status Return Level. Broadcast: everybody, in order of id."""

        def identity(servo: SimulatedServo) -> tuple[int, bytes]:
            table = servo.table
            return servo.alert, table.number.to_bytes(2, "little") + bytes((table.firmware,))

        if packet.id != BROADCAST_ID:
            return self._answer(packet.id, 0, now_s, identity)
        replies = []
        for device_id in sorted(self._by_id):
            replies += self._answer(device_id, 0, now_s, identity)
        return replies

    def _read(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """Broadcast is not answered, nor is a secondary id."""
        params = packet.params
        if len(params) != 4:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s, 1)
        address, length = words(params)
        if packet.id == BROADCAST_ID:
            return []
        return self._answer(packet.id, 1, now_s, lambda servo: servo.read(address, length, now_s))

    def _write(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """Broadcast is carried out by all and answered by nobody."""
        params = packet.params
        if len(params) < 3:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s, 2)
        address, data = params[0] | params[1] << 8, params[2:]
        return self._act(packet, now_s, lambda servo: self._put(servo, packet.id, address, data, now_s))

    def _reg_write(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        params = packet.params
        if len(params) < 3:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s, 2)
        address, data = params[0] | params[1] << 8, params[2:]
        return self._act(packet, now_s, lambda servo: servo.reg_write(address, data))

    def _action(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        return self._act(packet, now_s, lambda servo: servo.action(now_s))

    def _factory_reset(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        option = packet.params[0] if len(packet.params) == 1 else -1

        def reset(servo: SimulatedServo) -> int:
            everything = packet.id == BROADCAST_ID and option == 0xFF
            if everything and servo.table.firmware >= FACTORY_BROADCAST_FIRMWARE:
                return 0
            return servo.factory_reset(option, now_s)

        return self._act(packet, now_s, reset)

    def _reboot(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        def reboot(servo: SimulatedServo) -> int:
            alert = servo.alert
            servo.reboot(now_s)
            return alert

        return self._act(packet, now_s, reboot)

    def _clear(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        return self._act(packet, now_s, lambda servo: servo.clear(packet.params, now_s))

    def _unknown(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        return self._refuse(packet, ErrorNumber.INSTRUCTION, now_s, 2)

    def _refuse(self, packet: InstructionPacket, error: ErrorNumber, now_s: float, level: int) -> list[Reply]:
        if packet.id == BROADCAST_ID:
            return []
        return self._answer(packet.id, level, now_s, lambda servo: (servo.alert | error, b""))

    def _act(self, packet: InstructionPacket, now_s: float, act: Callable[[SimulatedServo], int]) -> list[Reply]:
        """Something every addressed servo does; one servo answers with an empty status, all with none."""
        if packet.id == BROADCAST_ID:
            for servo in self._everyone(now_s):
                act(servo)
            return []
        return self._answer(packet.id, 2, now_s, lambda servo: (act(servo), b""))

    # ------------------------------------------------------------ instructions to many
    def _read_many(self, requests: list[ReadRequest], now_s: float) -> list[Reply]:
        """One status each, in the order asked for; a silent one may silence those behind it."""
        replies = []
        for device_id, address, length in requests:
            servo = self._find(device_id, now_s)
            reply = None
            if servo is not None and servo.status_level:
                error, data = servo.read(address, length, now_s)
                reply = self._status(servo, device_id, error, data)
                if reply and device_id in self._twins:
                    reply = self._with_twins(reply, device_id, address, length, now_s)
            if reply:
                replies.append(reply)
            elif self.chain_stop:
                break
        return replies

    def _with_twins(self, reply: Reply, device_id: int, address: int, length: int, now_s: float) -> Reply:
        others = []
        for twin in self._twins[device_id]:
            error, data = twin.read(address, length, now_s)
            others.append(self._status(twin, device_id, error, data))
        return collide([reply, *(other for other in others if other)])[0]

    def _read_fast(self, requests: list[ReadRequest], now_s: float) -> list[Reply]:
        """One joint reply, cut off at the first servo that is silent or knows no fast reads."""
        head = encode_fast_head([length for _, _, length in requests])
        crc = crc16(head)
        replies: list[Reply] = []
        for device_id, address, length in requests:
            servo = self._find(device_id, now_s)
            if servo is None or not servo.status_level or not servo.table.fast_read:
                break
            error, data = servo.read(address, length, now_s)
            part, crc = encode_fast_part(device_id, error, data.ljust(length, b"\0"), crc)
            spoilt, late_s = self.faults.spoil_part(part, device_id)
            if spoilt is None:
                break
            first = not replies
            replies.append(Reply(head + spoilt if first else spoilt, servo if first else None, late_s))
        return replies

    def _write_many(self, requests: list[WriteRequest], now_s: float) -> list[Reply]:
        """Carried out by everybody it names, answered by nobody."""
        for device_id, address, data in requests:
            for servo in self._group(device_id, now_s):
                self._put(servo, device_id, address, data, now_s)
        return []

    @staticmethod
    def _put(servo: SimulatedServo, device_id: int, address: int, data: bytes, now_s: float) -> int:
        """A write; one to a secondary id reaches RAM only."""
        if address < servo.table.eeprom_end and servo.secondary_id == device_id != servo.id:
            return ErrorNumber.ACCESS
        return servo.write(address, data, now_s)

    # ------------------------------------------------------------ faults
    def _fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """A fault that is not about replies begins or ends."""
        if fault.kind == "echo":
            self.echo = begins
        elif fault.kind == "chain-stop":
            self.chain_stop = begins
        elif fault.kind == "unplug":
            self.on_unplug(fault, begins)
        elif fault.kind == "mute":
            muted = [f for f in self.faults.active if f.kind == "mute"]
            ids = {servo.id for servo in self.servos}
            self._muted = frozenset(i for i in ids if any(f.concerns(i) for f in muted))
        else:
            for servo in self.servos:
                if fault.concerns(servo.id):
                    self._change_servo(servo, fault, begins, now_s)
            self._stale = True

    def _change_servo(self, servo: SimulatedServo, fault: Fault, begins: bool, now_s: float) -> None:
        if fault.kind == "baud":
            servo.force_baud(fault.value if begins else self.line_baud or 1_000_000)
        elif fault.kind == "dup" and begins:
            twin = SimulatedServo(
                servo.id, servo.table.number, now_s=now_s, baud=servo.baud, position=servo.table.center / 2
            )
            self._adopt(twin)
            self._extra.setdefault(fault, []).append(twin)
        elif fault.kind == "dup":
            self._extra.pop(fault, None)
        else:
            servo.suffer(fault.kind, fault.value, begins, now_s)
