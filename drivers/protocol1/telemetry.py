"""Telemetry of servos with Protocol 1.0 framing: read in groups, or a few per cycle where group reads do not exist."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, Flags
from drivers.core.scale import Scale, Ticks
from drivers.packets.packet import ALERT
from drivers.protocol1.registers import Registers
from drivers.servos import telemetry
from drivers.servos.layout import Group, Layout, ReadRequest, block_of, format_of, item_of
from drivers.servos.telemetry import Octets, Values
from drivers.tables.tables import ControlTable

FULL = ("position", "velocity", "load", "voltage", "temperature", "hardware", "moving", "current")


def layout_of(table: ControlTable, feedback: str = "full") -> Layout:
    """Layout of a control table; `feedback` ``"full"`` reads all measurements, ``"position"`` position and speed.

    The block of the goal contains time and speed too, where the model has these registers.
    """
    feetech = item_of(table, "hardware") is not None  # Dynamixel reports errors in the error byte
    full: tuple[str, ...] = FULL if feetech else FULL[:5]
    slow: list[tuple[str, ...]] = [("torque", "torque_limit")]
    if feedback != "full":
        slow.append(full[2:7])
        full = full[:2]
    blocks = tuple(block_of(table, *names) for names in slow)
    return Layout(block_of(table, "goal", "time", "speed"), block_of(table, *full), blocks, table.group_read)


class GoalRows:
    """Rows of the sync write that sends goals to a group; speeds : (k,) speed of each servo, in steps."""

    def __init__(self, group: Group, speeds: Sequence[int]) -> None:
        self.block, self._index = group.layout.goal, group.index
        fields = [("id", "u1"), *((name, format_of(item)) for name, item in self.block.items.items())]
        self._rows = np.zeros(len(group.ids), dtype=fields)
        self._rows["id"] = group.ids
        self._rows["speed"] = speeds

    def encode(self, ticks: Ticks, driven: Flags) -> bytes:
        """Rows of the driven servos of the group; ``ticks`` and ``driven`` are those of the whole bus, (n,) each."""
        self._rows["goal"] = ticks[self._index]
        chosen = driven[self._index]
        return (self._rows if chosen.all() else self._rows[chosen]).tobytes()


class Telemetry(telemetry.Telemetry):
    """Reads the servos of a bus and stores what they measured, as :class:`~drivers.protocol1.bus.Protocol1Bus` says.

    load : (n,) fraction of the stall torque, positive where it pushes to more steps; NaN before the first reading.
    moving : (n,) whether the servo reported that it moves.
    """

    _registers: Registers

    def __init__(
        self, registers: Registers, ids: Sequence[int], report: BusReport, feedback: str, singles: int, slow_group: int
    ) -> None:
        super().__init__(registers, ids, report, slow_group)
        self._feedback, self._singles = feedback, max(singles, 1)
        self.load = self._stores["load"] = np.full(len(self.ids), np.nan)
        self.moving = np.zeros(len(self.ids), bool)

    def rebuild(self, speeds: Mapping[int, int]) -> None:
        """Group the servos by their control tables, and forget their positions; `speeds` : steps, by servo id."""
        self._regroup([layout_of(self._registers.tables[servo], self._feedback) for servo in self.ids])
        self._goals = [GoalRows(group, [speeds[servo] for servo in group.ids]) for group in self._groups]
        self._next_single = dict.fromkeys(self._groups, 0)

    @property
    def turn(self) -> int:
        """Number of cycles in which the position of every servo is read once."""
        singles = [len(group.ids) for group in self._groups if not group.layout.manner]
        return -(-max(singles, default=1) // self._singles)

    def send_goals(self, ticks: Ticks, driven: Flags) -> None:
        """Send goals, ``(n,)`` steps, to the servos that are ``driven`` (n,): one sync write per group.

        Servos whose torque is off are sent none: a goal could switch their torque on.
        """
        for goals in self._goals:
            if rows := goals.encode(ticks, self._torque & driven):
                self._packets.write_group(self._port, goals.block.address, goals.block.size, rows)

    def _read_feedback(self, clock: Callable[[], float], running: bool, scale: Scale) -> BusState | None:
        requests = [ReadRequest(group, group.layout.feedback, self._chosen(group)) for group in self._groups]
        self._read_requests(requests, clock, running)
        return None

    def _chosen(self, group: Group) -> tuple[int, ...]:
        """Choose the servos to read in this cycle: the whole group where it is read together, else the next few."""
        if group.layout.manner:
            return group.ids
        first = self._next_single[group]
        in_turn = group.ids[first:] + group.ids[:first]
        chosen = tuple(servo for servo in in_turn if servo not in self._port.suspects)[: self._singles]
        if chosen:
            self._next_single[group] = (group.ids.index(chosen[-1]) + 1) % len(group.ids)
        return chosen

    def _read_requests(self, requests: list[ReadRequest], clock: Callable[[], float], running: bool) -> None:
        for request in requests:
            if request.ids:
                block, manner = request.block, request.group.layout.manner
                got = self._packets.read_group(self._port, request.ids, block.address, block.size, manner)
                self._accept([request], got, clock(), running)

    def _store(self, request: ReadRequest, values: Values, errors: Octets, now: float, running: bool) -> None:
        super()._store(request, values, errors, now, running)
        if "moving" in values:
            self.moving[request.group.index[request.group.slots(request.ids)]] = values["moving"] != 0

    def _note_errors(self, ids: Sequence[int], where: NDArray[np.intp], errors: Octets) -> None:
        """Store error flags that concern a servo's state as hardware errors; they raise an alert."""
        causes = [self._registers.causes(servo, flags) for servo, flags in zip(ids, errors.tolist(), strict=True)]
        self._hardware[where] = causes
        super()._note_errors(ids, where, np.where(causes, ALERT, 0).astype(np.uint8))
