"""Meets a moving face within the limits of speed and acceleration, and then is exactly that face; no I/O here.

A filter that follows a face lags behind it for as long as anything accelerates, so it would never be exactly there
while the face lives. Here what is shown makes the face's own step, and beside it closes the distance that is left along
the braking curve of :mod:`controller.motion.motion`. Each parameter is met by itself. What was met stays met while the
face keeps within the limits; where it does not, as it jumps or stands still at once, the parameter is led to it again.
No step passes a limit, whatever its length and whatever the face does: :mod:`controller.fleet.reach` says why.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.fleet.reach import pursue


class Approach:
    """What is shown, on its way to a face that moves.

    Attributes
    ----------
    met : (P,) bool, which parameters are exactly those of the face.
    """

    def __init__(self, parameters: Parameters) -> None:
        p = self._p = parameters
        self.met: Flags = np.zeros(len(p), dtype=bool)
        self._limits = np.array([p.max_speed, p.max_acceleration, p.low, p.high], dtype=np.float64)
        self._face, self._motion = p.neutral(), np.zeros((4, len(p)))
        self._shown, self._before, *self._end_speeds = self._motion
        self.begin(self._face)

    def begin(self, shown: Floats) -> None:
        """Start from what is shown, (P,), at whatever speed; it is inside the range."""
        self._shown[:] = shown
        self._end_speeds[0][:], self._end_speeds[1][:] = -self._p.max_speed, self._p.max_speed
        self.follow(shown)

    def follow(self, face: Floats) -> None:
        """Be on the way to another face, which is at ``face`` : (P,) now."""
        self._before[:] = face
        self.met[:] = False

    def step(self, time_s: float, face: Floats, out: Floats, *, stay: bool, passed_s: float | None = None) -> None:
        """Write to ``out`` : (P,) what is shown ``time_s`` later, when the face is at ``face`` : (P,).

        In no time nothing moves, and only what the face already shows is met. A value of the face that is no finite
        number counts as what is shown.

        stay : what meets the face is exactly there. passed_s : the time (s) in which the face moved so far, ``time_s``
        where it is not given.
        """
        if time_s > 0.0:
            passed_s = time_s if passed_s is None else passed_s
            self._face[:] = face  # which may be read-only
            pursue(time_s, passed_s, stay, self._face, self.met, self._motion, self._limits)
        else:
            self.met &= self._shown == face
        out[:] = self._shown
