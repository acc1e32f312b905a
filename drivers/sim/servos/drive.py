"""Base class of the motor control of simulated servos: registers to trajectories, and sensors to registers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from enum import Enum

from drivers.sim.servos.motion import Motion, hold, plan_stop
from drivers.sim.servos.plant import Plant
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import ControlTable

OVERLOAD_AFTER_S = 1.0
"""Time that a jammed motor gives its full torque before it counts as overloaded."""


class Sensing(Enum):
    """Which sensors must be updated before registers are read."""

    NOTHING = 0
    QUICK = 1
    ALL = 2


def speed_unit(table: ControlTable) -> float:
    """Return one step of a model's speed register, ticks/s."""
    return (table.get("Present Speed") or table["Present Velocity"]).scale / table.rad_per_tick


class Drive(ABC):
    """Converts goal registers to a trajectory, and motion of the shaft to registers, for one servo from ``now_s`` on.

    goals : names of the registers that move the motor in the present mode.
    offset : Present Position less the shaft's, ticks; `side` and `mirror` reverse the direction.
    ticks_s : one step of the speed register, ticks/s.
    first_sensed, last_sensed : first and last-plus-one address that `sense` writes.
    quick : addresses of registers that `sense_quickly` writes, among these.
    """

    goals: tuple[str, ...]
    first_sensed: int
    last_sensed: int
    quick: frozenset[int] = frozenset()

    def __init__(self, registers: Registers, plant: Plant, now_s: float) -> None:
        self.registers, self.plant, self.born_s = registers, plant, now_s
        self.ticks_s = speed_unit(registers.table)
        self.side, self.mirror, self.offset = 1, 0.0, 0

    @abstractmethod
    def configure(self) -> None:
        """Read the permanent settings; to be called when one of them changed."""

    @abstractmethod
    def plan(self, now_s: float) -> None:
        """Plan the motion to the goal registers in the operating mode, from the present motion on."""

    @abstractmethod
    def sense(self, now_s: float) -> float:
        """Write the sensors' values at `now_s` into memory; returns the load (-1 to 1)."""

    def sense_quickly(self, now_s: float) -> None:
        """Write at least the registers at `quick`, those that control loops read."""
        self.sense(now_s)

    def sensing(self, addresses: Collection[int]) -> Sensing:
        """Return which sensors must be updated before the bytes at these addresses are read."""
        sensed = {at for at in addresses if self.first_sensed <= at < self.last_sensed}
        if not sensed:
            return Sensing.NOTHING
        return Sensing.QUICK if sensed <= self.quick else Sensing.ALL

    def torque_limit(self) -> float:
        """Greatest torque that the registers allow, as a fraction of the stall torque."""
        item = self.registers.table.get("Torque Limit")
        return self.registers.get("Torque Limit") / (item.maximum or 1000) if item else 1.0

    def to_register(self, shaft: float) -> int:
        """Present Position for a shaft position: reversed about the middle of the turn, then offset."""
        return round(self.mirror + self.side * shaft) + self.offset

    def to_shaft(self, register: int) -> float:
        """Shaft position for a Goal Position; the inverse of `to_register`."""
        return self.mirror + self.side * float(register - self.offset)

    def stop(self, now_s: float) -> None:
        """Stop immediately (bus watchdog: profile acceleration and velocity count as 0)."""
        self.plant.trajectory = hold(now_s, self.plant.motion(now_s).position)

    def coast(self, now_s: float) -> None:
        """Slow down as without power, at half the motor's acceleration."""
        self.plant.trajectory = plan_stop(now_s, self.plant.motion(now_s), 0.5 * self.plant.top_acceleration)

    def observe(self, now_s: float) -> tuple[Motion, Motion, float]:
        """Return (motion of the shaft, motion commanded to the motor, load)."""
        plant = self.plant
        commanded = plant.trajectory.at(now_s)
        motion = plant.follow(now_s, commanded)
        plant.torque_limit = self.torque_limit()
        load = plant.load(motion, commanded)
        if plant.weight and plant.powered and plant.jammed_at is None:
            low, high = plant.stops
            position = motion.position - self.give() * plant.weight
            motion = motion._replace(position=min(max(position, low), high))
        return motion, commanded, load

    def give(self) -> float:
        """Compliance of the position control: ticks by which the shaft yields to the motor's stall torque."""
        return 0.0

    def hardware_errors(self, now_s: float, load: float) -> int:
        """Bits of Hardware Error Status whose causes are present."""
        registers, plant = self.registers, self.plant
        cause, bits = registers.table.hardware_error, 0
        voltage = round(10.0 * plant.voltage(load))
        if not registers.get("Min Voltage Limit") <= voltage <= registers.get("Max Voltage Limit"):
            bits |= cause["voltage"]
        if plant.temperature_c > registers.get("Temperature Limit"):
            bits |= cause["temperature"]
        since = plant.pressed_since if plant.jammed_since is None else plant.jammed_since
        if abs(load) >= 1.0 and since is not None and now_s - since > OVERLOAD_AFTER_S:
            bits |= cause["overload"]
        return bits
