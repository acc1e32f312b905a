"""Physics of one simulated servo: shaft, load by the skin, heat and supply, computed when they are read."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.sim.servos.motion import Motion, Trajectory, hold


@dataclass(frozen=True, slots=True)
class Skin:
    """Load on the shaft, as fractions of the motor's stall torque.

    spring : fraction per tick of distance from `rest`, since silicone skin pulls back.
    rest : position of the skin at rest, ticks; None = where the servo starts.
    inertia : fraction per tick/s².
    friction : fraction while it turns.

    The defaults are for servos of 4096 steps a turn, see `for_turn`.
    """

    spring: float = 4e-5
    rest: float | None = None
    inertia: float = 1.2e-6
    friction: float = 0.02

    @classmethod
    def for_turn(cls, ticks: int) -> Skin:
        """The default skin for a servo with so many steps per turn: the same load at the same angle."""
        fine = 4096 / ticks
        return cls(spring=cls().spring * fine, inertia=cls().inertia * fine)


SETTLED = 5.0
"""Number of time constants after which a lag counts as zero."""
NO_STOPS = (-math.inf, math.inf)
"""A shaft that may turn without end."""


class Plant:
    """Shaft and motor of one servo.

    Parameters
    ----------
    now_s, position : time of power-up, and the shaft's position then (ticks of the bare shaft, no offset).
    top_speed : no-load speed, ticks/s.
    supply_v : voltage of the bus.
    skin : its load.
    play : gear play between motor and shaft, ticks. The encoder is at the shaft: where that turns, it waits until the
        motor has run through the play. A load that pulls more than the friction keeps the gear at one flank.

    Attributes
    ----------
    trajectory : the motion commanded to the shaft.
    powered : the motor holds and moves the shaft; otherwise the shaft stays where it is left.
    jammed_at : position at which the shaft is stuck, or None.
    jammed_since : when it got stuck, or None.
    stops : lowest and highest position that the mechanics behind the shaft allow.
    pressed_since : when the shaft came to a stop that the motor still pushes against, or None.
    weight : torque from outside that turns the shaft towards lower positions, as a share of the stall torque.
    torque_limit : most that the motor may give, as a share of its stall torque.
    forced_c : temperature set from outside, or None.
    """

    RAMP_S = 0.03
    """Time from rest to the no-load speed: the shortest possible, whatever the profile."""
    CATCH_UP_S = 0.01
    """Time constant in which the position control makes up for what the shaft lost in the play."""
    STIFFNESS = 0.02
    """Share of stall torque per tick of following error of a shaft that is jammed or at a stop."""
    RESISTANCE_V = 0.4
    """Drop of the supply at full load, volts."""
    AMBIENT_C, RISE_C, LAG_S = 30.0, 60.0, 200.0
    """Winding temperature: a first-order lag of 200 s behind ambient + rise x load²."""

    def __init__(
        self, now_s: float, position: float, top_speed: float, supply_v: float, skin: Skin, play: float = 0.0
    ) -> None:
        self.skin, self.play = skin, play
        self._flank = 0  # at which the gear lies: 1 or -1, 0 in the middle
        self._turned, self._engaged_s = (now_s, position), -math.inf
        self.weight = 0.0
        self.rest = position if skin.rest is None else skin.rest
        self.top_speed, self.supply_v = top_speed, supply_v
        self.top_acceleration = top_speed / self.RAMP_S
        self.trajectory = hold(now_s, position)
        self.powered = False
        self.jammed_at: float | None = None
        self.jammed_since: float | None = None
        self.stops = NO_STOPS
        self.pressed_since: float | None = None
        self.torque_limit = 1.0
        self.forced_c: float | None = None
        self._winding_c, self._heated_s = self.AMBIENT_C, now_s

    @property
    def trajectory(self) -> Trajectory:
        return self._commanded

    @trajectory.setter
    def trajectory(self, commanded: Trajectory) -> None:
        self._commanded = commanded
        if self.play:
            self._turn_gear(commanded)

    def _turn_gear(self, commanded: Trajectory) -> None:
        """Note from when to when the shaft waits for the motor, where the gear changes its flank."""
        now_s, way, (turn_s, position) = commanded.start_s, commanded.heading, commanded.turn
        before_s, left_s = self._turned[0], self._engaged_s - now_s
        if left_s <= 0.0 or not way:
            self._engaged_s = -math.inf  # it goes on from where it is
        if not way or abs(self.weight + self.skin.spring * (position - self.rest)) > self.skin.friction:
            return
        if way == self._flank:
            if now_s < before_s:
                self._turned, self._engaged_s = (turn_s, position), self._engaged_s + turn_s - before_s
            return
        gap_s = _time_for(self.play if self._flank else 0.5 * self.play, self.top_acceleration, self.top_speed)
        if commanded.at(now_s).velocity * way <= 0.0:  # else it goes that way already
            self._turned, self._engaged_s = (turn_s, position), turn_s + max(gap_s - max(left_s, 0.0), 0.0)
        self._flank = way

    def _in_play(self, now_s: float, motion: Motion) -> Motion:
        """Motion of the shaft while the motor runs through the play, and while the control then catches up."""
        turn_s, position = self._turned
        if now_s < turn_s:
            return motion
        if now_s < self._engaged_s:
            return Motion(position)
        lag = (self._commanded.at(self._engaged_s).position - position) * math.exp(
            (self._engaged_s - now_s) / self.CATCH_UP_S
        )
        return motion._replace(position=motion.position - lag, velocity=motion.velocity + lag / self.CATCH_UP_S)

    def motion(self, now_s: float) -> Motion:
        """Motion of the shaft."""
        return self.follow(now_s, self._commanded.at(now_s))

    def follow(self, now_s: float, commanded: Motion) -> Motion:
        """Motion of the shaft at a time when this one is commanded."""
        if self.jammed_at is not None:
            return Motion(self.jammed_at)
        motion = commanded
        if now_s < self._engaged_s + SETTLED * self.CATCH_UP_S:
            motion = self._in_play(now_s, motion)
        if self.stops is NO_STOPS:
            return motion
        low, high = self.stops
        if low <= motion.position <= high:
            self.pressed_since = None
            return motion
        self.pressed_since = now_s if self.pressed_since is None else self.pressed_since
        return Motion(min(max(motion.position, low), high))

    def load(self, motion: Motion, commanded: Motion) -> float:
        """Torque the motor gives, as a share of its stall torque (-1 to 1)."""
        if not self.powered:
            return 0.0
        skin = self.skin
        load = skin.spring * (motion.position - self.rest) + skin.inertia * motion.acceleration
        if motion.velocity:
            load += math.copysign(skin.friction, motion.velocity)
        load += self.weight
        if self.jammed_at is not None or self.pressed_since is not None:
            load += self.STIFFNESS * (commanded.position - motion.position)
        return min(max(load, -self.torque_limit), self.torque_limit)

    def voltage(self, load: float) -> float:
        """Supply at the servo, volts."""
        return self.supply_v - self.RESISTANCE_V * abs(load)

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor when `heat` was last called, or the one set from outside."""
        return self._winding_c if self.forced_c is None else self.forced_c

    def heat(self, now_s: float, load: float) -> None:
        """Let `load` (share of stall torque) heat the motor since the last call."""
        target = self.AMBIENT_C + self.RISE_C * load * load
        share = 1.0 - math.exp(-max(now_s - self._heated_s, 0.0) / self.LAG_S)
        self._winding_c += (target - self._winding_c) * share
        self._heated_s = max(now_s, self._heated_s)

    def jam(self, now_s: float, stuck: bool) -> None:
        """Hold the shaft at its position, or release it, after which it goes on from there."""
        if stuck and self.jammed_at is None:
            self.jammed_at = self.motion(now_s).position
            self.jammed_since = now_s
        elif not stuck and self.jammed_at is not None:
            self.trajectory = hold(now_s, self.jammed_at)
            self.jammed_at = self.jammed_since = None

    def set_stops(self, now_s: float, stops: tuple[float, float]) -> None:
        """Set mechanical stops of the shaft, or remove them (`NO_STOPS`); the shaft stays between them."""
        self.stops, self.pressed_since = stops, None
        self.trajectory = hold(now_s, self.motion(now_s).position)

    def place(self, now_s: float, position: float) -> None:
        """Move the shaft to a position between its stops, as by hand with torque off."""
        position = min(max(position, self.stops[0]), self.stops[1])
        self.trajectory = hold(now_s, position)
        if self.jammed_at is not None:
            self.jammed_at = position


def _time_for(distance: float, acceleration: float, top_speed: float) -> float:
    """Time, s, from rest through a distance with an acceleration and a top speed."""
    ramp = 0.5 * top_speed * top_speed / acceleration
    if distance <= ramp:
        return math.sqrt(2.0 * distance / acceleration)
    return top_speed / acceleration + (distance - ramp) / top_speed
