"""Moves values one step along the braking curve of :mod:`controller.motion.motion`; compiled.

Each function has explicit types so that it is compiled on import, which is before servos are under torque: compiled
at the first tick, on a new machine, it would hold up the bus for longer than the servos' watchdog waits.
"""

from __future__ import annotations

import math

from numba import boolean, float64, njit, void

import surface.base.jit  # noqa: F401  first of all: it keeps numba from importing scipy, which takes longer than all the rest
from controller.base.parameters import Flags, Floats

_TINY = 1e-12
_ROW = float64[::1]


@njit([float64(float64, float64, float64, float64)], cache=True, nogil=True)
def _braking_speed(dt: float, left: float, accel: float, response: float) -> float:
    """Speed at the end of a step of ``dt`` from which ``left`` is just enough to brake."""
    near = left / (response + 0.5 * dt)  # the linear end
    beyond = 2.0 * (left - 0.5 * accel * response**2) / accel + 0.25 * dt * dt
    far = accel * (math.sqrt(max(beyond, 0.0)) - 0.5 * dt)
    return far if far > accel * response else near


@njit([void(float64, _ROW, _ROW, _ROW, boolean[::1], _ROW, _ROW, _ROW, _ROW, _ROW)], cache=True, nogil=True)
def move(dt: float, target: Floats, position: Floats, velocity: Floats, limited: Flags, speed: Floats, accel: Floats,
         response: Floats, low: Floats, high: Floats) -> None:  # fmt: skip
    """Move ``position`` and ``velocity`` towards ``target`` for ``dt`` s, in place; all are (n,).

    ``limited`` : (n,) bool says where a limit of speed or acceleration held back. The acceleration is even over the
    step; where the target lies on the way and can be reached within the limits, the value stops there.
    """
    for i in range(len(position)):
        sign = math.copysign(1.0, target[i] - position[i])
        error, now = abs(target[i] - position[i]), velocity[i] * sign  # + = towards the target
        free = _braking_speed(dt, error - 0.5 * dt * now, accel[i], response[i])  # way left when the step ended at rest
        reach = accel[i] * dt
        wanted = now + max(min(min(free, speed[i]) - now, reach), -reach)
        limited[i] = free - wanted > 1e-9
        way = 0.5 * dt * (now + wanted)
        if now * 0.5 * dt >= error and 0.5 * now * now / accel[i] <= error + _TINY:
            way, wanted = error, 0.0
        position[i] = min(max(position[i] + way * sign, low[i]), high[i])
        velocity[i] = wanted * sign
