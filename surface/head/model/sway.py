"""What moves beside the parameters: hair that lags behind the head, a damped spring for each of the head's angles, and
a bust that rises with each breath, a displacement by place, so that every head whose neck ends in one has it."""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

import numpy as np

from surface.base.arrays import Floats
from surface.head.model.data import Neck
from surface.head.model.parameters import smoothstep

SWAYS = ("swayYaw", "swayPitch", "swayRoll")
"""Groups of what sways, per radian by which it lies ahead of the head."""
_AXES = np.eye(3)[[1, 0, 2]]  # yaw turns about y, pitch about x, roll about z
_HZ, _DAMPING = 2.1, 0.38  # of hair as long as a head, chosen by eye; damping 1 has no overshoot
_MAX_RAD, _MAX_S = 0.16, 0.5
STEP_MM = 1.0 / 64.0
"""Breaths that differ by less are drawn alike, so that a chest that hardly moves is not computed again."""
WIDEST = 0.25
"""Share by which pupils may be wider or narrower than the light makes them."""
_FRONT = -0.6, 0.9  # from the neck's pivot, in lengths of the neck's bend: from behind it to the breast bone
_SIDE, _HALF = 0.35, 1.7  # how far shoulders go outwards, and half the width of a bust, in the same lengths
_LEAST = 1e-4


def sway_moves(points: Floats, share: Floats, pivot: tuple[float, float, float]) -> Floats:
    """Return (3, n, 3): displacements of points (n, 3) for a radian about each axis through ``pivot``, by ``share
    (n,)``."""
    return np.array([np.cross(axis, points - np.array(pivot)) * share[:, None] for axis in _AXES])


class Sway:
    """What sways, at the times that :meth:`advance` is given; equal times and angles give equal motion.

    lag : (3,) yaw, pitch and roll, rad, by which it lies ahead of the head; 0 at rest and before any time is given.
    """

    def __init__(self) -> None:
        self.lag = np.zeros(3)
        self._speed, self._angles, self._time_s = np.zeros(3), np.zeros(3), -1.0

    def advance(self, angles: Floats, time_s: float) -> None:
        """Move on to a time, at which the head has turned to ``angles`` (3,), rad.

        The oscillator is solved exactly for the time between (constant angles), so it is stable for every step.
        """
        step, first = time_s - self._time_s, self._time_s < 0.0
        lag = self.lag - (angles - self._angles)
        self._angles, self._time_s = np.array(angles, float), time_s
        if first or not 0.0 <= step < _MAX_S:
            self.lag, self._speed = np.zeros(3), np.zeros(3)
            return
        own = 2.0 * pi * _HZ
        turned = own * sqrt(1.0 - _DAMPING**2)
        fall, c, s = exp(-_DAMPING * own * step), cos(turned * step), sin(turned * step)
        pull = (self._speed + _DAMPING * own * lag) / turned
        self.lag = np.clip(fall * (lag * c + pull * s), -_MAX_RAD, _MAX_RAD)
        self._speed = fall * (self._speed * c - (_DAMPING * own * pull + turned * lag) * s)
        if np.abs(self.lag).max() < 1e-4 and np.abs(self._speed).max() < 1e-3:  # at rest nothing is drawn again
            self.lag, self._speed = np.zeros(3), np.zeros(3)


def breath_moves(points: Floats, neck: Neck) -> Floats:
    """Return (n, 3): displacement of points at rest (n, 3) for each mm by which the chest rises.

    Where the neck follows the head nothing moves, and from there down more and more. The front goes up and forwards
    alike, as the third ribs do, less to the sides (De Groote et al., "Chest wall motion during tidal breathing", J.
    Appl. Physiol. 83, 1997); the back goes up only.
    """
    length = neck.whole - neck.still
    share = (1.0 - neck.share(points)) ** 2
    local = (points - np.array(neck.pivot)) / length
    front = smoothstep(local[:, 2], *_FRONT)
    side = _SIDE * np.clip(local[:, 0] / _HALF, -1.0, 1.0)
    moves: Floats = share[:, None] * np.column_stack([side, 0.6 + 0.4 * front, front])
    moves[np.abs(moves).max(axis=1, initial=0.0) < _LEAST] = 0.0
    return moves
