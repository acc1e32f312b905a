"""The joints of neck, jaw and eyes of a head, as robot programs see them.

Axes are those of ROS (REP 103): x forward, y left, z up; joints turn about them by the right-hand rule, so that yaw is
positive to the head's own left and pitch downwards. Joints are called as the parameters, and the link ``NAME`` is what
the joint of that name carries.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.head.model.data import HeadData
from surface.head.model.parameters import EYE_RAD, HEAD_RAD

BASE, SKULL, JAW = "base_link", "headRoll", "jawOpen"
ROS_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Head space (x left, y up, z forward) in the axes of ROS."""
_AXES = {"Yaw": (0, 0, 1), "Pitch": (0, 1, 0), "Roll": (1, 0, 0), JAW: (0, 1, 0)}
_SPEED_RAD_S = 6.0


@dataclass(frozen=True)
class JointLimit:
    """Limits of a joint. low_rad, high_rad : its range. speed_rad_s : its top speed."""

    low_rad: float
    high_rad: float
    speed_rad_s: float = _SPEED_RAD_S


@dataclass(frozen=True)
class Joint:
    """A joint, called as its parameter. parent : the link that carries it. origin : (3,) mm, in head space."""

    name: str
    parent: str
    origin: Floats
    limit: JointLimit

    @property
    def axis(self) -> tuple[int, int, int]:
        """What it turns about, in the axes of ROS."""
        return next(axis for ending, axis in _AXES.items() if self.name.endswith(ending))


def joints_of(head: HeadData, limits: Mapping[str, JointLimit] | None = None) -> list[Joint]:
    """Return the joints of a head, parents first.

    limits : by parameter, such as those of a robot's servos; elsewhere the joint turns as far as the parameter does.
    """
    pivot, jaw = np.array(head.neck.pivot), head.jaw
    angles = dict(zip(("headYaw", "headPitch", "headRoll"), HEAD_RAD.tolist(), strict=True))
    found = [("headYaw", BASE, pivot), ("headPitch", "headYaw", pivot), (SKULL, "headPitch", pivot)]
    found.append((JAW, SKULL, np.array(jaw.centre)))
    for side, centre in zip(("left", "right"), head.eyes, strict=False):
        found += [(f"{side}EyeYaw", SKULL, centre), (f"{side}EyePitch", f"{side}EyeYaw", centre)]
        angles |= dict(zip((f"{side}EyeYaw", f"{side}EyePitch"), EYE_RAD.tolist(), strict=True))
    own = {name: JointLimit(-angle, angle) for name, angle in angles.items()}
    own[JAW] = JointLimit(0.0, jaw.angle_rad)
    chosen = {**own, **(limits or {})}
    return [Joint(name, parent, origin, chosen[name]) for name, parent, origin in found]
