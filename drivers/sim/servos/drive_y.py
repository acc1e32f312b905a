"""The motor control of Y-series servos: as X-series, with registers elsewhere, and error codes instead of bits."""

from __future__ import annotations

import struct

from drivers.sim.servos.drive import OVERLOAD_AFTER_S
from drivers.sim.servos.drive_x import FOLLOWING_TICKS, XDrive
from drivers.sim.servos.motion import Motion
from drivers.sim.servos.plant import Plant
from drivers.sim.servos.registers import Registers

_SENSED = struct.Struct("<BHhhii4xiiHBB")
"""Moving Status, Realtime Tick, Present PWM, Current, Velocity and Position; Position and Velocity Trajectory; Present
Input Voltage, Inverter and Motor Temperature."""
_STEPS = 524_288 / 4096
"""Number of steps of a Y-series servo per step of an X-series servo."""


class YDrive(XDrive):
    """Plans and senses for one Y-series servo. See :class:`~drivers.sim.servos.drive.Drive`."""

    time_s = 2e-4

    def __init__(self, registers: Registers, plant: Plant, now_s: float) -> None:
        super().__init__(registers, plant, now_s)
        self._layout, self.first_sensed = _SENSED, registers.table["Moving Status"].address
        self.last_sensed = self.first_sensed + _SENSED.size

    def give(self) -> float:
        """The manual gives no formula for what its gains do to a load."""
        return 0.0

    def _profile(self) -> tuple[int, int, int]:
        names = ("Profile Acceleration", "Profile Velocity")
        if self.timed:
            names = ("Profile Acceleration Time", "Profile Time")
        acceleration, speed = map(self.registers.get, names)
        return acceleration, speed, self.registers.get("Goal Position")

    def _values(self, now_s: float, motion: Motion, commanded: Motion, load: float) -> tuple[int, ...]:
        plant, registers, side = self.plant, self.registers, self.side
        values = super()._values(now_s, motion, commanded, load)
        tick, moving, _, pwm, current, speed, position, _, commanded_position, volts, celsius = values
        running = plant.powered and plant.trajectory.moving(now_s)
        arrived = abs(commanded.position - motion.position) < FOLLOWING_TICKS * _STEPS
        inside = registers.get("Min Position Limit") <= position <= registers.get("Max Position Limit")
        status = (arrived and not running) | running << 1 | moving << 2 | (not arrived) << 3 | inside << 6
        status |= plant.trajectory.profile << 4 if running else 0
        trajectory = side * round(commanded.velocity)
        return (status, tick, pwm, current, speed, position, commanded_position, trajectory, 10 * volts, *[celsius] * 2)

    def hardware_errors(self, now_s: float, load: float) -> int:
        """Code of the first cause that is present."""
        registers, plant, codes = self.registers, self.plant, self.registers.table.error_codes
        since = plant.pressed_since if plant.jammed_since is None else plant.jammed_since
        tenths = round(10.0 * plant.voltage(load))
        causes = {
            "over_voltage": tenths > registers.get("Max Voltage Limit"),
            "voltage": tenths < registers.get("Min Voltage Limit"),
            "temperature": plant.temperature_c > registers.get("Motor Temperature Limit"),
            "overload": abs(load) >= 1.0 and since is not None and now_s - since > OVERLOAD_AFTER_S,
        }
        return next((codes[cause] for cause, present in causes.items() if present), 0)
