"""What simulated servo boards share: one voice on the port, faults of its answers, and a supply that may break down."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Line
from drivers.sim.wire.replies import Reply

FAULTS = ("echo", "slow-reader", "unplug", "mute", "silent", "late", "drop", "flip", "noise", "short", "volts")
"""Faults of a board. Ids are channels; ``mute`` and ``volts`` are the board's, so write ``*``."""
BROWN_OUT_V = 4.0


class Board(Line):
    """A board with hobby servos on one port.

    Parameters
    ----------
    now_s : time.
    faults : specs; see :data:`FAULTS`.
    seed : of random faults.
    """

    def __init__(self, now_s: float = 0.0, faults: Iterable[str | Fault] = (), seed: int = 0) -> None:
        super().__init__(seed, kinds=FAULTS)
        self._deaf: list[Fault] = []
        self.faults.add(faults, now_s)

    @abstractmethod
    def answer(self, packet: Any, now_s: float) -> list[tuple[int, bytes]]:
        """Do a packet; returns what is answered, each with the channel it is about (0: none)."""

    @abstractmethod
    def reset(self, now_s: float) -> None:
        """Begin as after power-on."""

    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """What a packet does, and what is heard of the answers; nothing while the board is deaf."""
        if self._deaf:
            return []
        answers = [self._spoilt(channel, data) for channel, data in self.answer(packet, now_s)]
        return [answer for answer in answers if answer is not None]

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        """Cut the board off, or its supply."""
        super().fault_changed(fault, begins, now_s)
        if fault.kind == "mute" or (fault.kind == "volts" and fault.value < BROWN_OUT_V):
            (self._deaf.append if begins else self._deaf.remove)(fault)
            if fault.kind == "volts" and begins:
                self.reset(now_s)

    def _spoilt(self, channel: int, data: bytes) -> Reply | None:
        late_s, spoilt = 0.0, data
        for spoiler in self.faults.spoilers:
            if not spoiler.strikes(channel):
                continue
            late_s += spoiler.late_s
            if spoiler.fault.kind == "short":
                spoilt = spoilt[: spoiler.fault.value]
                continue
            result = spoiler.part(spoilt)
            if result is None:
                return None
            spoilt = result
        return Reply(spoilt, None, late_s)
