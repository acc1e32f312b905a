"""What servos put on the wire, and what becomes of it when two speak at once."""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Speaker(Protocol):
    """Who puts bytes on the wire, as far as their time goes."""

    @property
    def return_delay_s(self) -> float:
        """Pause between a packet and its answer."""


class Reply(NamedTuple):
    """Bytes one servo puts on the wire.

    Attributes
    ----------
    data : the bytes.
    servo : whose Return Delay Time comes before them; None = they follow the bytes before at once.
    late_s : further delay, by a fault.
    """

    data: bytes
    servo: Speaker | None
    late_s: float = 0.0


def collide(replies: list[Reply]) -> list[Reply]:
    """What the host sees of replies sent at the same moment: a wire that idles high carries their bitwise and."""
    if len(replies) < 2:
        return replies
    size = max(len(reply.data) for reply in replies)
    mixed = bytearray(b"\xff" * size)
    for reply in replies:
        for at, byte in enumerate(reply.data):
            mixed[at] &= byte
    return [replies[0]._replace(data=bytes(mixed))]
