"""Rods between the horns of servos and a plate on a joint: kinematics of necks and of Stewart platforms.

A plate turns about a joint, and may also shift; each servo's horn holds one end of a rod of fixed length, the plate the
other. The angle of a horn that fits a pose of the plate follows from the law of cosines: with d from the axle to the
rod's end on the plate, h the horn at angle 0 and g = axis x h,

    |d - h cos t - g sin t| = rod    <=>    d.h cos t + d.g sin t = (|d|^2 + |h|^2 - rod^2) / 2.

Coordinates in mm: x to the head's own left, y up, z forward, from the joint. Angles follow omote's: yaw about y, then
pitch about x (+ looks down), then roll about z (+ raises the left side).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from controller.base.parameters import Floats

POSE = ("x", "y", "z", "yaw", "pitch", "roll")
"""Inputs of a plate: mm and degrees."""

_HALVINGS = 24
_MAX_CONDITION = 200.0  # condition number of the motion at rest beyond which a pose is not determined
_MM_PER_DEG = 1.0  # mm that weigh as much as a degree in the condition number


def turn(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Floats:
    """(3, 3) rotation: roll about z first, then pitch about x, then yaw about y."""
    (cy, cp, cr), (sy, sp, sr) = ([f(np.radians(a)) for a in (yaw_deg, pitch_deg, roll_deg)] for f in (cos, sin))
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    about_z = np.array([[cr, -sr, 0.0], [sr, cr, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = about_y @ about_x @ about_z
    return turned


@dataclass(frozen=True)
class Rods:
    """``n`` servos with rods to one plate.

    inputs : (k,) places in :data:`POSE` that move the plate. plate, axle : (n, 3) mm, where the rods hold the plate at
    rest, and the axles. horn, across : (n, 3) mm, the horns at angle 0 and at 90 degrees. rod_mm : (n,).
    side : (n,) which of the two solutions is the horn's, +1 or -1.
    """

    inputs: tuple[int, ...]
    plate: Floats
    axle: Floats
    horn: Floats
    across: Floats
    rod_mm: Floats
    side: Floats

    @classmethod
    def of(cls, inputs: tuple[str, ...], plate: Floats, axle: Floats, horn: Floats, axis: Floats) -> Rods:
        """Rods as long as they are at rest, with every horn at angle 0. All arrays (n, 3) mm; axis of any length.

        Raises ValueError: a horn along its axis or of no length, or a motion that does not determine the plate.
        """
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        horn = horn - axis * (horn * axis).sum(axis=1, keepdims=True)
        if not (np.linalg.norm(horn, axis=1) > 1e-6).all():
            raise ValueError("horn must not lie along axis")
        across, rod = np.cross(axis, horn), np.linalg.norm(plate - axle - horn, axis=1)
        side = np.where(((plate - axle) * across).sum(axis=1) > 0.0, -1.0, 1.0)
        made = cls(tuple(map(POSE.index, inputs)), plate, axle, horn, across, rod, side)
        made._check()
        return made

    def angles(self, inputs: Floats) -> tuple[Floats, bool]:
        """(n,) degrees for inputs (k,) in mm and degrees, and whether the inputs are unreachable.

        Then the angles belong to the furthest reachable pose on the straight way from rest to the inputs.
        """
        found = self._solve(inputs)
        if found is not None:
            return found, False
        low, high, best = 0.0, 1.0, np.zeros(len(self.rod_mm))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            found = self._solve(middle * inputs)
            low, high = (middle, high) if found is not None else (low, middle)
            best = best if found is None else found
        return best, True

    def _solve(self, inputs: Floats) -> Floats | None:
        """Degrees for a pose; None where a rod does not reach it, or so narrowly that a horn could turn over."""
        pose = np.zeros(6)
        pose[list(self.inputs)] = inputs
        away = self.plate @ turn(*pose[3:]).T + pose[:3] - self.axle
        along, up = (away * self.horn).sum(axis=1), (away * self.across).sum(axis=1)
        half = 0.5 * ((away**2).sum(axis=1) + (self.horn**2).sum(axis=1) - self.rod_mm**2)
        share = half / np.maximum(np.hypot(along, up), 1e-12)
        if not (np.abs(share) <= 1.0).all():
            return None
        angles = np.degrees(np.arctan2(up, along) + self.side * np.arccos(share))
        wrapped: Floats = (angles + 180.0) % 360.0 - 180.0
        return wrapped

    def _check(self) -> None:
        """Raise ValueError where the servos' angles do not determine the plate's pose near rest."""
        rest = self._solve(np.zeros(len(self.inputs)))
        if rest is None or np.abs(rest).max() > 1e-3:
            raise ValueError("the rods do not fit the plate at rest: a horn and its rod lie in one line")
        steps = 0.1 * np.eye(len(self.inputs))
        ends = [(self._solve(step), self._solve(-step)) for step in steps]
        slopes = [(a - b) / 0.2 for a, b in ends if a is not None and b is not None]
        if len(slopes) < len(steps) or np.linalg.cond(np.array(slopes)) > _MAX_CONDITION:
            raise ValueError("these rods do not determine the plate: move one where it turns the plate another way")
