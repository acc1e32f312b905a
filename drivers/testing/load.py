"""How busy a wire was, from the bytes that passed."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from drivers.sim.wire.timing import BITS_PER_BYTE
from drivers.testing.records import Traffic


class Busiest(NamedTuple):
    """The busiest stretch: its share of the wire's time (0 to 1 and more), its first time, bytes sent and received."""

    share: float
    first_s: float
    sent: int
    received: int


def busiest(traffic: Sequence[Traffic], baud: int, over_s: float) -> Busiest:
    """The stretch of ``over_s`` seconds in which most bytes passed; pauses before answers are not counted."""
    window: deque[Traffic] = deque()
    size, most, end = 0, 0, 0
    best: list[Traffic] = []
    for end, piece in enumerate(traffic):
        window.append(piece)
        size += piece.size
        while window[0].time_s <= piece.time_s - over_s:
            size -= window.popleft().size
        if size > most:
            most, best = size, [traffic[end - len(window) + 1], piece]
    if not best:
        return Busiest(0.0, 0.0, 0, 0)
    inside = [piece for piece in traffic if best[0].time_s <= piece.time_s <= best[1].time_s]
    sent = sum(piece.size for piece in inside if piece.sent)
    return Busiest(most * BITS_PER_BYTE / baud / over_s, best[0].time_s, sent, most - sent)
