"""A chain of simulated Protocol 2.0 servos without a port, and packets to it, for tests."""

from __future__ import annotations

from drivers.packets.packet import StatusPacket, StatusReader, encode_instruction
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo


def chain(*ids: int, faults: tuple[str, ...] = (), model: str = "xl330-m288", **options) -> Chain:
    servos = [SimulatedServo(i, model, position=2000.0 + i, **options) for i in ids or (1, 2, 3)]
    return Chain(servos, faults=faults)


def wire(bus: Chain, device: int, instruction: int, params: bytes = b"", now_s: float = 0.0) -> bytes:
    """What comes back, as one run of bytes."""
    frame = encode_instruction(device, instruction, params)
    return b"".join(reply.data for reply in bus.feed(frame, now_s))


def ask(bus: Chain, device: int, instruction: int, params: bytes = b"", now_s: float = 0.0) -> list[StatusPacket]:
    """The status packets that come back."""
    return StatusReader().feed(wire(bus, device, instruction, params, now_s))


def words(*values: int) -> bytes:
    return b"".join(value.to_bytes(2, "little") for value in values)


def le(value: int) -> bytes:
    return value.to_bytes(4, "little", signed=True)


POSITION = words(132, 4)
