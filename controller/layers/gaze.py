"""Splits the direction of the gaze, or a point to look at, between eyes and head.

The head turns by a fraction of what exceeds a comfortable eye angle; the eyes make up the difference to where the head
is *now*. So on a large shift the eyes arrive first and turn back while the head follows, as people's do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from controller.base.parameters import Floats, Parameters

EYE_OFFSET_MM = 32.0
"""Distance of an eye's centre from the midpoint between the eyes."""

Pair = Sequence[float] | Floats

_NAMES = ("headYaw", "headPitch", "leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch")
_HEAD_FRACTION = 0.75
_COMFORT_YAW_RAD = math.radians(8.0)
_COMFORT_PITCH_RAD = math.radians(6.0)


class Gaze:
    """Turns a direction or a point into head and eye parameters.

    Directions are relative to the head's zero pose: yaw + to the subject's left, pitch + down.
    The parameters must include the angles of head and eyes.

    indices : (6,) indices of the parameters that it drives. active : whether there is anything to look at.
    shift_rad : angle by which the last command moved the gaze.
    """

    def __init__(self, parameters: Parameters) -> None:
        self.indices = parameters.indices(_NAMES)
        self.active = False
        self.shift_rad = 0.0
        self._scale = parameters.full_scale_rad[self.indices]
        self._yaw = np.zeros(2)
        self._pitch = 0.0

    def look(self, yaw_rad: float, pitch_rad: float) -> None:
        """Look in a direction, with parallel eyes."""
        self._set_direction(yaw_rad, yaw_rad, pitch_rad)

    def look_at(self, x_mm: float, y_mm: float, z_mm: float) -> None:
        """Look at a point; x to the subject's left, y up, z forward from the midpoint between the eyes."""
        left, right = math.atan2(x_mm - EYE_OFFSET_MM, z_mm), math.atan2(x_mm + EYE_OFFSET_MM, z_mm)
        self._set_direction(left, right, math.atan2(-y_mm, math.hypot(x_mm, z_mm)))

    def off(self) -> None:
        """Look at nothing in particular."""
        self.active = False

    @property
    def direction_deg(self) -> tuple[float, float]:
        """Yaw and pitch, in degrees, of the mean direction of both eyes."""
        return math.degrees(float(self._yaw.mean())) + 0.0, math.degrees(self._pitch) + 0.0

    def _set_direction(self, left_rad: float, right_rad: float, pitch_rad: float) -> None:
        before = float(self._yaw.mean()), self._pitch
        self._yaw[:] = left_rad, right_rad
        self._pitch = pitch_rad
        self.shift_rad = math.hypot(float(self._yaw.mean()) - before[0], pitch_rad - before[1])
        self.active = True

    def update(self, present: Floats, eyes_rad: Pair = (0.0, 0.0), head_rad: Pair = (0.0, 0.0)) -> Floats:
        """Return the values (6,) for :attr:`indices`.

        present : (P,) parameters the face shows now.
        eyes_rad, head_rad : yaw and pitch of idle motion, added to the direction of the eyes and to the head.
        """
        yaw, pitch, scale = float(self._yaw.mean()), self._pitch, self._scale
        head = np.array([_head_part(yaw, _COMFORT_YAW_RAD), _head_part(pitch, _COMFORT_PITCH_RAD)]) + head_rad[:2]
        directions = np.array([self._yaw[0], pitch, self._yaw[1], pitch]).reshape(2, 2) + eyes_rad
        eyes = directions - present[self.indices[:2]] * scale[:2]
        return np.clip(np.concatenate([head, eyes.ravel()]) / scale, -1.0, 1.0)


def _head_part(angle: float, comfort: float) -> float:
    """Return the head's part of a gaze angle (rad)."""
    return math.copysign(max(0.0, abs(angle) - comfort) * _HEAD_FRACTION, angle)
