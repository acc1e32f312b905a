"""Base class of simulated servo boards: answers on one port, their faults, and a supply that may drop."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Line
from drivers.sim.wire.timing import Reply

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
        """The state after power-on."""

    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """Do a packet, unless the board is deaf; returns the replies that arrive."""
        if self._deaf:
            return []
        replies = []
        for channel, data in self.answer(packet, now_s):
            arrived, late_s = self.faults.corrupt(data, channel)
            if arrived is not None:
                replies.append(Reply(arrived, None, late_s))
        return replies

    def fault_changed(self, fault: Fault, begins: bool, now_s: float) -> None:
        super().fault_changed(fault, begins, now_s)
        if fault.kind == "mute" or (fault.kind == "volts" and fault.value < BROWN_OUT_V):
            (self._deaf.append if begins else self._deaf.remove)(fault)
            if fault.kind == "volts" and begins:
                self.reset(now_s)
