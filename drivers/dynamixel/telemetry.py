"""Telemetry of servos with Protocol 2.0: group reads, slow values in turn, watchdogs, indirect addresses."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from drivers.base.bus import BusReport, BusState, Flags
from drivers.core.scale import Scale, Ticks
from drivers.dynamixel.compiled_read import CompiledRead
from drivers.dynamixel.frames import GoalFrame, Run
from drivers.dynamixel.layout import layout_of
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Got, Packets, group_read
from drivers.servos import telemetry
from drivers.servos.exchange import Exchange
from drivers.servos.layout import Block, Group, ReadRequest, block_of
from drivers.servos.telemetry import Octets, Values
from drivers.tables.tables import TRIPPED

log = logging.getLogger(__name__)

MAX_FAST_FAILURES = 2
"""After so many fast reads in a row that no servo answered, plain reads are used."""
TRIPPED_VALUES = (TRIPPED, -1)
"""Values of the register Bus Watchdog after it has tripped, for registers of one byte and of two."""
FAST_RETRY_S, MAX_FAST_RETRY_S = 5.0, 320.0
"""First and longest time until fast reads are tried again; it doubles after each try that failed."""


class Telemetry(telemetry.Telemetry):
    """Reads the servos of a bus and stores what they measured, as :class:`~drivers.dynamixel.bus.DynamixelBus` says.

    tripped : ids of servos whose watchdog was found tripped, until the bus has cleared it.
    unmapped : ids of servos that lost their indirect addresses, as in a reboot, until the bus restores them.
    """

    slow_s = 0.5
    checked_first = frozenset({"hardware", "torque", "watchdog"})

    _packets: Packets

    def __init__(
        self, registers: Registers, ids: Sequence[int], report: BusReport, feedback: str, fast: bool, slow_group: int
    ) -> None:
        super().__init__(registers, ids, report, slow_group)
        self._feedback, self._allow_fast = feedback, fast
        self._goals: list[GoalFrame] = []
        self.tripped: set[int] = set()
        self.unmapped: set[int] = set()

    def rebuild(self, indirect: Mapping[int, Block]) -> None:
        """Group the servos by their control tables, and forget their positions.

        `indirect` holds, by servo id, the block that is read through indirect addresses.
        """
        tables = self._registers.tables
        self._regroup([layout_of(tables[servo], self._feedback, indirect.get(servo)) for servo in self.ids])
        self._driven: Flags | None = None
        self._feedbacks = [ReadRequest(group, group.layout.feedback, group.ids) for group in self._groups]
        self._fast = self._allow_fast and all(table.fast_read for table in tables.values())
        self._fast_failures = 0
        self._next_fast_s, self._fast_retry_s = math.inf, FAST_RETRY_S
        self._compiled: CompiledRead | None = None
        self.unmapped.clear()

    def send_goals(self, ticks: Ticks, driven: Flags) -> None:
        """Send goals, ``(n,)`` steps, to the servos that are ``driven`` (n,): a sync write per group, sent together."""
        if driven is not self._driven:
            self._driven = driven
            self._goals = [_goal_frame(group, driven) for group in self._groups if driven[group.index].any()]
        if self._goals:
            self._packets.send_only(self._port, b"".join([goals.encode(ticks) for goals in self._goals]))

    def read_watchdogs(self, clock: Callable[[], float]) -> None:
        """Read every servo's watchdog now."""
        tables = self._registers.tables
        blocks = [(group, block_of(tables[group.ids[0]], "watchdog")) for group in self._groups]
        self._read_requests(
            [ReadRequest(group, block, group.ids) for group, block in blocks if block.items], clock, True
        )

    # ------------------------------------------------------------------ reading

    def _read_feedback(self, clock: Callable[[], float], running: bool, scale: Scale) -> BusState | None:
        if clock() >= self._next_fast_s:
            self._try_fast_again()
        compiled = None if self._port.suspects else self._compiled_read(scale)
        self._read_requests(self._feedbacks, clock, running, self._fast, compiled)
        return None if compiled is None else compiled.state

    def _compiled_read(self, scale: Scale) -> CompiledRead | None:
        """Return the prepared read of the feedback of all servos, built again after a change."""
        compiled = self._compiled
        if compiled is None or compiled.axes is not scale.axes or compiled.read.fast != self._fast:
            read = group_read(_runs(self._feedbacks), self._fast)
            compiled = CompiledRead(self._feedbacks, read, self._octets, self._known, scale.axes, self._slow_values)
            self._compiled = compiled
        return compiled

    def _read_requests(
        self,
        requests: list[ReadRequest],
        clock: Callable[[], float],
        running: bool,
        fast: bool = False,
        compiled: CompiledRead | None = None,
    ) -> None:
        """Send all requests as one transaction, a sync or bulk read, and store the replies.

        `compiled` is the same read, prepared for all servos; it decodes and stores the replies if they are as expected.
        """
        suspects = self._port.suspects
        asked = [request.without(suspects) for request in requests] if suspects else requests
        asked = [request for request in asked if request.ids]
        got: Got = Exchange({}, (), False)
        if asked:
            read = compiled.read if compiled else group_read(_runs(asked), fast)
            got = self._packets.read_prepared(self._port, read, compiled)
        if fast:
            self._count_fast_failures(got, clock())
        if compiled is None or compiled.state is None:
            self._accept(requests, got, clock(), running)

    def _count_fast_failures(self, got: Got, now: float) -> None:
        """Count fast reads without an answer; after too many, use plain reads for a while if servos answer those."""
        if not got.joint_lost:
            self._fast_failures, self._fast_retry_s = 0, FAST_RETRY_S
            return
        self._fast_failures = self._fast_failures + 1 if got.replies else 0
        if self._fast_failures >= MAX_FAST_FAILURES:
            self._fast, self._next_fast_s = False, now + self._fast_retry_s
            self._log("no servo answers fast reads; using plain ones, and fast ones again in %g s", self._fast_retry_s)
            self._fast_retry_s = min(2.0 * self._fast_retry_s, MAX_FAST_RETRY_S)

    def _try_fast_again(self) -> None:
        """Use fast reads again; one without an answer returns to plain reads."""
        self._fast, self._next_fast_s = True, math.inf
        self._fast_failures = MAX_FAST_FAILURES - 1

    # ------------------------------------------------------------------ replies

    def _store(self, request: ReadRequest, values: Values, errors: Octets, now: float, running: bool) -> None:
        if request.group.layout.indirect and "position" in values:
            mapped = self._still_mapped(request.ids, values)
            if not mapped.all():
                request = request._replace(ids=tuple(np.array(request.ids)[mapped].tolist()))
                values, errors = {name: value[mapped] for name, value in values.items()}, errors[mapped]
        super()._store(request, values, errors, now, running)
        if "watchdog" in values and running:
            found = zip(request.ids, values["watchdog"], strict=True)
            for servo in [servo for servo, value in found if value in TRIPPED_VALUES]:
                if servo not in self.tripped:
                    self.tripped.add(servo)
                    self.report.count("watchdog", servo)
                    self._log("watchdog of servo %s tripped", self._registers.label(servo))

    def _still_mapped(self, ids: Sequence[int], values: Values) -> Flags:
        """Flags of the servos that still have their indirect addresses: without them every register reads 0."""
        vital = [values[name] for name in ("temperature", "hardware", "torque", "watchdog") if name in values]
        mapped: Flags = np.any(vital, axis=0)
        for servo in [servo for servo, has in zip(ids, mapped, strict=True) if not has]:
            if servo not in self.unmapped:
                self.unmapped.add(servo)
                self.report.count("reset", servo)
                self._log("servo %s was rebooted or without power", self._registers.label(servo))
        return mapped


def _goal_frame(group: Group, driven: Flags) -> GoalFrame:
    """Prepare the sync write of goals to the driven servos of a group."""
    chosen, goal = driven[group.index], group.layout.goal
    ids = np.array(group.ids)[chosen].tolist()
    return GoalFrame(ids, goal.address, goal.size, group.index[chosen])


def _runs(requests: Iterable[ReadRequest]) -> tuple[Run, ...]:
    return tuple([Run(ids, block.address, block.size) for _, block, ids in requests])
