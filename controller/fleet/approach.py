"""Meets a moving face within the limits of speed and acceleration, and then is exactly that face; no I/O here.

A filter that follows a face lags behind it for as long as anything accelerates, so it would never be exactly there
while the face lives. Here what is shown makes the face's own step, and beside it closes the distance that is left along
the braking curve of :mod:`controller.motion.motion`. Each parameter is met by itself, and stays met.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters

_SHARE = 0.6
"""How much of the limits closing a distance may use, beside the motion of the face itself."""
_BRAKE = 0.8
"""How much of the acceleration braking before the end of a range may count on, as steps differ in length."""
_SETTLE_S = 0.03
"""Time constant of the end of the way."""
_NEAR = 1e-5
"""From so near on, in units of a parameter, it is met: a hundredth of a step of a servo."""


class Approach:
    """What is shown, on its way to a face that moves.

    Attributes
    ----------
    met : (P,) bool, which parameters are exactly those of the face, and stay so until :meth:`begin` or :meth:`part`.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self.met: Flags = np.zeros(len(parameters), dtype=bool)
        self._shown, self._face = parameters.neutral(), parameters.neutral()
        self._speed, self._step_s = np.zeros(len(parameters)), 0.0

    def begin(self, shown: Floats, speed: Floats, step_s: float, face: Floats) -> None:
        """Start from what is shown, (P,), which moved at ``speed`` : (P,) in units/s in its last step of ``step_s`` s;
        ``face`` : (P,) where the face was then."""
        self._shown[:], self._speed[:], self._step_s = shown, speed, step_s
        self.follow(face)

    def follow(self, face: Floats) -> None:
        """Be on the way to another face, which is at ``face`` : (P,) now."""
        self._face[:] = face
        self.met[:] = False

    def step(self, dt: float, face: Floats, out: Floats, *, stay: bool, passed_s: float | None = None) -> None:
        """Write to ``out`` : (P,) what is shown ``dt`` s later, when the face is at ``face`` : (P,).

        stay : what has met the face is exactly there from now on; else it has no more than the limits allow. passed_s :
        the time in which the face moved so far, ``dt`` where it is not given; what has met it moved for as long.
        """
        if dt <= 0.0:
            out[:] = self._shown
            return
        wanted = (face - self._face) / dt + self._closing(self._shown - self._face, dt)
        speed = self._limited(wanted, dt)
        np.add(self._shown, speed * dt, out=out)
        np.clip(out, self._p.low, self._p.high, out=out)
        if stay:
            self.met |= np.abs(out - face) < _NEAR
            np.copyto(out, face, where=self.met)
        moved = out - self._shown
        np.divide(moved, dt, out=self._speed)
        if passed_s is not None and passed_s > 0.0:
            np.divide(moved, passed_s, out=self._speed, where=self.met)
        self._shown[:], self._face[:], self._step_s = out, face, dt

    def _closing(self, distance: Floats, dt: float) -> Floats:
        """(P,) speed that closes a distance, so that it can be braked before its end."""
        settle, size = max(_SETTLE_S, dt), np.abs(distance)
        brake = _SHARE * self._p.max_acceleration
        curve = np.sqrt(np.maximum(2.0 * brake * (size - 0.5 * brake * settle * settle), 0.0))
        speed = np.where(size <= brake * settle * settle, size / settle, curve)
        return -np.sign(distance) * np.minimum(speed, _SHARE * self._p.max_speed)

    def _limited(self, wanted: Floats, dt: float) -> Floats:
        """(P,) the nearest speed that limits allow, and from which the end of the range is not passed."""
        p = self._p
        change = p.max_acceleration * 0.5 * (dt + (self._step_s or dt))
        speed = np.clip(wanted, self._speed - change, self._speed + change)
        most, least = self._stoppable(p.high - self._shown, dt), self._stoppable(self._shown - p.low, dt)
        return np.clip(speed, -np.minimum(least, p.max_speed), np.minimum(most, p.max_speed))

    def _stoppable(self, room: Floats, dt: float) -> Floats:
        """(P,) the greatest speed that can be braked to rest within ``room`` : (P,) after a step of ``dt`` s."""
        brake = _BRAKE * self._p.max_acceleration
        found: Floats = np.sqrt((brake * dt) ** 2 + 2.0 * brake * np.maximum(room, 0.0)) - brake * dt
        return found
