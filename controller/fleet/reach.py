"""What a motion can do in its next step without passing a limit of speed, acceleration or range; compiled.

What counts of a step is its mean speed, which is what can be measured of it. After a step of ``t`` s with the mean
speed ``m`` the motion may have any speed between ``m - a t / 2`` and ``m + a t / 2`` from which it can still stop
inside its range, so that ``v^2 <= 2 a room``; these are its *end speeds*. The mean of the next step, of any length
``T``, lies within ``a T / 2`` of one of them. So two mean speeds differ by ``a`` times the time between the middles of
their steps at most. Braking at ``a`` from an end speed, and standing from then on, is always among the choices.
"""

from __future__ import annotations

import math

from numba import boolean, float64, void
from numba.types import UniTuple  # type: ignore[attr-defined]  # its stubs lack it

from controller.base.parameters import Flags, Floats
from surface.base.jit import declared

_SHARE = 0.6
"""How much of the limits closing a distance may use, beside the motion of the face itself."""
_SETTLE_S = 0.03
"""Time constant of the end of the way."""
_LONGEST_S = 0.1
"""A step is no wider than top speed goes in this time: after a pause of the machine a face does not leap."""
_MEET = 0.5
"""So much of the acceleration may be needed afterwards to move along with a face that is met."""
_ROUNDING = 1e-9
_ROW, _ROWS = float64[::1], float64[:, ::1]


@declared(float64(float64, float64, float64))
def _greatest(t: float, room: float, accel: float) -> float:
    """Greatest mean speed of a step of ``t`` s that ends where braking ends within ``room``."""
    stoppable = math.sqrt(2.0 * accel * max(room, 0.0))
    return stoppable - 0.5 * accel * t if stoppable >= accel * t else max(room, 0.0) / t


@declared(float64(float64, float64, float64, float64))
def _closing(t: float, distance: float, speed: float, accel: float) -> float:
    """Speed that closes a distance along the braking curve of :mod:`controller.motion.motion`."""
    settle, size, brake = max(_SETTLE_S, t), abs(distance), _SHARE * accel
    end = brake * settle * settle
    found = size / settle if size <= end else math.sqrt(2.0 * brake * (size - 0.5 * end))
    return -math.copysign(min(found, _SHARE * speed), distance)


@declared(UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64, float64, float64))
def _means(t: float, shown: float, slowest: float, fastest: float, top: float, accel: float, low: float, high: float
           ) -> tuple[float, float]:  # fmt: skip
    """Least and greatest mean speed of a step of ``t`` s from ``shown``, after which it can go on within the limits."""
    farthest = top * min(1.0, _LONGEST_S / t)
    least = max(slowest - 0.5 * accel * t, -_greatest(t, shown - low, accel), -top)
    most = min(fastest + 0.5 * accel * t, _greatest(t, high - shown, accel), top)
    return min(max(least, -farthest), most), max(min(most, farthest), least)


@declared(UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64, float64))
def _ends(t: float, mean: float, shown: float, top: float, accel: float, low: float, high: float
          ) -> tuple[float, float]:  # fmt: skip
    """Slowest and fastest end speed of a step of ``t`` s that ended at ``shown``."""
    fastest = min(mean + 0.5 * accel * t, math.sqrt(2.0 * accel * max(high - shown, 0.0)), top)
    slowest = max(mean - 0.5 * accel * t, -math.sqrt(2.0 * accel * max(shown - low, 0.0)), -top)
    return min(slowest, fastest), fastest  # rounding can cross them


@declared(void(float64, float64, boolean, _ROW, boolean[::1], _ROWS, _ROWS))
def pursue(t: float, passed_s: float, stay: bool, face: Floats, met: Flags, motion: Floats, limits: Floats) -> None:
    """Move for ``t`` s towards ``face`` : (n,), which went there in ``passed_s``; in place.

    A value of the face that is no finite number counts as what is shown, and is not met.

    met : (n,) bool, whether what is shown is exactly the face, which is only where ``stay`` says so. motion : (4, n)
    what is shown, where the face was before, slowest and fastest end speed (units/s). limits : (4, n) of speed
    (units/s) and acceleration (units/s^2), low and high end of the range.
    """
    shown, before, slowest, fastest = motion[0], motion[1], motion[2], motion[3]
    speed, accel, low, high = limits[0], limits[1], limits[2], limits[3]
    for i in range(len(shown)):
        a, top, known = accel[i], speed[i], math.isfinite(face[i])
        wanted = face[i] if known else shown[i]
        least, most = _means(t, shown[i], slowest[i], fastest[i], top, a, low[i], high[i])
        drift = min(max((wanted - before[i]) / max(t, passed_s), -top), top)
        mean, rounding = (wanted - shown[i]) / t, _ROUNDING * a * t
        met[i] = known and stay and least - rounding <= mean <= most + rounding and (
            met[i] or abs(mean - drift) <= _MEET * a * t
        )  # fmt: skip
        if met[i]:
            shown[i] = wanted
        else:
            mean = drift + _closing(t, shown[i] + drift * t - wanted, top, a)
            mean = min(max(mean, least), most)
            shown[i] = min(max(shown[i] + mean * t, low[i]), high[i])
        slowest[i], fastest[i] = _ends(t, mean, shown[i], top, a, low[i], high[i])
        before[i] = wanted
