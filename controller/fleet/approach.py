"""Approaches a moving face within the limits of speed and acceleration, and then equals it exactly; no I/O here.

A filter that follows a face lags while the face accelerates, so it would never equal a moving face. Here each step has
the face's own motion, and additionally closes the remaining distance along the braking curve of
:mod:`controller.motion.motion`. Each parameter is handled separately. A parameter that has met the face stays equal
while the face keeps within the limits; if the face jumps or stops suddenly, the parameter approaches it again. No step
exceeds a limit, whatever its length and whatever the face does; :mod:`controller.fleet.reach` explains why.
"""

from __future__ import annotations

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.fleet.reach import pursue


class Approach:
    """The shown values, which approach a moving face.

    Attributes
    ----------
    met : (P,) bool, which parameters equal those of the face exactly.
    """

    def __init__(self, parameters: Parameters) -> None:
        p = self._p = parameters
        self.met: Flags = np.zeros(len(p), dtype=bool)
        self._limits = np.array([p.max_speed, p.max_acceleration, p.low, p.high], dtype=np.float64)
        self._face, self._motion = p.neutral(), np.zeros((4, len(p)))
        self._shown, self._before, *self._end_speeds = self._motion
        self.begin(self._face)

    def begin(self, shown: Floats) -> None:
        """Start at the values ``shown`` : (P,), which are within their ranges, with any speed."""
        self._shown[:] = shown
        self._end_speeds[0][:], self._end_speeds[1][:] = -self._p.max_speed, self._p.max_speed
        self.follow(shown)

    def follow(self, face: Floats) -> None:
        """Approach another face, which is at ``face`` : (P,) now."""
        self._before[:] = face
        self.met[:] = False

    def step(self, time_s: float, face: Floats, out: Floats, *, stay: bool, passed_s: float | None = None) -> None:
        """Write to ``out`` : (P,) the values shown ``time_s`` later, when the face is at ``face`` : (P,).

        If ``time_s`` is 0, only parameters that equal the face are met. A value of the face that is not
        finite is ignored.

        stay : whether parameters may meet the face and then equal it. passed_s : time (s) of the face's motion since
        the last step. Default: ``time_s``.
        """
        if time_s > 0.0:
            passed_s = time_s if passed_s is None else passed_s
            self._face[:] = face  # a copy, because the compiled function needs a writable array
            pursue(time_s, passed_s, stay, self._face, self.met, self._motion, self._limits)
        else:
            self.met &= self._shown == face
        out[:] = self._shown
