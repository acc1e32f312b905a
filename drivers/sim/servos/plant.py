"""What hangs on a simulated servo: shaft, skin, heat and supply. Everything is computed when it is looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.sim.servos.motion import Motion, hold


@dataclass(frozen=True, slots=True)
class Skin:
    """Load on the shaft, as shares of the motor's stall torque.

    Attributes
    ----------
    spring : share per tick away from `rest`: silicone skin pulls back.
    rest : position of the skin at rest, ticks; None = where the servo starts.
    inertia : share per tick/s².
    friction : share while it turns.
    """

    spring: float = 4e-5
    rest: float | None = None
    inertia: float = 1.2e-6
    friction: float = 0.02


@dataclass(slots=True)
class Heat:
    """Winding temperature: a first-order lag behind ambient + rise x load²."""

    ambient_c: float = 30.0
    rise_c: float = 60.0
    lag_s: float = 200.0
    temperature_c: float = 30.0
    at_s: float = 0.0

    def advance(self, now_s: float, load: float) -> None:
        """Let `load` (share of stall torque) act since the last call."""
        target = self.ambient_c + self.rise_c * load * load
        share = 1.0 - math.exp(-max(now_s - self.at_s, 0.0) / self.lag_s)
        self.temperature_c += (target - self.temperature_c) * share
        self.at_s = max(now_s, self.at_s)


class Plant:
    """Shaft of one servo.

    Parameters
    ----------
    now_s, position : where it stands when it is switched on (ticks of the bare shaft, no offset).
    top_speed : no-load speed, ticks/s.
    supply_v : voltage of the bus.
    skin : its load.

    Attributes
    ----------
    trajectory : what the motor was told.
    powered : the motor holds and moves the shaft; otherwise it stands where it is left.
    jammed_at : position at which the shaft is stuck, or None.
    forced_c : temperature set from outside, or None.
    """

    RAMP_S = 0.03
    """Time from rest to the no-load speed: the quickest a motor can be, whatever its profile says."""
    STIFFNESS = 0.02
    """Share of stall torque per tick of following error of a jammed shaft."""
    RESISTANCE_V = 0.4
    """Drop of the supply at full load, volts."""

    def __init__(self, now_s: float, position: float, top_speed: float, supply_v: float, skin: Skin) -> None:
        self.skin = skin
        self.rest = position if skin.rest is None else skin.rest
        self.top_speed, self.supply_v = top_speed, supply_v
        self.top_acceleration = top_speed / self.RAMP_S
        self.trajectory = hold(now_s, position)
        self.powered = False
        self.jammed_at: float | None = None
        self.jammed_since: float | None = None
        self.heat = Heat(at_s=now_s)
        self.forced_c: float | None = None

    def wanted(self, now_s: float) -> Motion:
        """Motion that the motor was told."""
        return self.trajectory.at(now_s)

    def motion(self, now_s: float) -> Motion:
        """Motion of the shaft."""
        if self.jammed_at is not None:
            return Motion(self.jammed_at, 0.0, 0.0)
        return self.trajectory.at(now_s)

    def load(self, motion: Motion, wanted: Motion) -> float:
        """Torque the motor gives, as a share of its stall torque (-1 to 1)."""
        if not self.powered:
            return 0.0
        skin = self.skin
        load = skin.spring * (motion.position - self.rest) + skin.inertia * motion.acceleration
        if motion.velocity:
            load += math.copysign(skin.friction, motion.velocity)
        if self.jammed_at is not None:
            load += self.STIFFNESS * (wanted.position - motion.position)
        return min(max(load, -1.0), 1.0)

    def voltage(self, load: float) -> float:
        """Supply at the servo, volts."""
        return self.supply_v - self.RESISTANCE_V * abs(load)

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor when `warm` was last called, or the one set from outside."""
        return self.heat.temperature_c if self.forced_c is None else self.forced_c

    def warm(self, now_s: float, load: float) -> None:
        """Let `load` (share of stall torque) have heated the motor since the last call."""
        self.heat.advance(now_s, load)

    def jam(self, now_s: float, stuck: bool) -> None:
        """Hold the shaft where it is, or let it go (it then goes on from there)."""
        if stuck and self.jammed_at is None:
            self.jammed_at = self.trajectory.at(now_s).position
            self.jammed_since = now_s
        elif not stuck and self.jammed_at is not None:
            self.trajectory = hold(now_s, self.jammed_at)
            self.jammed_at = self.jammed_since = None

    def place(self, now_s: float, position: float) -> None:
        """Put the shaft somewhere, as a hand does with a limp one."""
        self.trajectory = hold(now_s, position)
        if self.jammed_at is not None:
            self.jammed_at = position
