"""Finds the end stops of one servo: it turns with little current until it stands still, twice on each side.

The current is limited by current-based position mode (Dynamixel with Goal Current) or by Torque Limit (Feetech STS).
However the search ends, the motor is switched off and every register that was changed gets its old value back.
"""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from drivers.base.bus import ServoSpec
from drivers.base.errors import BusError, DriverError, ServoFault, ServoRefused, WrongModel
from drivers.base.shutdown import stop_on_signals
from drivers.core.dead_man_switch import DeadManSwitch
from drivers.core.scale import Scale
from drivers.dynamixel.registers import Registers as Registers2
from drivers.dynamixel.sdk import Packets
from drivers.dynamixel.startup import MAX_OFFSET, REVERSE, TIME_PROFILE, TORQUE_BY_GOAL
from drivers.dynamixel.telemetry import TRIPPED_VALUES
from drivers.port.serialport import SerialPort
from drivers.protocol1.exchange import Exchanges
from drivers.protocol1.registers import Registers as Registers1
from drivers.servos.layout import item_of
from drivers.servos.port import Port
from drivers.servos.registers import Registers
from drivers.tables.tables import ControlTable, load_table, model_name
from drivers.tools.scan_protocol1 import identity

CURRENT_POSITION = 5
"""Value of Operating Mode: position control with the current limited by Goal Current."""
TORQUE = 0.15
"""Default fraction of the full current or torque that the search uses."""
FAST_RAD_S, SLOW_RAD_S = math.radians(20.0), math.radians(8.0)
"""Speed of the first and of the second approach."""
MAX_LEAD_RAD = math.radians(8.0)
"""Greatest distance of the goal ahead of the shaft."""
MIN_PUSH_RAD = math.radians(2.0)
"""Least distance of the goal ahead of a shaft that stands still for it to be at a stop."""
BACK_RAD = math.radians(4.0)
"""Distance that the shaft moves back between two approaches."""
STILL_S, MAX_STILL_RAD = 0.25, math.radians(0.2)
"""A shaft that moves by no more than this angle in this time stands still."""
MIN_PUSH_FRACTION = 0.5
"""Fraction of the current limit from which the motor counts as pushing."""
IDLE_S, IDLE_STEPS = 1.5, 10
"""A shaft that stands still without pushing, for longer than this and for more steps, does not follow its goal."""
PERIOD_S, WATCHDOG_STEPS = 0.02, 25
MAX_END_ERROR_RAD = math.radians(1.0)


class StillOn(ServoFault):
    """A servo could not be confirmed off."""


@dataclass(frozen=True)
class Found:
    """The result of a search; angles in rad, measured as the servo's specification says.

    low_rad, high_rad : angles where it stopped; None: there was no stop in the range of the search.
    spread_rad : greatest difference between two approaches of one stop.
    peak_current_a : the greatest current that was measured, A.
    offset_ticks : the servo's homing offset, which all angles include; 0 where the model has none.
    """

    low_rad: float | None
    high_rad: float | None
    spread_rad: float
    peak_current_a: float
    offset_ticks: int


def why_not(model: str) -> str:
    """Return why the stops of a model cannot be found; empty if they can. Raises DriverError for an unknown model."""
    table = load_table(model)
    if item_of(table, "current") is None:
        return f"{table.model} measures no current, so it cannot feel a stop"
    if not _has_current_mode(table) and item_of(table, "torque_limit") is None:
        return f"{table.model} has neither a position mode that limits its current nor a torque limit"
    return ""


def _has_current_mode(table: ControlTable) -> bool:
    mode = table.get("Operating Mode")
    return mode is not None and CURRENT_POSITION in (mode.values or ()) and item_of(table, "goal_current") is not None


def find_stops(
    port: str | SerialPort,
    baud: int,
    servo: ServoSpec,
    reach_rad: tuple[float, float],
    *,
    torque: float = TORQUE,
    progress: Callable[[str], object] = lambda text: None,
    margin_s: float | None = None,
) -> Found:
    """Find both stops of a servo whose motor is off, and switch it off again.

    port, baud : where it is connected. servo : its model, zero and direction; its limits are not used.
    reach_rad : lowest and highest angle of the search.
    torque : fraction of the full current that it uses, above 0 and at most 0.5.
    progress : called with a text for every step. margin_s : longest wait for a reply beyond its time on the wire.

    Raises ServoRefused: the model cannot, or the motor is on. ServoFault: a hardware error, or it does not follow.
    StillOn: it could not be confirmed off.
    NoReply, WrongModel, CorruptReply, PortError.
    """
    if reason := why_not(servo.model):
        raise ServoRefused(reason, hint="move it by hand: omote calibrate", servo_ids=(servo.id,))
    if not 0.0 < torque <= 0.5:
        raise ValueError(f"torque: above 0 and at most 0.5, got {torque:g}")
    registers = _registers(port, baud, servo, margin_s)
    registers.port.openPort()
    try:
        return _Search(registers, servo, torque, progress).run(*reach_rad)
    finally:
        registers.port.closePort()


def _registers(port: str | SerialPort, baud: int, servo: ServoSpec, margin_s: float | None) -> Registers[Any]:
    wire = Port(port, baud, margin_s)
    if load_table(servo.model).protocol == 2:
        return Registers2(Packets(), wire, (servo,))
    return Registers1(Exchanges(), wire, (servo,))


class _Search:
    """One search; see `find_stops`."""

    def __init__(
        self, registers: Registers[Any], servo: ServoSpec, torque: float, progress: Callable[[str], object]
    ) -> None:
        self._registers, self._servo, self._id = registers, servo, servo.id
        self._torque, self._progress = torque, progress
        self._port = registers.port
        self._peak = 0
        self._before: list[tuple[str, int]] = []
        table = load_table(servo.model)
        registers.tables[self._id] = self._table = self._identify(table)
        self._scale = Scale((servo,), (self._table,))
        self._by_current = _has_current_mode(self._table)
        self._shift = self._allowed = 0

    # ------------------------------------------------------------------ before and after

    def _identify(self, expected: ControlTable) -> ControlTable:
        """Identify the servo and return its control table; raises NoReply, or WrongModel for another model."""
        registers = self._registers
        reply = registers.hello(self._id)
        if isinstance(registers, Registers1):
            found = identity(registers, self._id) or (0, 0)
        else:
            found = reply.params[0] | reply.params[1] << 8, reply.params[2]
        if found[0] == expected.number:
            return load_table(expected.number, found[1] if expected.protocol == 2 else None)
        message = f"servo {registers.label(self._id)} is {model_name(found[0])}, configured is {self._servo.model}"
        raise registers.error(WrongModel, message, "correct the configuration, or the servo's id", self._id)

    def run(self, low_rad: float, high_rad: float) -> Found:
        """Check the servo, search both sides, switch the motor off and restore its registers."""
        registers = self._registers
        if registers.get(self._id, "torque"):
            message = f"servo {registers.label(self._id)} holds with torque"
            raise registers.error(ServoRefused, message, "stop what drives it, and support what it holds", self._id)
        self._check_health()
        offset = registers.get(self._id, "offset") if item_of(self._table, "offset") else 0
        with ExitStack() as stack:
            stack.enter_context(self._dead_man_switch())
            stack.enter_context(stop_on_signals(self._restore))
            self._limit(offset)
            ends = [self._clipped_steps(angle) for angle in (low_rad, high_rad)]
            start = self._position()
            registers.put(self._id, "goal", start)
            registers.put(self._id, "torque", 1)
            found = [self._side(side, end, start) for side, end in zip((-1, 1), sorted(ends), strict=True)]
        if item_of(self._table, "offset") and registers.get(self._id, "offset") != offset:
            message = f"servo {registers.label(self._id)} has another homing offset than before, which was {offset}"
            raise registers.error(ServoFault, message, f"write {offset} back", self._id)
        return self._result(found, offset)

    @contextmanager
    def _dead_man_switch(self) -> Iterator[None]:
        """In this context, a process switches off a servo without bus watchdog if this program is killed."""
        link = self._port.link
        device = isinstance(link, SerialPort) and not link.path.startswith("memory://") and os.name == "posix"
        if not device or item_of(self._table, "watchdog") is not None:
            yield
            return
        frames = self._registers.frames({self._id: 0}, "torque")
        switch = DeadManSwitch(link.path, self._port.baudrate, frames)
        try:
            yield
        finally:
            switch.dismiss()

    def _limit(self, offset: int) -> None:
        """Limit current and speed; `_restore` undoes every change of a register."""
        if self._by_current:
            mode = self._registers.get(self._id, "drive_mode")
            self._change("drive_mode", mode & ~(REVERSE | TIME_PROFILE | TORQUE_BY_GOAL))
            self._change("mode", CURRENT_POSITION)
            self._shift = offset if abs(offset) > MAX_OFFSET else 0  # has an effect in this mode, not in position mode
            full = self._registers.get(self._id, "current_limit")
            self._allowed = max(round(self._torque * full), 1)
            self._change("goal_current", self._allowed)
            self._change("speed_limit", self._steps("speed_limit", 2.0 * FAST_RAD_S))
            self._change("accel_limit", 0)
            self._arm()
            return
        full = item_of(self._table, "torque_limit").maximum or 1000  # type: ignore[union-attr]
        self._allowed = max(round(self._torque * full), 1)
        self._change("torque_limit", self._allowed)
        self._change("time", 0)
        self._change("speed", self._steps("speed", 2.0 * FAST_RAD_S))

    def _steps(self, name: str, speed_rad_s: float) -> int:
        item = item_of(self._table, name)
        return max(math.ceil(speed_rad_s / item.scale), 1) if item else 1

    def _change(self, name: str, value: int) -> None:
        present = self._registers.get(self._id, name)
        if present != value:
            self._before.append((name, present))
            self._registers.put(self._id, name, value)

    def _restore(self) -> None:
        """Disable torque, confirm it, and restore the changed registers in reverse order."""
        registers = self._registers
        for _ in range(6):
            with suppress(BusError):
                registers.put_unanswered(self._id, "torque", 0)
                if registers.get(self._id, "torque", tries=1) == 0:
                    break
        else:
            message = f"servo {registers.label(self._id)} is not confirmed off"
            raise registers.error(StillOn, message, "switch its power off", self._id)
        if item_of(self._table, "watchdog") is not None:
            registers.put(self._id, "watchdog", 0)
        for name, value in reversed(self._before):
            registers.put(self._id, name, value)
        self._before.clear()

    # ------------------------------------------------------------------ the search

    def _side(self, side: int, end: int, start: int) -> list[int] | None:
        """Return the two positions (steps) where the shaft stopped on one side (-1 or 1); None: it reached ``end``."""
        name = "lowest" if (side < 0) != self._servo.reverse else "highest"
        self._progress(f"{self._servo.name}: looking for the {name} stop")
        first = self._approach(side, end, FAST_RAD_S)
        if first is None:
            self._go(start)
            return None
        self._go(first - side * round(BACK_RAD / self._table.rad_per_tick))
        second = self._approach(side, end, SLOW_RAD_S)
        self._go(start)
        return None if second is None else [first, second]

    def _approach(self, side: int, end: int, speed_rad_s: float) -> int | None:
        """Move towards ``end`` until the shaft stands still while the motor pushes.

        Return the position there, in steps; None where ``end`` was reached first.
        """
        tick = self._table.rad_per_tick
        goal, seen, idle = float(self._position()), deque[tuple[float, int]](), list[float]()
        while True:
            position, push = self._step(round(goal))
            if side * (end - position) <= MAX_END_ERROR_RAD / tick and side * (end - goal) <= 0.0:
                return None
            now = self._port.clock()
            seen.append((now, position))
            while len(seen) > 2 and now - seen[1][0] > STILL_S:  # keep two at least, also where a step takes longer
                seen.popleft()
            lead, still = side * (goal - position), self._is_still(seen, now)
            if still and lead >= MIN_PUSH_RAD / tick and push >= MIN_PUSH_FRACTION * self._allowed:
                return position
            # On a busy machine the goal gets ahead of the shaft slowly; until it is far ahead, the servo need not push.
            is_far = lead >= 0.99 * min(MAX_LEAD_RAD / tick, side * (end - position))
            idle = [*idle, now] if still and is_far else []
            if len(idle) > IDLE_STEPS and now - idle[0] > IDLE_S:
                if not self._rearm():
                    raise self._stuck()
                idle.clear()
            ahead = min(side * (goal - position) + speed_rad_s * PERIOD_S / tick, MAX_LEAD_RAD / tick)
            goal = side * min(side * (position + side * ahead), side * end)

    def _is_still(self, seen: deque[tuple[float, int]], now: float) -> bool:
        """Whether the shaft has stood still for the last STILL_S; ``seen`` has (time in s, position in steps)."""
        ticks = [position for _, position in seen]
        long_enough = now - seen[0][0] > 0.7 * STILL_S
        return long_enough and (max(ticks) - min(ticks)) * self._table.rad_per_tick <= MAX_STILL_RAD

    def _rearm(self) -> bool:
        """Arm the bus watchdog again if it had tripped, as when the computer was busy; return whether it had."""
        if item_of(self._table, "watchdog") is None or self._registers.get(self._id, "watchdog") not in TRIPPED_VALUES:
            return False
        self._arm()
        return True

    def _arm(self) -> None:
        self._registers.put(self._id, "watchdog", 0)
        self._registers.put(self._id, "watchdog", WATCHDOG_STEPS)

    def _stuck(self) -> DriverError:
        label = self._registers.label(self._id)
        message = f"servo {label} does not move, and does not push either"
        hint = "give it more torque (--torque), or look for what blocks it"
        return self._registers.error(ServoFault, message, hint, self._id)

    def _go(self, target: int) -> None:
        """Move to a position (steps); stop waiting two seconds after the time that this should take."""
        tick = self._table.rad_per_tick
        goal = float(self._position())
        end_s = self._port.clock() + abs(target - goal) * tick / FAST_RAD_S + 2.0
        while self._port.clock() < end_s:
            goal += max(min(target - goal, FAST_RAD_S * PERIOD_S / tick), -FAST_RAD_S * PERIOD_S / tick)
            position, _ = self._step(round(goal))
            if abs(position - target) * tick < MAX_END_ERROR_RAD:
                return
        self._rearm()

    def _step(self, goal: int) -> tuple[int, int]:
        """Send a goal, wait for one period, and read position and current (or load), both in steps."""
        registers = self._registers
        registers.put_unanswered(self._id, "goal", goal)
        self._port.sleep(PERIOD_S)
        current = abs(registers.get(self._id, "current"))
        self._peak = max(self._peak, current)
        push = current if self._by_current else abs(registers.get(self._id, "load"))
        self._check_health()
        return self._position(), push

    def _check_health(self) -> None:
        registers = self._registers
        if not isinstance(registers, Registers1):
            bits = registers.hardware_error(self._id)
        else:
            registers.get(self._id, "torque")
            bits = registers.hardware_error(self._id)
        if bits:
            message = f"servo {registers.label(self._id)} reports hardware error 0x{bits:02X}"
            raise registers.error(ServoFault, message, "look at supply and temperature: omote scan", self._id)

    # ------------------------------------------------------------------ steps and angles

    def _position(self) -> int:
        return self._registers.get(self._id, "position")

    def _clipped_steps(self, angle_rad: float) -> int:
        """Convert an angle to steps, clipped to one turn and, where the mode obeys them, to the servo's own limits."""
        table, steps = self._table, self._scale.tick(0, angle_rad)
        steps = min(max(steps, table.first_step), table.first_step + table.ticks_per_turn - 1)
        if self._by_current:
            return steps + self._shift
        low, high = (self._registers.get(self._id, name) for name in ("min_ticks", "max_ticks"))
        return min(max(steps, low), high)

    def _angle(self, steps: float) -> float:
        axes = self._scale.axes[:, 0].tolist()
        sign, zero_rad, center, rad_per_tick = map(float, axes)
        return sign * ((steps - self._shift - center) * rad_per_tick - zero_rad)

    def _result(self, found: list[list[int] | None], offset: int) -> Found:
        angles = [None if both is None else self._angle(sum(both) / 2) for both in found]
        low, high = angles[::-1] if self._servo.reverse else angles
        spread = max((abs(both[0] - both[1]) for both in found if both), default=0) * self._table.rad_per_tick
        item = item_of(self._table, "current")
        return Found(low, high, spread, self._peak * (item.scale if item else 0.0), offset)
