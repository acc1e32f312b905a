"""Replies on a simulated wire and the time they take: bits per byte, return delays, collisions, the USB latency timer.

One wire carries one byte at a time, so an instruction waits until the wire is free, and replies follow each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

BITS_PER_BYTE = 10
USB_PACKET = 62
"""Data bytes in a full USB packet of a common bridge; a shorter one waits for the latency timer."""

USB_FRAME_S = 0.5e-3
"""Bytes that arrive within this time reach the host together, when the last of them has arrived."""

Timed = tuple[float, bytes]
"""When bytes arrive, and the bytes."""


class Sender(Protocol):
    """A device whose replies begin after a pause."""

    @property
    def return_delay_s(self) -> float:
        """Pause between a packet and its answer."""


class Reply(NamedTuple):
    """Bytes one servo puts on the wire.

    servo : whose Return Delay Time comes before them; None: they follow the bytes before at once.
    late_s : further delay, by a fault.
    """

    data: bytes
    servo: Sender | None
    late_s: float = 0.0


def collide(replies: list[Reply]) -> list[Reply]:
    """What the host receives of replies sent at the same moment: a wire that idles high carries their bitwise and."""
    if len(replies) < 2:
        return replies
    mixed = bytearray(b"\xff" * max(len(reply.data) for reply in replies))
    for reply in replies:
        for at, byte in enumerate(reply.data):
            mixed[at] &= byte
    return [replies[0]._replace(data=bytes(mixed))]


class WireTiming:
    """Keeps track of when the wire is free.

    latency_s : latency timer of the USB bridge (16 ms by default on Linux, 1 ms in low-latency mode, 0 = none).
    """

    def __init__(self, latency_s: float = 0.0) -> None:
        self.latency_s = latency_s
        self._free_s = 0.0

    def arrival(self, now_s: float, size: int, baud: int) -> float:
        """When the last byte of an instruction of `size` bytes written now reaches the servos."""
        self._free_s = max(now_s, self._free_s) + size * BITS_PER_BYTE / baud
        return self._free_s

    def deliveries(self, replies: Sequence[Reply], baud: int) -> list[Timed]:
        """(time, bytes) at which the host gets the replies to the instruction that has just arrived."""
        timed, free_s = [], self._free_s
        for data, servo, late_s in replies:
            delay = servo.return_delay_s if servo is not None else 0.0
            free_s += delay + late_s + len(data) * BITS_PER_BYTE / baud
            timed.append((free_s, data))
        self._free_s = free_s
        return _through_bridge(timed, self.latency_s) if self.latency_s > 0.0 else _join(timed, USB_FRAME_S)


def without_timing(replies: Sequence[Reply], now_s: float) -> list[Timed]:
    """(time, bytes) on a wire that takes no time; a late reply still delays those after it."""
    timed = []
    for reply in replies:
        now_s += reply.late_s
        timed.append((now_s, reply.data))
    return _join(timed, 0.0)


def _join(timed: list[Timed], within_s: float) -> list[Timed]:
    """Bytes that arrive together or less than `within_s` after the first of them, at the time of the last of them."""
    out: list[Timed] = []
    begun_s = 0.0
    for time_s, data in timed:
        if out and (time_s - begun_s < within_s or time_s == begun_s):
            out[-1] = (time_s, out[-1][1] + data)
        else:
            begun_s = time_s
            out.append((time_s, data))
    return out


def _through_bridge(timed: list[Timed], latency_s: float) -> list[Timed]:
    """Full USB packets go at once, the rest when the latency timer expires."""
    out: list[Timed] = []
    held, last_s = b"", 0.0
    for last_s, data in timed:
        held += data
        while len(held) >= USB_PACKET:
            out.append((last_s, held[:USB_PACKET]))
            held = held[USB_PACKET:]
    if held:
        out.append((last_s + latency_s, held))
    return out
