"""Base of simulated boards for hobby servos: answers and their faults, brown-out, and outputs with a pulse width."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from drivers.sim.servos.motion import hold, plan_move, plan_timed
from drivers.sim.wire.faults import Fault
from drivers.sim.wire.line import Line
from drivers.sim.wire.timing import Reply

FAULTS = ("echo", "slow-reader", "unplug", "mute", "silent", "late", "drop", "flip", "noise", "short", "volts")
"""Faults of a board. Ids are channels; ``mute`` and ``volts`` are the board's, so write ``*``."""
NO_LIMIT = 1e9
BROWN_OUT_V = 4.0
"""Supply voltage below which a board stops; it restarts when the supply returns."""


class Board(Line):
    """A board with hobby servos on one port; ``faults`` are specs of :data:`FAULTS`.

    refused : messages that were not understood.
    """

    def __init__(self, now_s: float = 0.0, faults: Iterable[str | Fault] = (), seed: int = 0) -> None:
        super().__init__(seed, kinds=FAULTS)
        self.refused = 0
        self.reset(now_s)
        self._deaf: list[Fault] = []
        self.faults.add(faults, now_s)

    @abstractmethod
    def answer(self, packet: Any, now_s: float) -> list[tuple[int, bytes]]:
        """Carry out a packet; return the replies, each with the channel that it concerns (0: none)."""

    @abstractmethod
    def reset(self, now_s: float) -> None:
        """Set the state after power-on."""

    def carry_out(self, packet: Any, now_s: float) -> list[Reply]:
        """Execute a packet, unless the supply is too low; returns the replies that arrive."""
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


class RcChannel:
    """Pulse width of one output, in any unit, and its last ``target``, 0 for no pulses; the shaft is not known."""

    def __init__(self) -> None:
        self.target = 0.0
        self._trajectory = hold(0.0, 0.0)

    def position(self, now_s: float) -> float:
        """Pulse width at `now_s`; 0 = no pulses."""
        return self._trajectory.at(now_s).position if self.target else 0.0

    def moving(self, now_s: float) -> bool:
        """Whether the pulse has not reached its target."""
        return bool(self.target) and self._trajectory.moving(now_s)

    def describe(self, number: int, now_s: float, unit_us: float = 1.0) -> dict[str, Any]:
        """Channel number, pulse width and target in microseconds, for people and tools."""
        return {"id": number, "pulse_us": self.position(now_s) * unit_us, "target_us": self.target * unit_us}

    def go(self, target: float, now_s: float, speed: float = 0.0, acceleration: float = 0.0) -> None:
        """Move to a target (0 = stop the pulses).

        speed, acceleration : units/s and units/s²; 0 = no limit. A channel without pulses does not know where
            its servo is, so its first target is reached at once.
        """
        was_off, now = not self.target, self._trajectory.at(now_s)
        self.target = target
        distance = abs(target - now.position)
        if was_off or not target or not distance or not (speed or acceleration):
            self._trajectory = hold(now_s, target)
        elif acceleration:
            self._trajectory = plan_move(now_s, now, target, speed or NO_LIMIT, acceleration)
        else:
            self._trajectory = plan_timed(now_s, now, target, distance / speed)

    def go_in(self, target: float, now_s: float, seconds: float) -> None:
        """Move to a target so that it arrives after `seconds` (0 = immediately)."""
        now = self._trajectory.at(now_s)
        jump = not self.target or not target or seconds <= 0.0
        self.target = target
        self._trajectory = hold(now_s, target) if jump else plan_timed(now_s, now, target, seconds)
