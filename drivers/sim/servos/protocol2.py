"""Dynamixel Protocol 2.0 on a wire of simulated servos: what each instruction does, and who answers what.

This is the bus without a port: bytes or packets in, replies out, the time given by the caller. ``ptyport`` and
``serve`` put it behind a pseudo-terminal.
"""

from __future__ import annotations

from collections.abc import Callable

from drivers.packets.packet import (
    BROADCAST_ID,
    ErrorNumber,
    Instruction,
    InstructionPacket,
    InstructionReader,
    crc16,
    encode_fast_head,
    encode_fast_part,
    encode_status,
    stuff,
)
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.requests import (
    ReadRequest,
    WriteRequest,
    bulk_reads,
    bulk_writes,
    sync_reads,
    sync_writes,
    words,
)
from drivers.sim.wire.replies import Reply, collide

FACTORY_BROADCAST_FIRMWARE = 42
"""From here on a broadcast factory reset of everything is ignored."""


class Protocol2Chain(Chain):
    """Servos that speak Protocol 2.0 on one wire. See :class:`~drivers.sim.servos.chain.Chain`."""

    def make_reader(self) -> InstructionReader:
        """A reader of instruction packets; status packets are passed over."""
        self._handlers = self._handlers_by_instruction()
        return InstructionReader()

    def size(self, packet: InstructionPacket) -> int:
        """Bytes of an instruction packet on the wire, stuffing included."""
        return 10 + len(stuff(packet.params))

    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        """A status packet."""
        return encode_status(device_id, error, data)

    def carry_out(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """What an instruction packet does, and who answers."""
        handler = self._handlers.get(packet.instruction)
        return handler(packet, now_s) if handler else self._unknown(packet, now_s)

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
            return self.answer(packet.id, 0, now_s, identity)
        replies = []
        for device_id in sorted(self.by_id):
            replies += self.answer(device_id, 0, now_s, identity)
        return replies

    def _read(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """Broadcast is not answered, nor is a secondary id."""
        params = packet.params
        if len(params) != 4:
            return self._refuse(packet, ErrorNumber.DATA_LENGTH, now_s, 1)
        address, length = words(params)
        if packet.id == BROADCAST_ID:
            return []
        return self.answer(packet.id, 1, now_s, lambda servo: servo.read(address, length, now_s))

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
        return self.answer(packet.id, level, now_s, lambda servo: (servo.alert | error, b""))

    def _act(self, packet: InstructionPacket, now_s: float, act: Callable[[SimulatedServo], int]) -> list[Reply]:
        """Something every addressed servo does; one servo answers with an empty status, all with none."""
        if packet.id == BROADCAST_ID:
            for servo in self.everyone(now_s):
                act(servo)
            return []
        return self.answer(packet.id, 2, now_s, lambda servo: (act(servo), b""))

    # ------------------------------------------------------------ instructions to many
    def _read_many(self, requests: list[ReadRequest], now_s: float) -> list[Reply]:
        """One status each, in the order asked for; a silent one may silence those behind it."""
        replies = []
        for device_id, address, length in requests:
            servo = self.find(device_id, now_s)
            reply = None
            if servo is not None and servo.status_level:
                error, data = servo.read(address, length, now_s)
                reply = self.status(servo, device_id, error, data)
                if reply and device_id in self.twins:
                    reply = self._with_twins(reply, device_id, address, length, now_s)
            if reply:
                replies.append(reply)
            elif self.chain_stop:
                break
        return replies

    def _with_twins(self, reply: Reply, device_id: int, address: int, length: int, now_s: float) -> Reply:
        others = []
        for twin in self.twins[device_id]:
            error, data = twin.read(address, length, now_s)
            others.append(self.status(twin, device_id, error, data))
        return collide([reply, *(other for other in others if other)])[0]

    def _read_fast(self, requests: list[ReadRequest], now_s: float) -> list[Reply]:
        """One joint reply, cut off at the first servo that is silent or knows no fast reads."""
        head = encode_fast_head([length for _, _, length in requests])
        crc = crc16(head)
        replies: list[Reply] = []
        for device_id, address, length in requests:
            servo = self.find(device_id, now_s)
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
            for servo in self.group(device_id, now_s):
                self._put(servo, device_id, address, data, now_s)
        return []

    @staticmethod
    def _put(servo: SimulatedServo, device_id: int, address: int, data: bytes, now_s: float) -> int:
        """A write; one to a secondary id reaches RAM only."""
        if address < servo.table.eeprom_end and servo.secondary_id == device_id != servo.id:
            return ErrorNumber.ACCESS
        return servo.write(address, data, now_s)
