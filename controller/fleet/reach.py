"""Computes how far a motion can go in its next step within limits of speed, acceleration and range; compiled.

A step is described by its mean speed, which can be measured. After a step of ``t`` s with the mean speed ``m`` and the
acceleration limit ``a``, the motion may have any speed ``v`` between ``m - a t / 2`` and ``m + a t / 2`` from which it
can still stop inside its range: ``v^2 <= 2 a room``, with the distance ``room`` to the end of the range. These are its
*end speeds*. The mean speed of the next step, of any length ``T``, is within ``a T / 2`` of one of them. So two mean
speeds differ at most by ``a`` times the time between the middles of their steps. Braking at ``a`` from an end speed to
a standstill is always possible.
"""

from __future__ import annotations

import math

from numba import boolean, float64, void
from numba.types import UniTuple  # type: ignore[attr-defined]  # its stubs lack it

from controller.base.parameters import Flags, Floats
from surface.base.jit import declared

_LIMIT_FRACTION = 0.6
"""Fraction of the limits that closing a distance may use in addition to the motion of the face itself."""
_SETTLE_S = 0.03
"""Time constant of the last part of the approach."""
_MAX_STEP_S = 0.1
"""A step is at most as wide as the top speed in this time, so a face does not jump after a pause of the computer."""
_MEET_FRACTION = 0.5
"""Fraction of the acceleration limit that changing to the face's speed may need when a parameter meets it."""
_ROUNDING = 1e-9
_ROW, _ROWS = float64[::1], float64[:, ::1]


@declared(float64(float64, float64, float64))
def _greatest(t: float, room: float, accel: float) -> float:
    """Return the greatest mean speed of a step of ``t`` s after which braking can end within the distance ``room``."""
    stoppable = math.sqrt(2.0 * accel * max(room, 0.0))
    return stoppable - 0.5 * accel * t if stoppable >= accel * t else max(room, 0.0) / t


@declared(float64(float64, float64, float64, float64))
def _closing(t: float, distance: float, speed: float, accel: float) -> float:
    """Return the speed that closes a distance along the braking curve of :mod:`controller.motion.motion`."""
    settle, size, brake = max(_SETTLE_S, t), abs(distance), _LIMIT_FRACTION * accel
    end = brake * settle * settle
    found = size / settle if size <= end else math.sqrt(2.0 * brake * (size - 0.5 * end))
    return -math.copysign(min(found, _LIMIT_FRACTION * speed), distance)


@declared(UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64, float64, float64))
def _means(t: float, shown: float, slowest: float, fastest: float, top: float, accel: float, low: float, high: float
           ) -> tuple[float, float]:  # fmt: skip
    """Return least and greatest mean speed of a step of ``t`` s from ``shown`` that lets it stay within the limits."""
    farthest = top * min(1.0, _MAX_STEP_S / t)
    least = max(slowest - 0.5 * accel * t, -_greatest(t, shown - low, accel), -top)
    most = min(fastest + 0.5 * accel * t, _greatest(t, high - shown, accel), top)
    return min(max(least, -farthest), most), max(min(most, farthest), least)


@declared(UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64, float64))
def _ends(t: float, mean: float, shown: float, top: float, accel: float, low: float, high: float
          ) -> tuple[float, float]:  # fmt: skip
    """Return slowest and fastest end speed of a step of ``t`` s that ended at ``shown``."""
    fastest = min(mean + 0.5 * accel * t, math.sqrt(2.0 * accel * max(high - shown, 0.0)), top)
    slowest = max(mean - 0.5 * accel * t, -math.sqrt(2.0 * accel * max(shown - low, 0.0)), -top)
    return min(slowest, fastest), fastest  # rounding can cross them


@declared(void(float64, float64, boolean, _ROW, boolean[::1], _ROWS, _ROWS))
def pursue(t: float, passed_s: float, stay: bool, face: Floats, met: Flags, motion: Floats, limits: Floats) -> None:
    """Move for ``t`` s towards ``face`` : (n,), which moved there in ``passed_s``; writes to ``met`` and ``motion``.

    A value of the face that is not finite is replaced by the shown value, and is not met.

    stay : whether values may meet the face. met : (n,) bool, whether the shown value equals the face. motion : (4, n)
    shown values, previous face, slowest and fastest end speed (units/s). limits : (4, n) of speed (units/s) and
    acceleration (units/s^2), low and high end of the range.
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
            met[i] or abs(mean - drift) <= _MEET_FRACTION * a * t
        )  # fmt: skip
        if met[i]:
            shown[i] = wanted
        else:
            mean = drift + _closing(t, shown[i] + drift * t - wanted, top, a)
            mean = min(max(mean, least), most)
            shown[i] = min(max(shown[i] + mean * t, low[i]), high[i])
        slowest[i], fastest[i] = _ends(t, mean, shown[i], top, a, low[i], high[i])
        before[i] = wanted
