"""What a bus with Protocol 1.0 framing knows of its servos: read in groups or in turn, silent ones left out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, frozen
from drivers.base.telling import Teller
from drivers.core.scale import Scale, Ticks
from drivers.packets.packet import ALERT
from drivers.packets.packet1 import Packet1
from drivers.protocol1.layout import Group, layout_of, values_of
from drivers.protocol1.registers import Registers
from drivers.servos.exchange import Exchange
from drivers.servos.layout import Block

log = logging.getLogger(__name__)

PROBE_S = 1.0
"""How often one silent servo is asked whether it is back."""
FAILED_HELLOS = 3
"""Greetings without an answer that one cycle may wait for."""
Turn = tuple[Group, Block, tuple[int, ...]]


class Telemetry:
    """Reads the servos of a bus and remembers what they said.

    Parameters
    ----------
    registers : the wire and the control tables.
    ids : n servo ids in the order of all arrays.
    report : counters to add to.
    feedback, singles, slow_group : see :class:`~drivers.protocol1.bus.Protocol1Bus`.

    Attributes
    ----------
    torque : (n,) the servo said that its motor is on.
    load : (n,) share of the stall torque, positive where it pushes towards greater angles; NaN before the first.
    moving : (n,) the servo said that it moves.
    """

    def __init__(
        self,
        registers: Registers,
        ids: Sequence[int],
        report: BusReport,
        feedback: str = "full",
        singles: int = 6,
        slow_group: int = 4,
    ) -> None:
        self._registers, self._packets, self._port = registers, registers.packets, registers.port
        self.ids, self.report = tuple(ids), report
        self._options = (feedback, max(singles, 1), max(slow_group, 0))
        n = len(self.ids)
        self._ticks, self._speed, self._current = (np.full(n, np.nan) for _ in range(3))
        self._volts, self._celsius, self.load = (np.full(n, np.nan) for _ in range(3))
        self._seen_s = np.full(n, -np.inf)
        self._fresh, self.torque, self.moving = (np.zeros(n, bool) for _ in range(3))
        self._error, self._hardware = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        self._place = {servo: index for index, servo in enumerate(self.ids)}
        self._missed: set[int] = set()
        self._say = Teller(log, self._port.link.clock)
        self._silent: deque[int] = deque()
        self._probe_s = -np.inf

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
        self._ticks[:] = np.nan  # the servos may have been moved since
        self._seen_s[:] = -np.inf
        self._missed.clear()
        self._silent.clear()
        self._urgent: deque[Turn] = deque()
        self._rota = self._turns()
        self._next = dict.fromkeys(range(len(self._groups)), 0)

    def started(self, ids: Sequence[int]) -> None:
        """Torque of these servos was read back as on."""
        self.torque[[self._place[servo] for servo in ids]] = True

    def silent_ids(self) -> tuple[int, ...]:
        """Servos that are only probed now and then."""
        return tuple(sorted(self._silent))

    def send_goals(self, ticks: Ticks) -> None:
        """One sync write per group, ``(n,)`` steps. A servo that let go gets none: a goal could switch it on."""
        for group in self._groups:
            rows = group.rows(ticks, self.torque)
            if rows:
                goal = group.layout.goal
                self._packets.write_group(self._port, goal.address, goal.size, rows)

    def cycle(self, clock: Callable[[], float], running: bool) -> None:
        """Bring back who can be brought back, read everybody whose turn it is, and ask some for a slow value."""
        self._fresh[:] = False
        if self._port.suspects:
            self._revive(clock())
        for number, group in enumerate(self._groups):
            self._read(group, self._chosen(number, group), clock)
        turn = self._urgent.popleft() if self._urgent else next(self._rota, None)
        if turn is not None:
            self._slow(*turn, running)

    def state(self, scale: Scale, now: float) -> BusState:
        """Everything known, in SI units."""
        return BusState(
            time_s=now,
            position_rad=frozen(scale.radians(self._ticks)),
            velocity_rad_s=frozen(scale.sign * self._speed),
            current_a=frozen(scale.sign * self._current),
            fresh=frozen(self._fresh, bool),
            age_s=frozen(now - self._seen_s),
            error=frozen(self._error, np.uint8),
            silent=frozen(np.isin(self.ids, list(self._silent)), bool),
            voltage_v=frozen(self._volts),
            temperature_c=frozen(self._celsius),
            hardware_error=frozen(self._hardware, np.uint8),
            torque=frozen(self.torque, bool),
        )

    # ------------------------------------------------------------------ who answers

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

    def _revive(self, now: float) -> None:
        """Greet who missed its time: at once the first time, then one silent servo a second."""
        suspects, failed = self._port.suspects, 0
        for servo in [i for i in self.ids if i in suspects and i not in self._silent]:
            if self._packets.revive(self._port, servo):
                self._missed.discard(servo)
                continue
            self._silent.append(servo)
            self._say("servo %s stopped answering", self._registers.label(servo))
            failed += 1
            if failed == FAILED_HELLOS:
                return
        if failed:
            self._probe_s = now + PROBE_S
        if self._silent and now >= self._probe_s:
            self._probe(now)

    def _probe(self, now: float) -> None:
        self._probe_s = now + PROBE_S
        while self._silent:
            servo = self._silent[0]
            if not self._packets.revive(self._port, servo):
                self._silent.rotate(-1)
                return
            self._silent.popleft()
            self._missed.discard(servo)
            self._look_at([servo])  # it may have lost its supply, and its torque with it
            self._say("servo %s answers again", self._registers.label(servo))

    def _note_missing(self, got: Exchange) -> None:
        for servo in got.missing:
            if servo not in self._missed:
                self._missed.add(servo)
                self.report.count("corrupt" if got.corrupt else "no_reply", servo)

    def _look_at(self, ids: Iterable[int]) -> None:
        """Ask servos whether they hold next, before the turn of the others."""
        for servo in ids:
            group = next(group for group in self._groups if servo in group.place)
            self._urgent.append((group, group.layout.slow[0], (servo,)))

    # ------------------------------------------------------------------ what they say

    def _read(self, group: Group, ids: Sequence[int], clock: Callable[[], float]) -> None:
        good = self._ask(group, group.layout.feedback, ids)
        if good:
            where = [group.place[servo] for servo in good]
            self._fresh[where] = True
            self._seen_s[where] = clock()

    def _slow(self, group: Group, block: Block, ids: Sequence[int], running: bool) -> None:
        before = self.torque.copy()
        self._ask(group, block, ids)
        if not running:
            return
        for index in np.flatnonzero(before & ~self.torque):
            servo = self.ids[index]
            self.report.count("torque_lost", servo)
            self._say("servo %s let go: its torque is off", self._registers.label(servo))

    def _ask(self, group: Group, block: Block, ids: Sequence[int]) -> list[int]:
        """Read a block and take its values over; returns who answered."""
        if not ids:
            return []
        got = self._packets.read_group(self._port, ids, block.address, block.size, group.layout.manner)
        if got.missing:
            self._note_missing(got)
        replies = {servo: reply for servo, reply in got.replies.items() if len(reply.params) == block.size}
        for servo in got.replies.keys() - replies.keys():
            self.report.count("refused", servo)
        good = list(replies)
        if good:
            where = np.array([group.place[servo] for servo in good])
            self._note_flags(replies, where)
            self._take(group, good, where, values_of(block, [reply.params for reply in replies.values()]))
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
        if "torque" in values:
            held = values["torque"] == 1
            self.torque[where] = held & (values["torque_limit"] != 0) if "torque_limit" in values else held

    def _note_flags(self, replies: Mapping[int, Packet1], where: NDArray[np.intp]) -> None:
        """Error flags of replies: those about the servo's state raise an alert."""
        causes = [self._registers.causes(servo, reply.code) for servo, reply in replies.items()]
        errors = np.where(causes, ALERT, 0).astype(np.uint8)
        new = errors & ~self._error[where] & ALERT
        self._error[where] = errors
        self._hardware[where] = causes
        if new.any():
            risen = [servo for servo, rises in zip(replies, new, strict=True) if rises]
            for servo in risen:
                self.report.count("alert", servo)
                self._say("servo %s reports a hardware error", self._registers.label(servo))
            self._look_at(risen)

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
