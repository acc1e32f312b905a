"""The motor control of servos with 16-bit goals: Dynamixel XL-320, AX and MX(1.0), Feetech STS and SCS."""

from __future__ import annotations

from drivers.sim.servos.drive import Drive
from drivers.sim.servos.motion import Motion, Profile, plan_move, plan_speed, plan_timed
from drivers.sim.servos.plant import Plant
from drivers.sim.servos.registers import Registers
from drivers.tables.tables import to_magnitude

MULTI_TURN = 0x10
"""Bit of Feetech's register Phase (18): positions count over several turns."""
SPEED_STEPS = 1.0
"""Feetech: steps/s of one unit of Goal and Present Velocity (STS memory table, address 46: steps/s)."""
LIMIT_STEPS = 50
"""Feetech: steps/s of one unit of Maximum Velocity Limit (memory tables: 50 steps/s)."""
ACCELERATION_STEPS = 100
"""Feetech: steps/s² of one unit of Acceleration (STS memory table, address 41: 100 steps/s²)."""
DIRECTION_BIT = 10
"""AX, MX and XL-320: speeds and loads are magnitudes with the direction in this bit (set = clockwise)."""

SENSED = frozenset(("Present Position", "Present Speed", "Present Velocity", "Present Load", "Present Current",
    "Present Voltage", "Present Temperature", "Moving", "Realtime Tick", "Goal Position 2"))  # fmt: skip
"""Registers that the sensors write."""


class WordDrive(Drive):
    """Plans and senses for one AX, MX(1.0) or XL-320 servo. See :class:`~drivers.sim.servos.drive.Drive`."""

    goals: tuple[str, ...] = ("Goal Position", "Moving Speed")

    def __init__(self, registers: Registers, plant: Plant, now_s: float) -> None:
        super().__init__(registers, plant, now_s)
        self._names = [name for name in registers.table if name in SENSED]
        items = [registers.table[name] for name in self._names]
        self.first_sensed = min(item.address for item in items)
        self.last_sensed = max(item.end for item in items)
        self.configure()

    def configure(self) -> None:
        """Does nothing: every setting is read when it is used."""

    def plan(self, now_s: float) -> None:
        """Plan the motion to Goal Position at Moving Speed (0: top speed), or in wheel mode without end."""
        registers, plant = self.registers, self.plant
        now, moving = plant.motion(now_s), registers.get("Moving Speed")
        magnitude = moving & (1 << DIRECTION_BIT) - 1
        if self._wheel():
            share = magnitude / 1023 * (-1 if moving >> DIRECTION_BIT & 1 else 1)
            plant.trajectory = plan_speed(now_s, now, share * plant.top_speed, plant.top_acceleration)
            return
        top = min(magnitude * self.ticks_s, plant.top_speed) if magnitude else plant.top_speed
        goal = self.to_shaft(registers.get("Goal Position"))
        plant.trajectory = plan_move(now_s, now, goal, top, plant.top_acceleration, Profile.RECTANGULAR)

    def _wheel(self) -> bool:
        """XL-320 has a mode register; AX and MX turn endlessly when both angle limits are 0."""
        registers = self.registers
        if "Control Mode" in registers.table:
            return registers.get("Control Mode") == 1
        return registers.get("CW Angle Limit") == registers.get("CCW Angle Limit") == 0

    def sense(self, now_s: float) -> float:
        motion, _, load = self.observe(now_s)
        values = self._values(now_s, motion, load)
        for name in self._names:
            self.registers.put(name, values[name])
        return load

    def _values(self, now_s: float, motion: Motion, load: float) -> dict[str, int]:
        plant = self.plant
        speed, load_register = round(motion.velocity / self.ticks_s), round(1000 * load)
        if "Control Mode" in self.registers.table:  # the XL-320's table leaves the direction bit to the host
            speed, load_register = (to_magnitude(each, DIRECTION_BIT) for each in (speed, round(1023 * load)))
        return {
            "Present Position": self._position(motion),
            "Present Speed": speed,
            "Present Velocity": speed,
            "Present Load": load_register,
            "Present Current": round(1000 * load),
            "Present Voltage": min(max(round(10.0 * plant.voltage(load)), 0), 255),
            "Present Temperature": min(max(round(plant.temperature_c), 0), 255),
            "Moving": int(plant.powered and motion.velocity != 0.0),
            "Realtime Tick": int((now_s - self.born_s) * 1000.0) & 0x7FFF,
        }

    def _position(self, motion: Motion) -> int:
        """Present Position, which ends at the ends of the turn."""
        return min(max(self.to_register(motion.position), 0), self.registers.table.ticks_per_turn - 1)


class FeetechDrive(WordDrive):
    """Plans and senses for one Feetech STS or SCS servo. See :class:`~drivers.sim.servos.drive.Drive`.

    STS: Goal Velocity (0 = top speed) and Acceleration in its unit of 100 steps/s²; modes 0 position, 1 speed,
    2 PWM (in Goal Time), 3 step by step. SCS: Goal Time, when it is not 0, is the duration of the move.
    """

    goals = ("Goal Position", "Goal Velocity", "Goal Time")

    def __init__(self, registers: Registers, plant: Plant, now_s: float) -> None:
        super().__init__(registers, plant, now_s)
        self.ticks_s = SPEED_STEPS

    def configure(self) -> None:
        """Present Position is the shaft's less Homing Offset."""
        if "Homing Offset" in self.registers.table:
            self.offset = -self.registers.get("Homing Offset")

    def plan(self, now_s: float) -> None:
        """Plan the motion of the Operating Mode."""
        registers, plant = self.registers, self.plant
        now = plant.motion(now_s)
        mode = registers.get("Operating Mode") if "Operating Mode" in registers.table else 0
        if mode in (1, 2):
            speed = registers.get("Goal Velocity") * self.ticks_s
            if mode == 2:
                speed = registers.get("Goal Time") / 1000 * plant.top_speed
            speed = min(max(speed, -self._top_speed()), self._top_speed())
            plant.trajectory = plan_speed(now_s, now, speed, self._acceleration())
            return
        goal = self.to_shaft(registers.get("Goal Position"))
        if mode == 3:
            goal = plant.trajectory.end + registers.get("Goal Position")
        time_s = registers.get("Goal Time") * 1e-3
        if time_s > 0.0 and registers.table.ticks_per_turn == 1024:
            plant.trajectory = plan_timed(now_s, now, goal, time_s)
            return
        speed, top = abs(registers.get("Goal Velocity")) * self.ticks_s, self._top_speed()
        plant.trajectory = plan_move(now_s, now, goal, min(speed or top, top), self._acceleration())

    def _top_speed(self) -> float:
        """Top speed of the motor, or Maximum Velocity Limit where that is lower; there 0 means no limit."""
        limit = self.registers.get("Maximum Velocity Limit") * LIMIT_STEPS
        return min(limit or self.plant.top_speed, self.plant.top_speed)

    def _acceleration(self) -> float:
        """Acceleration of STS servos: the registers Acceleration and Maximum Acceleration, where they are not 0."""
        top, registers = self.plant.top_acceleration, self.registers
        names = [name for name in ("Acceleration", "Maximum Acceleration") if name in registers.table]
        return min((ACCELERATION_STEPS * registers.get(name) or top for name in names), default=top)

    def _position(self, motion: Motion) -> int:
        """Present Position, which with multi-turn feedback (STS) counts over several turns."""
        registers = self.registers
        if "Homing Offset" in registers.table and registers.get("Phase") & MULTI_TURN:
            return self.to_register(motion.position)
        return super()._position(motion)

    def _values(self, now_s: float, motion: Motion, load: float) -> dict[str, int]:
        values = super()._values(now_s, motion, load)
        values["Goal Position 2"] = self.registers.get("Goal Position")
        return values
