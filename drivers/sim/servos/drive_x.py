"""The motor control of X-series and MX(2.0) servos: modes, profiles and the block of sensed registers."""

from __future__ import annotations

import math
import struct

from drivers.sim.servos.drive import Drive
from drivers.sim.servos.motion import Motion, Profile, plan_move, plan_speed, plan_timed
from drivers.sim.servos.plant import Plant
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import ControlTable

CURRENT, VELOCITY, POSITION, EXTENDED, CURRENT_POSITION, PWM = 0, 1, 3, 4, 5, 16
"""Operating Mode (11)."""
REVERSE, TIME_PROFILE, GOAL_TORQUE = 0x01, 0x04, 0x08
"""Bits of Drive Mode (10)."""
MAX_POSITION_OFFSET = 1024
"""Homing Offset beyond this is ignored in position mode (e-Manual, Homing Offset)."""

POSITION_P = 128
"""Value of Position P Gain that gives one step of PWM per step of error (e-Manual, Position PID Gain)."""
FOLLOWING_TICKS = 10
"""Distance between commanded and real position from which on it is a following error."""

_MOTION = struct.Struct("<hii")
"""Present Current (or Load), Present Velocity and Present Position, side by side as well."""

_PROFILE = struct.Struct("<IIi")
"""Profile Acceleration, Profile Velocity and Goal Position, which lie side by side in every X-series table."""

_GOALS = {
    CURRENT: ("Goal Current",),
    VELOCITY: ("Goal Velocity",),
    POSITION: ("Goal Position",),
    EXTENDED: ("Goal Position",),
    CURRENT_POSITION: ("Goal Position", "Goal Current"),
    PWM: ("Goal PWM",),
}
"""Goal registers that move the motor, by Operating Mode."""

_CODES = {(1, False): "B", (1, True): "b", (2, False): "H", (2, True): "h", (4, False): "I", (4, True): "i"}
_SENSED = (
    "Realtime Tick",
    "Moving",
    "Moving Status",
    "Present PWM",
    "Present Current",
    "Present Load",
    "Present Velocity",
    "Present Position",
    "Velocity Trajectory",
    "Position Trajectory",
    "Present Input Voltage",
    "Present Temperature",
)


class XDrive(Drive):
    """Plans and senses for one X-series servo. See :class:`~drivers.sim.servos.drive.Drive`."""

    time_s = 1e-3
    """One step of the time of a time-based profile."""

    def __init__(self, registers: Registers, plant: Plant, now_s: float) -> None:
        super().__init__(registers, plant, now_s)
        table = registers.table
        acceleration = table["Profile Acceleration"]
        self.ticks_s2 = acceleration.scale / table.rad_per_tick
        limit = table.get("Current Limit")
        self.has_current = limit is not None
        self.full_current = _current_at_stall(table) if limit else 1000  # else Present Load, 0.1 %
        self.full_pwm = table["PWM Limit"].initial
        self._layout, self.first_sensed, self.last_sensed = _sensed_block(table)
        self._profile_at = acceleration.address
        self.motion_at = table["Present Velocity"].address - 2
        self.motion_end = self.motion_at + _MOTION.size
        temperature = table.get("Present Temperature")
        self._celsius_at = () if temperature is None else (temperature.address,)
        self.quick = frozenset((*range(self.motion_at, self.motion_end), *self._celsius_at))
        self.configure()

    def configure(self) -> None:
        registers = self.registers
        self.mode = registers.get("Operating Mode")
        self.goals = _GOALS[self.mode]
        reverse = registers.get("Drive Mode") & REVERSE
        center = registers.table.center  # X-series reverse 0 to 4095, P-series about 0
        self.side, self.mirror = (-1, max(2.0 * center - 1.0, 0.0)) if reverse else (1, 0.0)
        offset = registers.get("Homing Offset")
        ignored = self.mode == POSITION and abs(offset) > MAX_POSITION_OFFSET
        self.offset = 0 if ignored else offset
        limit = registers.get("Velocity Limit") * self.ticks_s
        self.top_speed = max(min(self.plant.top_speed, limit), 1e-3)
        self.timed = registers.table.time_profile and bool(registers.get("Drive Mode") & TIME_PROFILE)
        self.reach, self._own_limit = math.inf, 1.0
        if self.has_current:
            current = registers.get("Current Limit")
            self.reach, self._own_limit = self._reach(current), min(1.0, abs(current) / self.full_current)

    def torque_limit(self) -> float:
        """The lower of Current Limit and, in the mode that it limits, Goal Current."""
        if not self.has_current or self.mode != CURRENT_POSITION:
            return self._own_limit
        return min(self._own_limit, abs(self.registers.get("Goal Current")) / self.full_current)

    def give(self) -> float:
        """By Position P Gain alone; the integral takes the error away, and other modes control no position."""
        registers = self.registers
        if self.mode not in (POSITION, EXTENDED, CURRENT_POSITION) or registers.get("Position I Gain"):
            return 0.0
        return self.full_pwm * POSITION_P / max(registers.get("Position P Gain"), 1)

    def _reach(self, current: int) -> float:
        """Distance from rest, ticks, to which a current can stretch the skin."""
        spring = self.plant.skin.spring
        return abs(current) / self.full_current / spring if spring > 0.0 else math.inf

    # ------------------------------------------------------------ planning
    def plan(self, now_s: float) -> None:
        mode = self.mode
        if mode in (POSITION, EXTENDED, CURRENT_POSITION):
            self._plan_position(now_s, mode)
        elif mode == CURRENT:
            self._plan_current(now_s)
        else:
            self._plan_speed(now_s, mode)

    def _plan_position(self, now_s: float, mode: int) -> None:
        """Plan the motion to Goal Position, or as far as the current can stretch the skin."""
        plant = self.plant
        acceleration, speed, register = self._profile()
        reach = self.reach
        if mode == CURRENT_POSITION:
            reach = min(reach, self._reach(self.registers.get("Goal Current")))
        goal = min(max(self.to_shaft(register), plant.rest - reach), plant.rest + reach)
        now = plant.motion(now_s)
        if speed and self.timed:
            plan = plan_timed(now_s, now, goal, speed * self.time_s, acceleration * self.time_s)
            if abs(plan.at(now_s + 0.5 * plan.duration).velocity) <= self.top_speed:
                plant.trajectory = plan
                return
            speed = 0
        top, limit, profile = self.top_speed, plant.top_acceleration, Profile.STEP
        if speed:
            top, profile = min(speed * self.ticks_s, top), Profile.RECTANGULAR
            if acceleration:
                limit, profile = min(acceleration * self.ticks_s2, limit), Profile.TRAPEZOIDAL
        plant.trajectory = plan_move(now_s, now, goal, top, limit, profile)

    def _profile(self) -> tuple[int, int, int]:
        """Acceleration (or its time), velocity (or the time) and goal of the next move."""
        profile: tuple[int, int, int] = _PROFILE.unpack_from(self.registers.memory, self._profile_at)
        return profile

    def _plan_current(self, now_s: float) -> None:
        """Plan the motion to where the skin's spring balances the current; without a spring the shaft keeps turning."""
        share = self.side * self.registers.get("Goal Current") / self.full_current
        now, plant, top = self.plant.motion(now_s), self.plant, self.top_speed
        if plant.skin.spring > 0.0:
            goal = plant.rest + share / plant.skin.spring
            plant.trajectory = plan_move(now_s, now, goal, top, plant.top_acceleration)
        else:
            plant.trajectory = plan_speed(now_s, now, share * top, plant.top_acceleration)

    def _plan_speed(self, now_s: float, mode: int) -> None:
        registers, now, top = self.registers, self.plant.motion(now_s), self.top_speed
        if mode == PWM:
            speed = registers.get("Goal PWM") / registers.table["PWM Limit"].initial * top
            acceleration = 0.0
        else:
            speed = registers.get("Goal Velocity") * self.ticks_s
            acceleration = registers.get("Profile Acceleration") * self.ticks_s2
        speed = self.side * min(max(speed, -top), top)
        self.plant.trajectory = plan_speed(now_s, now, speed, acceleration or self.plant.top_acceleration)

    # ------------------------------------------------------------ sensing
    def sense(self, now_s: float) -> float:
        motion, commanded, load = self.observe(now_s)
        values = self._values(now_s, motion, commanded, load)
        self._layout.pack_into(self.registers.memory, self.first_sensed, *values)
        return load

    def sense_quickly(self, now_s: float) -> None:
        """Write current, velocity, position and temperature."""
        motion, _, load = self.observe(now_s)
        side = self.side
        _MOTION.pack_into(
            self.registers.memory,
            self.motion_at,
            side * round(load * self.full_current),
            side * round(motion.velocity / self.ticks_s),
            round(self.mirror + side * motion.position) + self.offset,
        )
        for at in self._celsius_at:
            self.registers.memory[at] = self._celsius()

    def _celsius(self) -> int:
        """Present Temperature."""
        return min(max(round(self.plant.temperature_c), 0), 255)

    def _values(self, now_s: float, motion: Motion, commanded: Motion, load: float) -> tuple[int, ...]:
        """X-series registers 120-146, in order of address."""
        plant, side, ticks_s = self.plant, self.side, self.ticks_s
        powered, speed = plant.powered, motion.velocity
        running = powered and plant.trajectory.moving(now_s)
        arrived = abs(commanded.position - motion.position) < FOLLOWING_TICKS
        profile = plant.trajectory.profile << 4 if running else 0
        push = 0.8 * speed / plant.top_speed + 0.2 * load if powered else 0.0
        return (
            int((now_s - self.born_s) * 1000.0) & 0x7FFF,
            int(powered and speed != 0.0),
            (arrived and not running) | running << 1 | (not arrived) << 3 | profile,
            side * round(self.full_pwm * push),
            side * round(load * self.full_current),
            side * round(speed / ticks_s),
            round(self.mirror + side * motion.position) + self.offset,
            side * round(commanded.velocity / ticks_s),
            round(self.mirror + side * commanded.position) + self.offset,
            round(10.0 * plant.voltage(load)),
            self._celsius(),
        )


def _current_at_stall(table: ControlTable) -> int:
    """Value of Present Current at stall; Current Limit where the maker gives no stall current."""
    if table.motor is None:
        return table["Current Limit"].initial
    return round(table.motor.stall_a / table["Present Current"].scale)


def _sensed_block(table: ControlTable) -> tuple[struct.Struct, int, int]:
    """(layout, first address, end) of the sensed items, which lie side by side from Realtime Tick on."""
    items = sorted((table[name] for name in _SENSED if name in table), key=lambda item: item.address)
    codes = "".join(_CODES[item.size, item.signed] for item in items)
    return struct.Struct("<" + codes), items[0].address, items[-1].end
