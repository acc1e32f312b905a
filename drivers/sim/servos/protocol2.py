"""Simulated servos that speak Dynamixel Protocol 2.0: what each instruction does, and who answers it.

This is the bus without a port: bytes or packets in, replies out, the time given by the caller.
``drivers.sim.serving`` puts it behind a pseudo-terminal or a socket.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from drivers.packets.packet import (
    BROADCAST_ID,
    Instruction,
    InstructionPacket,
    InstructionReader,
    crc16,
    encode_fast_head,
    encode_fast_part,
    encode_status,
    stuff,
)
from drivers.sim.servos.device import SimulatedServo
from drivers.sim.servos.protocol import Protocol, ReadRequest
from drivers.sim.wire.timing import Reply, collide

FACTORY_BROADCAST_FIRMWARE = 42
"""From here on a broadcast factory reset of everything is ignored."""


class Protocol2(Protocol):
    """Servos that speak Protocol 2.0 on one wire."""

    NUMBER = 2
    WORD = 2
    MALFORMED_READ_LEVEL = 1

    @staticmethod
    def make_reader() -> InstructionReader:
        """A reader of instruction packets; status packets are passed over."""
        return InstructionReader()

    def size(self, packet: InstructionPacket) -> int:
        """Bytes of an instruction packet on the wire, stuffing included."""
        return 10 + len(stuff(packet.params))

    def encode_status(self, device_id: int, error: int, data: bytes) -> bytes:
        return encode_status(device_id, error, data)

    def error_byte(self, servo: SimulatedServo, error: int) -> int:
        return error

    def identity(self, servo: SimulatedServo) -> bytes:
        """Model number and firmware version."""
        return servo.table.number.to_bytes(2, "little") + bytes((servo.table.firmware,))

    def factory_reset(self, servo: SimulatedServo, packet: InstructionPacket, now_s: float) -> int:
        option = packet.params[0] if len(packet.params) == 1 else -1
        everything = packet.id == BROADCAST_ID and option == 0xFF
        if everything and servo.table.firmware >= FACTORY_BROADCAST_FIRMWARE:
            return 0
        return servo.factory_reset(option, now_s)

    def reboot(self, servo: SimulatedServo, now_s: float) -> int:
        """Answered with the alert bit as it was before."""
        alert = servo.alert
        servo.reboot(now_s)
        return alert

    @cached_property
    def handlers(self) -> dict[int, Callable[[Any, float], list[Reply]]]:
        return super().handlers | {
            Instruction.CLEAR: lambda packet, now_s: self._act(
                packet, now_s, lambda servo: servo.clear(packet.params, now_s)
            ),
            Instruction.FAST_SYNC_READ: lambda packet, now_s: self._read_fast(self._sync_requests(packet), now_s),
            Instruction.BULK_WRITE: self._bulk_write,
            Instruction.FAST_BULK_READ: lambda packet, now_s: self._read_fast(self._bulk_requests(packet), now_s),
        }

    def _sync_read(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        return self._read_many(self._sync_requests(packet), now_s)

    def _bulk_read(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        return self._read_many(self._bulk_requests(packet), now_s)

    def _bulk_requests(self, packet: InstructionPacket) -> list[ReadRequest]:
        """Reads that a bulk read asks for: (id, address, length), repeated."""
        params = packet.params
        if packet.id != BROADCAST_ID or len(params) % 5:
            return []
        return [(params[at], self._word(params, at + 1), self._word(params, at + 3)) for at in range(0, len(params), 5)]

    def _read_many(self, requests: list[ReadRequest], now_s: float) -> list[Reply]:
        """One status each, in the requested order; servos after a silent one may not answer either."""
        replies: list[Reply] = []
        for device_id, address, length in requests:
            servo = self.find(device_id, now_s)
            reply = None
            if servo is not None and servo.status_level:
                error, data = servo.read(address, length, now_s)
                reply = self.status(servo, device_id, error, data)
                if reply and device_id in self.duplicates:
                    twins = self.duplicates[device_id]
                    others = [self.status(twin, device_id, *twin.read(address, length, now_s)) for twin in twins]
                    (reply,) = collide([reply, *(other for other in others if other)])
            if reply:
                replies.append(reply)
            elif self.chain_stop:
                break
        return replies

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
            arrived: bytes | None
            arrived, crc = encode_fast_part(device_id, error, data.ljust(length, b"\0"), crc)
            late_s = 0.0
            if self.faults.reply_faults:
                corrupt = self.faults.corrupt
                arrived, late_s = corrupt(arrived, device_id, shorten=_shorten_part, readdress=_readdress_part)
            if arrived is None:
                break
            first = not replies
            replies.append(Reply(head + arrived if first else arrived, servo if first else None, late_s))
        return replies

    def _bulk_write(self, packet: InstructionPacket, now_s: float) -> list[Reply]:
        """(id, address, length, data), repeated; an entry that is cut short is left out. Answered by none."""
        params, at = packet.params, 0
        while packet.id == BROADCAST_ID and at + 5 <= len(params):
            end = at + 5 + self._word(params, at + 3)
            if end > len(params):
                break
            self._write_to(params[at], self._word(params, at + 1), params[at + 5 : end], now_s)
            at = end
        return []


def _shorten_part(part: bytes, size: int) -> bytes:
    """A part of a joint reply (error byte, id, data, CRC) with only so many data bytes, its CRC unchanged."""
    return part[: 2 + size] + part[-2:]


def _readdress_part(part: bytes, device_id: int) -> bytes:
    return part[:1] + bytes((device_id,)) + part[2:]
