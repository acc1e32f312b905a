"""Limits the motion of parameters and servos, and computes minimum-jerk curves and envelopes.

The limiter follows its target along the square-root braking curve with a linear end,

    v(e) = e / r                          for |e| <= a r^2
    v(e) = sqrt(2 a (|e| - a r^2 / 2))    beyond,

so it brakes at no more than ``a`` and arrives like a critically damped spring of time constant ``r``. Each
step chooses one constant acceleration for its whole length, so that speed and acceleration stay inside their
limits whatever the length of the steps, and braking from any speed ends inside the range. Where a limit of jerk is
given, :class:`controller.motion.jerk.JerkFilter` follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Flags, Floats, Parameters
from controller.motion.jerk import JerkFilter

_LONGEST_STEP_S = 0.1


def minimum_jerk(t: float) -> float:
    """10 t^3 - 15 t^4 + 6 t^5 with ``t`` held in 0..1 (Flash and Hogan 1985)."""
    t = min(max(t, 0.0), 1.0)
    return min(t * t * t * (10.0 + t * (6.0 * t - 15.0)), 1.0)  # rounding must not pass the end


@dataclass(frozen=True)
class Envelope:
    """Level 0..1 of something that rises, holds and falls along minimum-jerk curves.

    start_s : when it begins. onset_s : time to rise. hold_s : time at 1. offset_s : time to fall.
    """

    start_s: float
    onset_s: float
    hold_s: float
    offset_s: float

    @property
    def end_s(self) -> float:
        """When the level is 0 again."""
        return self.start_s + self.onset_s + self.hold_s + self.offset_s

    def level(self, now_s: float) -> float:
        """Level at ``now_s``."""
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
    """Moves (n,) values towards targets inside their range, speed and acceleration.

    Parameters
    ----------
    max_speed : (n,) units/s. max_acceleration : (n,) units/s^2.
    low, high : (n,) range.
    response_s : (n,) or one number, time constant of the approach.
    max_jerk : (n,) or one number, units/s^3; infinity for no limit.
    period_s : length of the steps it will be given; longer ones are divided where there is a limit of jerk.

    Attributes
    ----------
    limited : (n,) bool, whether the last step was held back by a speed or acceleration limit.

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
        from controller.motion.braking import move  # start-up: numba, which only what moves needs

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
        self._state = (self._target, self._position, self._velocity, self.limited, self._speed, self._accel,
                       self._response, self._low, self._high)  # fmt: skip
        self._filter.reset(self._position)

    @classmethod
    def of(cls, parameters: Parameters, period_s: float = 0.01) -> MotionLimiter:
        """A limiter with the limits of ``parameters``."""
        p = parameters
        return cls(p.max_speed, p.max_acceleration, p.low, p.high, response_s=p.response_s, max_jerk=p.max_jerk,
                   period_s=period_s)  # fmt: skip

    @property
    def velocity(self) -> Floats:
        """(n,) float64, present speed in units/s, before the jerk filter."""
        return self._velocity

    def rest(self, dt: float) -> Floats:
        """(n,) where the values would come to rest if they braked from the next step of ``dt`` s on."""
        braking = np.abs(self._velocity) / (2.0 * self._accel) + dt
        return self._position + self._velocity * braking

    def slow(self, share: Floats | float) -> None:
        """Move at a share of the top speed, 0 to 1, (n,) or one for all, until another is given."""
        np.multiply(self._top_speed, share, out=self._speed)

    def reset(self, values: Floats) -> None:
        """Be at ``values`` : (n,), at rest."""
        np.clip(values, self._low, self._high, out=self._position)
        self._velocity[:] = 0.0
        self._output[:] = self._position
        self._target[:] = self._position
        self._filter.reset(self._position)

    def reset_moving(self, values: Floats, velocity: Floats) -> None:
        """Be at ``values`` : (n,), and move on at ``velocity`` : (n,), units/s, as far as the limits allow."""
        self.reset(values)
        np.clip(velocity, -self._speed, self._speed, out=self._velocity)

    def reset_some(self, where: Flags, values: Floats) -> None:
        """Let those of ``where`` : (n,) be at ``values`` : (n,), at rest."""
        self._position[where] = np.clip(values, self._low, self._high)[where]
        self._velocity[where] = 0.0
        self._output[where] = self._target[where] = self._position[where]
        self._filter.reset_some(where, self._position)

    def step(self, dt: float, targets: Floats, out: Floats) -> Floats:
        """Move for ``dt`` seconds towards ``targets`` : (n,) and write the values to ``out`` : (n,).

        A target that is not finite leaves the earlier one in force. A step longer than 0.1 s counts as 0.1 s:
        after a pause of the machine the face goes on from where it was and does not leap.
        """
        np.copyto(self._target, targets, where=np.isfinite(targets))
        _keep(self._target, self._low, self._high)
        dt = min(dt, _LONGEST_STEP_S)
        if dt > 0.0:
            self._steps(dt)
        out[:] = self._output
        return out

    def _steps(self, dt: float) -> None:
        if not self._filter.active:
            self._move(dt, *self._state)
            np.copyto(self._output, self._position)
            return
        count = max(1, round(dt / self._period_s))
        for _ in range(count):
            self._move(dt / count, *self._state)
            self._filter.step(dt / count, self._position, self._output)
        _keep(self._output, self._low, self._high)  # rounding of the mean


def _keep(values: Floats, low: Floats, high: Floats) -> None:
    """Keep ``values`` : (n,) inside a range, in place; several times faster than ``np.clip`` on so few numbers."""
    np.maximum(values, low, out=values)
    np.minimum(values, high, out=values)


def _vector(values: Floats | float, n: int) -> Floats:
    """A private (n,) float64 copy of one number or of (n,) numbers."""
    return np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), n))


def _check_limits(speed: Floats, accel: Floats, response: Floats, jerk: Floats, span: Floats) -> None:
    limits = {"max_speed": speed, "max_acceleration": accel, "response_s": response, "max_jerk": jerk}
    for name, limit in limits.items():
        if not np.all(limit > 0):
            raise ValueError(f"{name}[{int(np.argmin(limit > 0))}] must be positive")
    if not np.all(span >= 0):
        raise ValueError(f"low[{int(np.argmin(span >= 0))}] is above high")
