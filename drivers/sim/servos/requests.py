"""What instructions to several servos ask for: the parameters of sync and bulk packets taken apart.

A packet that is not broadcast or is broken asks for nothing, as nobody is addressed by it.
"""

from __future__ import annotations

from drivers.packets.packet import BROADCAST_ID, InstructionPacket

ReadRequest = tuple[int, int, int]
"""(id, address, length)"""
WriteRequest = tuple[int, int, bytes]
"""(id, address, data)"""


def words(params: bytes) -> tuple[int, int]:
    """The two little-endian 16-bit numbers in the first four bytes: (address, length)."""
    return params[0] | params[1] << 8, params[2] | params[3] << 8


def sync_reads(packet: InstructionPacket) -> list[ReadRequest]:
    """Sync Read and Fast Sync Read: address, length, ids."""
    params = packet.params
    if packet.id != BROADCAST_ID or len(params) < 4:
        return []
    address, length = words(params)
    return [(device_id, address, length) for device_id in params[4:]]


def bulk_reads(packet: InstructionPacket) -> list[ReadRequest]:
    """Bulk Read and Fast Bulk Read: (id, address, length), repeated."""
    params = packet.params
    if packet.id != BROADCAST_ID or len(params) % 5:
        return []
    return [(params[at], *words(params[at + 1 : at + 5])) for at in range(0, len(params), 5)]


def sync_writes(packet: InstructionPacket) -> list[WriteRequest]:
    """Sync Write: address, length, (id, data) repeated; an entry that is cut short is left out."""
    params = packet.params
    if packet.id != BROADCAST_ID or len(params) < 4:
        return []
    address, length = words(params)
    starts = range(4, len(params) - length, length + 1)
    return [(params[at], address, params[at + 1 : at + 1 + length]) for at in starts]


def bulk_writes(packet: InstructionPacket) -> list[WriteRequest]:
    """Bulk Write: (id, address, length, data), repeated; an entry that is cut short is left out."""
    params, at, requests = packet.params, 0, []
    while packet.id == BROADCAST_ID and at + 5 <= len(params):
        address, length = words(params[at + 1 : at + 5])
        data = params[at + 5 : at + 5 + length]
        if len(data) < length:
            break
        requests.append((params[at], address, data))
        at += 5 + length
    return requests
