"""Moves values one step along the braking curve of :mod:`controller.motion.motion`, in compiled code.

Each function has explicit types so that numba compiles it on import, before any servo has torque. Compiled at the
first tick, on a new machine, it would delay the bus for longer than the timeout of the servos' watchdog.
"""

from __future__ import annotations

import math

from numba import boolean, float64, void

from controller.base.parameters import Flags, Floats
from surface.base.jit import declared

_TINY = 1e-12
_ROW = float64[::1]


@declared(float64(float64, float64, float64, float64))
def _braking_speed(dt: float, distance: float, accel: float, response: float) -> float:
    """Return the greatest speed at the end of a step of ``dt`` s from which ``distance`` is enough to brake.

    Near the target, the speed is proportional to the distance, with the time constant ``response`` (s).
    """
    linear = distance / (response + 0.5 * dt)
    squared_s = 2.0 * (distance - 0.5 * accel * response**2) / accel + 0.25 * dt * dt
    parabolic = accel * (math.sqrt(max(squared_s, 0.0)) - 0.5 * dt)
    return parabolic if parabolic > accel * response else linear


@declared(void(float64, _ROW, _ROW, _ROW, boolean[::1], _ROW, _ROW, _ROW, _ROW, _ROW))
def move(dt: float, target: Floats, position: Floats, velocity: Floats, limited: Flags, speed: Floats, accel: Floats,
         response: Floats, low: Floats, high: Floats) -> None:  # fmt: skip
    """Move ``position`` and ``velocity`` towards ``target`` for ``dt`` s, in place; all are (n,).

    ``limited`` : (n,) bool, set to whether a limit of speed or acceleration made a value slower. The acceleration is
    constant over the step. A value that can reach its target within the limits during the step stops there.
    """
    for i in range(len(position)):
        sign = math.copysign(1.0, target[i] - position[i])
        error, now = abs(target[i] - position[i]), velocity[i] * sign  # + = towards the target
        allowed = _braking_speed(dt, error - 0.5 * dt * now, accel[i], response[i])
        reach = accel[i] * dt
        wanted = now + max(min(min(allowed, speed[i]) - now, reach), -reach)
        limited[i] = allowed - wanted > 1e-9
        moved = 0.5 * dt * (now + wanted)
        if now * 0.5 * dt >= error and 0.5 * now * now / accel[i] <= error + _TINY:
            moved, wanted = error, 0.0
        position[i] = min(max(position[i] + moved * sign, low[i]), high[i])
        velocity[i] = wanted * sign
