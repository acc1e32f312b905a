"""What a bus with Protocol 1.0 framing knows of its servos: read in groups or in turn, silent ones left out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport
from drivers.core.scale import Ticks
from drivers.packets.packet import ALERT
from drivers.packets.packet1 import Packet1
from drivers.protocol1.layout import Group, layout_of, values_of
from drivers.protocol1.registers import Registers
from drivers.servos import telemetry
from drivers.servos.layout import Block

Turn = tuple[Group, Block, tuple[int, ...]]


class Telemetry(telemetry.Telemetry):
    """Reads the servos of a bus and remembers what they said.

    Parameters
    ----------
    registers, ids, report : see :class:`~drivers.servos.telemetry.Telemetry`.
    feedback, singles, slow_group : see :class:`~drivers.protocol1.bus.Protocol1Bus`.

    Attributes
    ----------
    load : (n,) share of the stall torque, positive where it pushes towards greater angles; NaN before the first.
    moving : (n,) the servo said that it moves.
    """

    _registers: Registers

    def __init__(
        self, registers: Registers, ids: Sequence[int], report: BusReport, feedback: str, singles: int, slow_group: int
    ) -> None:
        super().__init__(registers, ids, report)
        self._options = (feedback, max(singles, 1), max(slow_group, 0))
        self.load = np.full(len(self.ids), np.nan)
        self.moving = np.zeros(len(self.ids), bool)

    def rebuild(self, speeds: Mapping[int, int]) -> None:
        """Group the servos anew after their tables were loaded; nobody is silent yet.

        Parameters
        ----------
        speeds : by id, steps of the speed register that goals are approached with.
        """
        tables = self._registers.tables
        members: dict[tuple[object, ...], list[int]] = {}
        for servo in self.ids:
            members.setdefault(layout_of(tables[servo], self._options[0]).key, []).append(servo)
        self._groups = [
            Group(
                ids,
                [self._place[servo] for servo in ids],
                [tables[servo] for servo in ids],
                layout_of(tables[ids[0]], self._options[0]),
                [speeds[servo] for servo in ids],
            )
            for ids in members.values()
        ]
        self._forget()
        self._urgent: deque[Turn] = deque()
        self._rota = self._turns()
        self._next = dict.fromkeys(range(len(self._groups)), 0)

    def send_goals(self, ticks: Ticks) -> None:
        """One sync write per group, ``(n,)`` steps. A servo that let go gets none: a goal could switch it on."""
        for group in self._groups:
            rows = group.rows(ticks, self._torque)
            if rows:
                goal = group.layout.goal
                self._packets.write_group(self._port, goal.address, goal.size, rows)

    def cycle(self, clock: Callable[[], float], running: bool) -> None:
        """Bring back who can be brought back, read everybody whose turn it is, and ask some for a slow value."""
        self._fresh[:] = False
        if self._port.suspects or self._silent:
            self._revive(clock())
        for number, group in enumerate(self._groups):
            self._read(group, self._chosen(number, group), clock)
        turn = self._urgent.popleft() if self._urgent else next(self._rota, None)
        if turn is not None:
            self._ask(*turn, running)

    # ------------------------------------------------------------------ whose turn it is

    def _chosen(self, number: int, group: Group) -> Sequence[int]:
        """Who is read this cycle: all of a group that answers together, else the next few that are not silent."""
        if group.layout.manner:
            return group.ids
        ids, count = group.ids, self._options[1]
        first = self._next[number]
        turn = [servo for servo in ids[first:] + ids[:first] if servo not in self._port.suspects][:count]
        if turn:
            self._next[number] = (ids.index(turn[-1]) + 1) % len(ids)
        return turn

    def _look_at(self, servo: int) -> None:
        """Ask a servo whether it holds next, before the turn of the others."""
        group = next(group for group in self._groups if servo in group.place)
        self._urgent.append((group, group.layout.slow[0], (servo,)))

    # ------------------------------------------------------------------ what they say

    def _read(self, group: Group, ids: Sequence[int], clock: Callable[[], float]) -> None:
        good = self._ask(group, group.layout.feedback, ids)
        if good:
            where = [group.place[servo] for servo in good]
            self._fresh[where] = True
            self._seen_s[where] = clock()

    def _ask(self, group: Group, block: Block, ids: Sequence[int], running: bool = False) -> list[int]:
        """Read a block and take its values over; returns who answered."""
        if not ids:
            return []
        got = self._packets.read_group(self._port, ids, block.address, block.size, group.layout.manner)
        if got.missing:
            self._note_missing(got.missing, got.corrupt)
        replies = {servo: reply for servo, reply in got.replies.items() if len(reply.params) == block.size}
        for servo in got.replies.keys() - replies.keys():
            self.report.count("refused", servo)
        good = list(replies)
        if good:
            where = np.array([group.place[servo] for servo in good])
            self._note_flags(replies, where)
            values = values_of(block, [reply.params for reply in replies.values()])
            self._take(group, good, where, values)
            if "torque" in values:
                on = values["torque"] == 1
                if "torque_limit" in values:  # a servo that shut down has 0 there
                    on &= values["torque_limit"] != 0
                self._note_torque(good, where, on, running)
        return good

    def _take(
        self, group: Group, ids: Sequence[int], where: NDArray[np.intp], values: Mapping[str, NDArray[np.int64]]
    ) -> None:
        stores = {
            "velocity": self._speed,
            "current": self._current,
            "load": self.load,
            "voltage": self._volts,
            "temperature": self._celsius,
        }
        for name, store in stores.items():
            if name in values:
                store[where] = group.si(name, ids, values[name])
        if "position" in values:
            self._ticks[where] = values["position"]
        if "hardware" in values:
            self._hardware[where] = values["hardware"]
        if "moving" in values:
            self.moving[where] = values["moving"] != 0

    def _note_flags(self, replies: Mapping[int, Packet1], where: NDArray[np.intp]) -> None:
        """Error flags of replies: those about the servo's state raise an alert."""
        causes = [self._registers.causes(servo, reply.code) for servo, reply in replies.items()]
        errors = np.where(causes, ALERT, 0).astype(np.uint8)
        self._hardware[where] = causes
        self._note_errors(list(replies), where, errors)

    def _turns(self) -> Iterator[Turn]:
        """Slow values in turn, some servos at a time (one where they are asked one by one), for ever."""
        size = self._options[2]
        turns = [
            (group, block, group.ids[at : at + step])
            for group in self._groups
            for step in (size if group.layout.manner else min(size, 1),)
            if step
            for block in group.layout.slow
            for at in range(0, len(group.ids), step)
        ]
        while turns:
            yield from turns
