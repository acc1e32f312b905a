"""Trajectories of simulated shafts: moves, timed moves, velocity ramps and stops of piecewise constant acceleration.

Units are position steps (ticks) and seconds. A trajectory is planned when a goal is written and evaluated at any
later time, so a bus at rest costs nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Motion(NamedTuple):
    """Position (ticks), velocity (ticks/s) and acceleration (ticks/s²) at one moment."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


class Profile:
    """Profile types as Moving Status (123) bits 4-5 number them."""

    STEP = 0
    RECTANGULAR = 1
    TRIANGULAR = 2
    TRAPEZOIDAL = 3


class Trajectory:
    """Motion from `start_s` on: pieces of constant acceleration, then rest at the goal, or the last velocity for ever.

    Parameters
    ----------
    start_s : time of the first piece.
    start : motion at that time.
    pieces : (duration in seconds, acceleration) in order; those without a duration are left out.
    goal : position it ends at, set exactly, without rounding errors; None where it never ends (velocity control).
    profile : a `Profile` number.

    Attributes
    ----------
    duration : of all pieces, seconds. end : position where they end.
    """

    __slots__ = ("_end_velocity", "_pieces", "duration", "end", "profile", "start_s")

    def __init__(
        self,
        start_s: float,
        start: Motion,
        pieces: list[tuple[float, float]],
        goal: float | None = None,
        profile: int = Profile.STEP,
    ) -> None:
        self.start_s, self.profile = start_s, profile
        kept: list[tuple[float, float, float, float]] = []
        at = 0.0
        position, velocity, _ = start
        for duration, acceleration in pieces:
            if duration > 0.0:
                kept.append((at, position, velocity, acceleration))
                position += (velocity + 0.5 * acceleration * duration) * duration
                velocity += acceleration * duration
                at += duration
        self._pieces, self.duration = kept, at
        self.end, self._end_velocity = (position, velocity) if goal is None else (goal, 0.0)

    @property
    def heading(self) -> int:
        """Final direction: 1 to higher positions, -1 to lower ones, 0 where it stands still."""
        return _sign(self._end_velocity) or _sign(self.end - self.turn[1])

    @property
    def turn(self) -> tuple[float, float]:
        """Time and position where it turns at the beginning; its start where it goes on as it was going."""
        if not self._pieces:
            return self.start_s, self.end
        _, position, velocity, acceleration = self._pieces[0]
        ends_s = self._pieces[1][0] if len(self._pieces) > 1 else self.duration
        turn_s = -velocity / acceleration if velocity and acceleration else 0.0
        if not 0.0 < turn_s < ends_s:
            return self.start_s, position
        return self.start_s + turn_s, position + 0.5 * velocity * turn_s

    def moving(self, now_s: float) -> bool:
        """Whether the pieces have not ended."""
        return now_s - self.start_s < self.duration

    def at(self, now_s: float) -> Motion:
        """Motion at a time; before the start it is that at the beginning of the first piece."""
        t = now_s - self.start_s
        if t < 0.0:
            t = 0.0
        if t >= self.duration:
            velocity = self._end_velocity
            return Motion(self.end + velocity * (t - self.duration), velocity, 0.0)
        piece = self._pieces[-1]
        for piece in reversed(self._pieces):
            if t >= piece[0]:
                break
        begin, position, velocity, acceleration = piece
        t -= begin
        return Motion(position + (velocity + 0.5 * acceleration * t) * t, velocity + acceleration * t, acceleration)


def _sign(value: float) -> int:
    return (value > 0.0) - (value < 0.0)


def hold(now_s: float, position: float) -> Trajectory:
    """Plan to stand still at a position."""
    return Trajectory(now_s, Motion(position), [], position)


def plan_move(
    now_s: float, start: Motion, goal: float, top_speed: float, acceleration: float, profile: int = Profile.TRAPEZOIDAL
) -> Trajectory:
    """Quickest move to rest at `goal`: a trapezoid, or a triangle where it is too short.

    top_speed, acceleration : above zero, ticks/s and ticks/s².
    profile : number to report; a trapezoid without a constant velocity is reported as triangular.
    """
    velocity, distance = start.velocity, goal - start.position
    stop = velocity * abs(velocity) / (2.0 * acceleration)
    side = 1.0 if distance >= stop else -1.0
    cruise = side * top_speed
    ramp_up = abs(cruise - velocity) / acceleration
    ramp_down = top_speed / acceleration
    level = distance - 0.5 * (velocity + cruise) * ramp_up - 0.5 * cruise * ramp_down
    if level * side < 0.0:
        peak = math.sqrt(max(acceleration * side * distance + 0.5 * velocity * velocity, 0.0))
        cruise, level, ramp_down = side * peak, 0.0, peak / acceleration
        ramp_up = abs(cruise - velocity) / acceleration
        profile = Profile.TRIANGULAR if profile == Profile.TRAPEZOIDAL else profile
    push = math.copysign(acceleration, cruise - velocity)
    level_s = level / cruise if cruise else 0.0
    pieces = [(ramp_up, push), (level_s, 0.0), (ramp_down, -side * acceleration)]
    return Trajectory(now_s, start, pieces, goal, profile)


def plan_timed(now_s: float, start: Motion, goal: float, total_s: float, ramp_s: float = 0.0) -> Trajectory:
    """Plan a move to rest at `goal` in exactly `total_s`, with ramps of `ramp_s` (at most half of it).

    The cruising speed v follows from D = (v0 + v)/2 ramp + v (total - 2 ramp) + v/2 ramp.
    """
    ramp_s = min(ramp_s, 0.5 * total_s)
    speed = (goal - start.position - 0.5 * start.velocity * ramp_s) / (total_s - ramp_s)
    if ramp_s <= 0.0:
        return Trajectory(now_s, start._replace(velocity=speed), [(total_s, 0.0)], goal, Profile.RECTANGULAR)
    pieces = [(ramp_s, (speed - start.velocity) / ramp_s), (total_s - 2.0 * ramp_s, 0.0), (ramp_s, -speed / ramp_s)]
    profile = Profile.TRAPEZOIDAL if total_s > 2.0 * ramp_s else Profile.TRIANGULAR
    return Trajectory(now_s, start, pieces, goal, profile)


def plan_speed(now_s: float, start: Motion, goal_velocity: float, acceleration: float) -> Trajectory:
    """Plan a ramp to a velocity that is then kept."""
    change = goal_velocity - start.velocity
    pieces = [(abs(change) / acceleration, math.copysign(acceleration, change))]
    return Trajectory(now_s, start, pieces, None, Profile.RECTANGULAR)


def plan_stop(now_s: float, start: Motion, acceleration: float) -> Trajectory:
    """Plan to slow down to rest, at whatever position that ends."""
    time = abs(start.velocity) / acceleration
    pieces = [(time, -math.copysign(acceleration, start.velocity))]
    return Trajectory(now_s, start, pieces, start.position + 0.5 * start.velocity * time)
