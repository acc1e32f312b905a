"""Limits the motion of parameters and servos, and computes minimum-jerk curves and envelopes.

The limiter approaches its target with the speed ``v`` of the square-root braking curve, which is linear near the
target. ``e`` is the distance to the target, ``a`` the greatest acceleration and ``r`` the response time:

    v(e) = e / r                          for |e| <= a r^2
    v(e) = sqrt(2 a (|e| - a r^2 / 2))    beyond.

So it brakes at no more than ``a`` and arrives like a critically damped spring of time constant ``r``. Each step chooses
one constant acceleration for its whole length, so that speed and acceleration stay inside their limits whatever the
length of the steps, and braking from any speed ends inside the range. Where the jerk is limited too, the positions
then pass through a :class:`controller.motion.jerk.JerkFilter`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Flags, Floats, Parameters
from controller.motion.jerk import JerkFilter

_MAX_STEP_S = 0.1


def minimum_jerk(t: float) -> float:
    """Return 10 t^3 - 15 t^4 + 6 t^5 with ``t`` clipped to 0..1 (Flash and Hogan 1985)."""
    t = min(max(t, 0.0), 1.0)
    return min(t * t * t * (10.0 + t * (6.0 * t - 15.0)), 1.0)  # rounding must not pass the end


@dataclass(frozen=True)
class Envelope:
    """A level from 0 to 1 that rises, holds and falls along minimum-jerk curves.

    start_s : when it begins. onset_s : time to rise. hold_s : time at 1. offset_s : time to fall.
    """

    start_s: float
    onset_s: float
    hold_s: float
    offset_s: float

    @property
    def end_s(self) -> float:
        """Time at which the level is 0 again."""
        return self.start_s + self.onset_s + self.hold_s + self.offset_s

    def level(self, now_s: float) -> float:
        """Return the level at ``now_s``."""
        t = now_s - self.start_s
        if t <= 0.0:
            return 0.0
        if t < self.onset_s:
            return minimum_jerk(t / self.onset_s)
        t -= self.onset_s + self.hold_s
        if t <= 0.0:
            return 1.0
        return 1.0 - minimum_jerk(t / self.offset_s) if t < self.offset_s else 0.0


class MotionLimiter:
    """Moves (n,) values towards targets within their range and their limits of speed, acceleration and jerk.

    Parameters
    ----------
    max_speed : (n,) units/s. max_acceleration : (n,) units/s^2.
    low, high : (n,) range.
    response_s : (n,) or one number, time constant of the approach (s).
    max_jerk : (n,) or one number, units/s^3; infinity for no limit.
    period_s : expected length of a step (s); longer steps are divided where the jerk is limited.

    Attributes
    ----------
    limited : (n,) bool, whether a limit of speed or acceleration made the last step slower.

    Raises ValueError: a limit or ``response_s`` is not positive, or ``low`` is above ``high``.
    """

    def __init__(
        self,
        max_speed: Floats,
        max_acceleration: Floats,
        low: Floats,
        high: Floats,
        *,
        response_s: Floats | float = 0.02,
        max_jerk: Floats | float = np.inf,
        period_s: float = 0.01,
    ) -> None:
        from controller.motion.braking import move  # imported lazily: numba, which only motion needs

        n = len(low)
        self._low, self._high = _vector(low, n), _vector(high, n)
        self._speed, self._accel = _vector(max_speed, n), _vector(max_acceleration, n)
        self._response, jerk = _vector(response_s, n), _vector(max_jerk, n)
        self._top_speed = self._speed.copy()
        _check_limits(self._speed, self._accel, self._response, jerk, self._high - self._low)
        self._filter, self._period_s = JerkFilter(self._accel, jerk), period_s
        self._position = np.clip(np.zeros(n), self._low, self._high)
        self._velocity = np.zeros(n)
        self._output, self._target = self._position.copy(), self._position.copy()
        self.limited: NDArray[np.bool_] = np.zeros(n, dtype=bool)
        self._move = move
        self._kernel_args = (self._target, self._position, self._velocity, self.limited, self._speed, self._accel,
                             self._response, self._low, self._high)  # fmt: skip
        self._filter.reset(self._position)

    @classmethod
    def of(cls, parameters: Parameters, period_s: float = 0.01) -> MotionLimiter:
        """Return a limiter with the limits of ``parameters``."""
        p = parameters
        return cls(p.max_speed, p.max_acceleration, p.low, p.high, response_s=p.response_s, max_jerk=p.max_jerk,
                   period_s=period_s)  # fmt: skip

    @property
    def velocity(self) -> Floats:
        """(n,) float64, current velocity in units/s, before the jerk filter."""
        return self._velocity

    def stopping_position(self, dt: float) -> Floats:
        """Return (n,) positions at which the values would stop if they braked after the next step of ``dt`` s."""
        braking = np.abs(self._velocity) / (2.0 * self._accel) + dt
        return self._position + self._velocity * braking

    def set_speed_fraction(self, fraction: Floats | float) -> None:
        """Limit the speed to a fraction 0..1 of ``max_speed`` : (n,) or one number, until the next call."""
        np.multiply(self._top_speed, fraction, out=self._speed)

    def reset(self, values: Floats) -> None:
        """Set the values to ``values`` : (n,), at rest."""
        np.clip(values, self._low, self._high, out=self._position)
        self._velocity[:] = 0.0
        self._output[:] = self._position
        self._target[:] = self._position
        self._filter.reset(self._position)

    def reset_moving(self, values: Floats, velocity: Floats) -> None:
        """Set the values to ``values`` : (n,), moving at ``velocity`` : (n,), units/s, clipped to the speed limit."""
        self.reset(values)
        np.clip(velocity, -self._speed, self._speed, out=self._velocity)

    def reset_some(self, where: Flags, values: Floats) -> None:
        """Set the values for which ``where`` : (n,) is True to those of ``values`` : (n,), at rest."""
        self._position[where] = np.clip(values, self._low, self._high)[where]
        self._velocity[where] = 0.0
        self._output[where] = self._target[where] = self._position[where]
        self._filter.reset_some(where, self._position)

    def step(self, dt: float, targets: Floats, out: Floats) -> Floats:
        """Move for ``dt`` seconds towards ``targets`` : (n,) and write the values to ``out`` : (n,).

        Where a target is not finite, the previous target remains in force. A step longer than 0.1 s counts as 0.1 s,
        so that the face does not jump after the machine has paused.
        """
        np.copyto(self._target, targets, where=np.isfinite(targets))
        _clip_in_place(self._target, self._low, self._high)
        dt = min(dt, _MAX_STEP_S)
        if dt > 0.0:
            self._advance(dt)
        out[:] = self._output
        return out

    def _advance(self, dt: float) -> None:
        if not self._filter.active:
            self._move(dt, *self._kernel_args)
            np.copyto(self._output, self._position)
            return
        count = max(1, round(dt / self._period_s))
        for _ in range(count):
            self._move(dt / count, *self._kernel_args)
            self._filter.step(dt / count, self._position, self._output)
        _clip_in_place(self._output, self._low, self._high)  # the jerk filter's mean may round to just outside


def _clip_in_place(values: Floats, low: Floats, high: Floats) -> None:
    """Clip ``values`` : (n,) to a range, in place; several times faster than ``np.clip`` on so few numbers."""
    np.maximum(values, low, out=values)
    np.minimum(values, high, out=values)


def _vector(values: Floats | float, n: int) -> Floats:
    """Return a new (n,) float64 array of one number or of (n,) numbers."""
    return np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), n))


def _check_limits(speed: Floats, accel: Floats, response: Floats, jerk: Floats, span: Floats) -> None:
    limits = {"max_speed": speed, "max_acceleration": accel, "response_s": response, "max_jerk": jerk}
    for name, limit in limits.items():
        if not np.all(limit > 0):
            raise ValueError(f"{name}[{int(np.argmin(limit > 0))}] must be positive")
    if not np.all(span >= 0):
        raise ValueError(f"low[{int(np.argmin(span >= 0))}] is above high")
