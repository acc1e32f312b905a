"""What a bus knows of its servos: read in groups every cycle, slow values in turn, silent servos left out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from drivers.bus import BusReport, BusState, frozen
from drivers.dynamixel.layout import Block, Layout, Scale, Ticks, layout_of
from drivers.dynamixel.packet import ALERT
from drivers.dynamixel.registers import Registers
from drivers.dynamixel.sdk import Exchange

log = logging.getLogger(__name__)

PROBE_S = 1.0
"""How often one silent servo is asked whether it is back."""
FAILED_PINGS = 3
"""Pings without an answer that one cycle may wait for."""
TRIPPED = 0xFF


class Group:
    """Servos that share one transaction because their registers lie at the same addresses.

    Parameters
    ----------
    ids : k servo ids.
    index : (k,) their places in the bus's arrays.
    layouts : their layouts.
    fast : use fast sync read.
    """

    def __init__(self, ids: Sequence[int], index: Sequence[int], layouts: Sequence[Layout], fast: bool) -> None:
        self.ids = tuple(ids)
        self.index = np.array(index)
        self.place = dict(zip(ids, index, strict=True))
        self.layout = layouts[0]
        self.fast = fast
        names = self.layout.scales
        self.scales = {name: np.array([layout.scales[name] for layout in layouts]) for name in names}
        self._slot = {servo: slot for slot, servo in enumerate(self.ids)}
        size = self.layout.goal.size
        self._rows = np.zeros(len(self.ids), dtype=[("id", "u1"), ("goal", f"<i{size}")])
        self._rows["id"] = self.ids

    def rows(self, ticks: Ticks) -> bytes:
        """Goals as the rows of a sync write. ``(n,)`` steps of the whole bus."""
        self._rows["goal"] = ticks[self.index]
        return self._rows.tobytes()

    def slots(self, ids: Sequence[int]) -> slice | list[int]:
        """Places of ids within the group; all of it as a slice, which is cheaper."""
        return slice(None) if tuple(ids) == self.ids else [self._slot[servo] for servo in ids]


class Telemetry:
    """Reads the servos of a bus and remembers what they said.

    Parameters
    ----------
    registers : the wire and the control tables.
    ids : n servo ids in the order of all arrays.
    report : counters to add to.
    feedback, fast, slow_group : see :class:`~drivers.dynamixel.bus.DynamixelBus`.
    """

    def __init__(
        self,
        registers: Registers,
        ids: Sequence[int],
        report: BusReport,
        feedback: str = "full",
        fast: bool = False,
        slow_group: int = 4,
    ) -> None:
        self._registers, self._packets, self._port = registers, registers.packets, registers.port
        self.ids = tuple(ids)
        self.report = report
        self._options = (feedback, fast, max(slow_group, 0))
        n = len(self.ids)
        self._ticks, self._speed, self._current = (np.full(n, np.nan) for _ in range(3))
        self._volts, self._celsius = np.full(n, np.nan), np.full(n, np.nan)
        self._seen_s = np.full(n, -np.inf)
        self._fresh, self._torque = np.zeros(n, bool), np.zeros(n, bool)
        self._error, self._hardware = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        self._place = {servo: index for index, servo in enumerate(self.ids)}
        self._missed: set[int] = set()
        self._silent: deque[int] = deque()
        self._probe_s = -np.inf
        self._tripped: set[int] = set()
        self.rebuild()

    def rebuild(self) -> None:
        """Group the servos anew after their tables were loaded; nobody is silent yet."""
        feedback, fast, _ = self._options
        members: dict[tuple[object, ...], list[int]] = {}
        layouts = [layout_of(self._registers.tables[servo], feedback) for servo in self.ids]
        for index, layout in enumerate(layouts):
            members.setdefault(layout.key, []).append(index)
        self._groups = [
            Group(
                [self.ids[i] for i in places],
                places,
                [layouts[i] for i in places],
                fast and all(self._registers.tables[self.ids[i]].fast_read for i in places),
            )
            for places in members.values()
        ]
        self._ticks[:] = np.nan  # the servos may have been moved since
        self._seen_s[:] = -np.inf
        self._missed.clear()
        self._silent.clear()
        self._tripped.clear()
        self._urgent: deque[tuple[Group, Block, tuple[int, ...]]] = deque()
        self._turns = self._rota()

    def started(self, ids: Sequence[int]) -> None:
        """Torque of these servos was read back as on."""
        self._torque[[self._place[servo] for servo in ids]] = True

    def silent_ids(self) -> tuple[int, ...]:
        """Servos that are only probed now and then."""
        return tuple(sorted(self._silent))

    def take_tripped(self) -> list[int]:
        """Servos whose watchdog was found tripped since the last call."""
        found, self._tripped = sorted(self._tripped), set()
        return found

    def retry_tripped(self, servo: int) -> None:
        """Hand a servo out once more at the next :meth:`take_tripped`."""
        self._tripped.add(servo)

    def send_goals(self, ticks: Ticks) -> None:
        """One sync write per group. ``(n,)`` steps."""
        for group in self._groups:
            goal = group.layout.goal
            self._packets.write_group(self._port, goal.address, goal.size, group.rows(ticks))

    def cycle(self, clock: Callable[[], float], running: bool) -> None:
        """Bring back who can be brought back, read everybody, and ask some for one slow value."""
        self._fresh[:] = False
        if self._port.suspects:
            self._revive(clock())
        for group in self._groups:
            self._read(group, clock)
        turn = self._urgent.popleft() if self._urgent else next(self._turns, None)
        if turn is not None:
            self._slow(*turn, running)

    def ask_watchdogs(self) -> None:
        """Look at every servo's watchdog now."""
        for group in self._groups:
            for block in group.layout.slow:
                if "watchdog" in block.items:
                    self._slow(group, block, group.ids, True)

    def state(self, scale: Scale, now: float) -> BusState:
        """Everything known, in SI units."""
        silent = np.isin(self.ids, list(self._silent)) if self._silent else np.zeros(len(self.ids), bool)
        return BusState(
            time_s=now,
            position_rad=frozen(scale.radians(self._ticks)),
            velocity_rad_s=frozen(scale.sign * self._speed),
            current_a=frozen(scale.sign * self._current),
            fresh=frozen(self._fresh, bool),
            age_s=frozen(now - self._seen_s),
            error=frozen(self._error, np.uint8),
            silent=frozen(silent, bool),
            voltage_v=frozen(self._volts),
            temperature_c=frozen(self._celsius),
            hardware_error=frozen(self._hardware, np.uint8),
            torque=frozen(self._torque, bool),
        )

    # ------------------------------------------------------------------ who answers

    def _revive(self, now: float) -> None:
        """Ping who missed its time: at once the first time, then one silent servo a second."""
        suspects, failed = self._port.suspects, 0
        for servo in [i for i in self.ids if i in suspects and i not in self._silent]:
            if self._packets.revive(self._port, servo):
                self._missed.discard(servo)
                continue
            self._silent.append(servo)
            log.warning("servo %s stopped answering", self._registers.label(servo))
            failed += 1
            if failed == FAILED_PINGS:
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
            self._look_at(servo)  # it may have lost its supply, and its torque with it
            log.warning("servo %s answers again", self._registers.label(servo))

    def _note_missing(self, got: Exchange) -> None:
        for servo in got.missing:
            if servo not in self._missed:
                self._missed.add(servo)
                self.report.count("corrupt" if got.corrupt else "no_reply", servo)

    def _look_at(self, servo: int) -> None:
        """Ask one servo for its error and torque next, before the turn of the others."""
        for group in self._groups:
            if servo in group.place:
                wanted = [b for b in group.layout.slow if {"hardware", "torque", "watchdog"} & set(b.items)]
                self._urgent.extend((group, block, (servo,)) for block in wanted)

    # ------------------------------------------------------------------ what they say

    def _read(self, group: Group, clock: Callable[[], float]) -> None:
        block = group.layout.feedback
        got = self._packets.read_group(self._port, group.ids, block.address, block.size, fast=group.fast)
        ids, data, errors = self._good(got, block)
        if got.missing:
            self._note_missing(got)
        if not ids:
            self._no_fast_reply(group, got)
            return
        slots = group.slots(ids)
        where, raw = group.index[slots], block.decode(data)
        self._ticks[where] = raw["position"]
        if "velocity" in block.items:
            self._speed[where] = group.layout.speeds(raw["velocity"]) * group.scales["velocity"][slots]
        if "current" in block.items:
            self._current[where] = raw["current"] * group.scales["current"][slots]
        self._fresh[where] = True
        self._seen_s[where] = clock()
        self._note_errors(ids, where, np.array(errors, np.uint8))

    def _good(self, got: Exchange, block: Block) -> tuple[list[int], list[bytes], list[int]]:
        """Ids, data and error bytes of the replies that carry data; the others are counted as refusals."""
        ids, data, errors = [], [], []
        for servo, reply in got.replies.items():
            if len(reply.params) == block.size:
                ids.append(servo)
                data.append(reply.params)
                errors.append(reply.error)
            else:
                self.report.count("refused", servo)
        return ids, data, errors

    def _no_fast_reply(self, group: Group, got: Exchange) -> None:
        if group.fast and not got.replies and set(got.missing) >= set(group.ids):
            group.fast = False
            log.warning("nobody answers fast sync reads; using plain ones")

    def _note_errors(self, ids: Sequence[int], where: np.ndarray, errors: np.ndarray) -> None:
        rising = errors & ~self._error[where] & ALERT
        self._error[where] = errors
        if rising.any():
            for servo in [servo for servo, new in zip(ids, rising, strict=True) if new]:
                self.report.count("alert", servo)
                log.warning("servo %s reports a hardware error", self._registers.label(servo))
                self._look_at(servo)

    def _rota(self) -> Iterator[tuple[Group, Block, tuple[int, ...]]]:
        """Slow values in turn, some servos at a time, for ever; none where the size is 0."""
        size = self._options[2]
        turns = (
            []
            if not size
            else [
                (group, block, group.ids[at : at + size])
                for group in self._groups
                for block in group.layout.slow
                for at in range(0, len(group.ids), size)
            ]
        )
        while turns:
            yield from turns

    def _slow(self, group: Group, block: Block, ids: Sequence[int], running: bool) -> None:
        got = self._packets.read_group(self._port, ids, block.address, block.size)
        if got.missing:
            self._note_missing(got)
        good, data, errors = self._good(got, block)
        if not good:
            return
        where, raw = np.array([group.place[servo] for servo in good]), block.decode(data)
        self._note_errors(good, where, np.array(errors, np.uint8))
        for name, store in (("hardware", self._hardware), ("voltage", self._volts), ("temperature", self._celsius)):
            if name in block.items:
                scale = group.scales.get(name)
                store[where] = raw[name] if scale is None else raw[name] * scale[group.slots(good)]
        if "torque" in block.items:
            self._note_torque(good, where, raw["torque"] != 0, running)
        if "watchdog" in block.items and running:
            self._note_watchdogs([servo for servo, v in zip(good, raw["watchdog"], strict=True) if v == TRIPPED])

    def _note_torque(self, ids: Sequence[int], where: np.ndarray, now_on: np.ndarray, running: bool) -> None:
        let_go = self._torque[where] & ~now_on
        self._torque[where] = now_on
        if not running:
            return
        for servo in [servo for servo, gone in zip(ids, let_go, strict=True) if gone]:
            self.report.count("torque_lost", servo)
            log.warning("servo %s let go: its torque is off", self._registers.label(servo))

    def _note_watchdogs(self, ids: Sequence[int]) -> None:
        for servo in ids:
            if servo not in self._tripped:
                self.report.count("watchdog", servo)
                log.warning("watchdog of servo %s tripped", self._registers.label(servo))
        self._tripped.update(ids)
