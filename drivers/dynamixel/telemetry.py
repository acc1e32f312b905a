"""What a bus knows of its servos: read in groups every cycle, slow values in turn, silent servos left out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, Flags
from drivers.core.scale import Scale, Ticks
from drivers.dynamixel.frames import Rows
from drivers.dynamixel.groups import Group, Question, turns_of
from drivers.dynamixel.layout import layout_of
from drivers.dynamixel.port import Port
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Got, Packets, group_read
from drivers.dynamixel.sweep import Sweep
from drivers.servos import telemetry
from drivers.servos.exchange import Exchange
from drivers.servos.layout import Block
from drivers.tables.tables import TRIPPED

log = logging.getLogger(__name__)

SLOW_S = 0.5
"""Every slow value of every servo is asked for within this time."""
JOINT_FAILURES = 2
"""Fast reads in a row that nobody answers before plain ones are used."""
_VITAL = ("temperature", "hardware", "torque", "watchdog")
_SLOW = frozenset({"hardware", "voltage", "temperature"})


class Telemetry(telemetry.Telemetry):
    """Reads the servos of a bus and remembers what they said.

    Parameters
    ----------
    registers, ids, report : see :class:`~drivers.servos.telemetry.Telemetry`.
    feedback, fast, slow_group : see :class:`~drivers.dynamixel.bus.DynamixelBus`.
    """

    _packets: Packets
    _port: Port

    def __init__(
        self,
        registers: Registers,
        ids: Sequence[int],
        report: BusReport,
        feedback: str = "full",
        fast: bool = True,
        slow_group: int = 4,
    ) -> None:
        super().__init__(registers, ids, report)
        self._feedback, self._may_be_fast, self._slow_group = feedback, fast, max(slow_group, 0)
        self._tripped: set[int] = set()
        self._forgetful: set[int] = set()
        self.rebuild()

    def rebuild(self, indirect: Mapping[int, Block] = {}) -> None:
        """Group the servos anew after their tables were loaded; nobody is silent yet.

        Parameters
        ----------
        indirect : by id, the block that is read through pointers that were set up.
        """
        tables = self._registers.tables
        layouts = [layout_of(tables[servo], self._feedback, indirect.get(servo)) for servo in self.ids]
        members: dict[tuple[object, ...], list[int]] = {}
        for index, layout in enumerate(layouts):
            members.setdefault(layout.key, []).append(index)
        self._groups = [
            Group(places, [self.ids[i] for i in places], [layouts[i] for i in places]) for places in members.values()
        ]
        self._feedbacks = [Question(group, group.layout.feedback, group.ids) for group in self._groups]
        self._fast = self._may_be_fast and all(table.fast_read for table in tables.values())
        self._joint_failures = 0
        self._sweep: Sweep | None = None
        self._forget()
        self._tripped.clear()
        self._forgetful.clear()
        self._urgent: deque[Question] = deque()
        self._turns = turns_of(self._groups, self._slow_group)
        self._turn, self._turn_s = 0, -np.inf

    def take_tripped(self) -> list[int]:
        """Servos whose watchdog was found tripped since the last call."""
        return _emptied(self._tripped) if self._tripped else []

    def retry_tripped(self, servo: int) -> None:
        """Hand a servo out once more at the next :meth:`take_tripped`."""
        self._tripped.add(servo)

    def take_forgetful(self) -> list[int]:
        """Servos that have lost their pointers since the last call: they have been rebooted, or were without power."""
        return _emptied(self._forgetful) if self._forgetful else []

    def send_goals(self, ticks: Ticks) -> None:
        """One sync write per group, all handed over at once. ``(n,)`` steps."""
        self._packets.tell(self._port, b"".join([group.goals.encode(ticks) for group in self._groups]))

    def cycle(self, clock: Callable[[], float], running: bool, scale: Scale) -> BusState:
        """Bring back who can be brought back, read everybody, and ask some for one slow value."""
        self._fresh[:] = False
        if self._port.suspects or self._silent:
            self._revive(clock())
        sweep = None if self._port.suspects else self._sweep_of(scale)
        self._ask(self._feedbacks, clock, running, self._fast, sweep)
        turn = self._urgent.popleft() if self._urgent else self._next_turn(clock())
        if turn is not None:
            self._ask([turn], clock, running)
        elif sweep is not None and sweep.state is not None:
            return sweep.state
        return self.state(scale, clock())

    def _sweep_of(self, scale: Scale) -> Sweep:
        """The usual read of everybody in one go."""
        sweep = self._sweep
        if sweep is None or sweep.axes is not scale.axes or sweep.read.fast != self._fast:
            read = group_read(tuple([question.run for question in self._feedbacks]), self._fast)
            sweep = self._sweep = Sweep(self._feedbacks, read, self._octets, self._known, scale.axes, self._told)
        return sweep

    def ask_watchdogs(self, clock: Callable[[], float]) -> None:
        """Look at every servo's watchdog now."""
        blocks = [(group, group.layout.watchdog) for group in self._groups]
        self._ask([Question(group, block, group.ids) for group, block in blocks if block], clock, True)

    # ------------------------------------------------------------------ whose turn it is

    def _look_at(self, servo: int) -> None:
        """Ask one servo for its error and torque next, before the turn of the others."""
        for group in self._groups:
            if servo in group.ids:
                wanted = [b for b in group.layout.slow if {"hardware", "torque", "watchdog"} & set(b.items)]
                self._urgent.extend(Question(group, block, (servo,)) for block in wanted)

    def _next_turn(self, now: float) -> Question | None:
        """Whose turn it is to be asked for a slow value; None while nobody's is."""
        if not self._turns or now < self._turn_s:
            return None
        turn = self._turns[self._turn % len(self._turns)]
        self._turn += 1
        if self._turn >= len(self._turns):  # the first round goes as quickly as it can
            self._turn_s = max(self._turn_s + SLOW_S / len(self._turns), now)
        return turn

    # ------------------------------------------------------------------ what they say

    def _ask(
        self,
        questions: list[Question],
        clock: Callable[[], float],
        running: bool,
        fast: bool = False,
        sweep: Sweep | None = None,
    ) -> None:
        """One transaction for all questions: a sync read, or a bulk read where there are several.

        `sweep` asks them too, and may take the replies.
        """
        suspects = self._port.suspects
        asked = [question.without(suspects) for question in questions] if suspects else questions
        asked = [question for question in asked if question.ids]
        got: list[Rows] | Got = Exchange({}, (), False)
        if asked:
            read = group_read(tuple([q.run for q in asked]), fast) if sweep is None else sweep.read
            got = self._packets.read_rows(self._port, read, sweep)
        if sweep is not None and sweep.state is not None:
            self._joint_failures = 0
            return
        now = clock()
        if isinstance(got, Exchange):
            self._note_missing([i for question in questions for i in question.ids if i in suspects], got.corrupt)
            self._note_joint(got, fast)
            asked, got = self._good(asked, got)
        else:
            self._joint_failures = 0
        for question, rows in zip(asked, got, strict=True):
            self._take(question, rows, now, running)

    def _good(self, asked: list[Question], got: Got) -> tuple[list[Question], list[Rows]]:
        """Replies that carry data, sorted as if only they had been asked for; the others count as refusals."""
        questions, rows = [], []
        for question in asked:
            replies = [got.replies[servo] for servo in question.ids if servo in got.replies]
            good = [reply for reply in replies if len(reply.params) == question.block.size]
            for reply in replies:
                if len(reply.params) != question.block.size:
                    self.report.count("refused", reply.id)
            if good:
                data = np.frombuffer(b"".join([reply.params for reply in good]), np.uint8).reshape(len(good), -1)
                questions.append(question._replace(ids=tuple(reply.id for reply in good)))
                rows.append(Rows(np.array([reply.error for reply in good], np.uint8), data))
        return questions, rows

    def _note_joint(self, got: Got, fast: bool) -> None:
        """Use plain reads when nobody answers fast ones, though they answer."""
        self._joint_failures = self._joint_failures + 1 if fast and got.joint_lost and got.replies else 0
        if self._joint_failures >= JOINT_FAILURES:
            self._fast = False
            log.warning("nobody answers fast sync reads; using plain ones")

    def _take(self, question: Question, rows: Rows, now: float, running: bool) -> None:
        group, block, ids = question
        raw, errors, names = block.decode(rows.data), rows.errors, block.items
        if group.layout.indirect and "position" in names:
            known = self._remembering(ids, names, raw)
            if not known.all():
                ids = tuple(servo for servo, has in zip(ids, known, strict=True) if has)
                raw, errors = raw[known], errors[known]
        slots = group.slots(ids)
        where = group.index[slots]
        if "position" in names:
            self._take_motion(group, slots, where, names, raw)
            self._fresh[where] = True
            self._seen_s[where] = now
        if errors.any() or self._alarmed:
            self._note_errors(ids, where, errors)
        if not _SLOW.isdisjoint(names):
            self._take_slow(group, slots, where, names, raw)
        if "torque" in names:
            self._note_torque(ids, where, raw["torque"] != 0, running)
        if "watchdog" in names and running:
            self._note_watchdogs(ids, raw["watchdog"] == TRIPPED)

    def _remembering(self, ids: Sequence[int], names: Collection[str], raw: NDArray[np.void]) -> Flags:
        """Who still has its pointers: without them all reads as 0, and a position of 0 must not be believed."""
        known: Flags = raw[_VITAL[0]] != 0
        for name in _VITAL[1:]:
            if name in names and not known.all():
                known |= raw[name] != 0
        if not known.all():
            for servo in [servo for servo, has in zip(ids, known, strict=True) if not has]:
                if servo not in self._forgetful:
                    self._forgetful.add(servo)
                    self.report.count("reset", servo)
                    self._say("servo %s was rebooted or without power", self._registers.label(servo))
        return known

    def _take_motion(
        self,
        group: Group,
        slots: slice | list[int],
        where: NDArray[np.intp],
        names: Collection[str],
        raw: NDArray[np.void],
    ) -> None:
        self._ticks[where] = raw["position"]
        if "velocity" in names:
            self._speed[where] = group.layout.speeds(raw["velocity"]) * group.scales["velocity"][slots]
        if "current" in names:
            self._current[where] = raw["current"] * group.scales["current"][slots]

    def _take_slow(
        self,
        group: Group,
        slots: slice | list[int],
        where: NDArray[np.intp],
        names: Collection[str],
        raw: NDArray[np.void],
    ) -> None:
        self._slow_state = None
        if "hardware" in names:
            self._hardware[where] = raw["hardware"]
        for name, store in (("voltage", self._volts), ("temperature", self._celsius)):
            if name in names:
                store[where] = raw[name] * group.scales[name][slots]

    def _note_watchdogs(self, ids: Sequence[int], tripped: Flags) -> None:
        if not tripped.any():
            return
        found = [servo for servo, has in zip(ids, tripped, strict=True) if has]
        for servo in found:
            if servo not in self._tripped:
                self.report.count("watchdog", servo)
                self._say("watchdog of servo %s tripped", self._registers.label(servo))
        self._tripped.update(found)


def _emptied(ids: set[int]) -> list[int]:
    found = sorted(ids)
    ids.clear()
    return found
