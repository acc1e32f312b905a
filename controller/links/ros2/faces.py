"""Converts faces to and from ROS 2 messages: joint angles, frames, action unit intensities and expression names."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.parameters import Flags, Floats, Indices, Parameters
from controller.links.ros2.definitions import UNITS
from controller.vocabulary.facs import Facs
from surface.head.model.file import load_data
from surface.head.model.joints import BASE, JAW, ROS_AXES, joints_of

EXPRESSIONS = {
    "neutral": "neutral", "angry": "anger", "sad": "sadness", "happy": "happiness", "surprised": "surprise",
    "disgusted": "disgust", "scared": "fear",
}  # fmt: skip
"""omote's name for each expression of hri_msgs/Expression that has a constant; other names are used unchanged."""
_UNIT = re.compile(r"[LR]?(\d+)")
_JAW_SIDEWAYS = 30
"""Action unit that has no effect here, because its number does not say to which side the jaw moves."""


@dataclass(frozen=True)
class Frame:
    """The pose of a link in its parent. position_m : (3,). rotation : (4,), quaternion x y z w."""

    parent: str
    name: str
    position_m: Floats
    rotation: Floats


class HeadJoints:
    """The joints of a head and the parameters that turn them.

    parameters : of the face. head : the head's folder.

    Attributes
    ----------
    names : names of the joints, parents first. indices : (joints,) int64, index of each joint's parameter.

    Raises HeadFileError: the head cannot be read.
    """

    def __init__(self, parameters: Parameters, head: Path) -> None:
        data = load_data(head)
        self._joints = [joint for joint in joints_of(data) if joint.name in parameters.names]
        self.names = [joint.name for joint in self._joints]
        self.indices: Indices = np.array([parameters.index(name) for name in self.names], np.int64)
        self._low, self._high = parameters.low[self.indices], parameters.high[self.indices]
        full = parameters.full_scale_rad[self.indices]
        self._full: Floats = np.where([name == JAW for name in self.names], data.jaw.angle_rad, full)
        origins = {BASE: np.zeros(3)} | {joint.name: joint.origin for joint in self._joints}
        self._position_m = [ROS_AXES @ (joint.origin - origins[joint.parent]) * 1e-3 for joint in self._joints]

    def angles(self, values: Floats) -> Floats:
        """Return the (joints,) angles, in rad, of a face (P,)."""
        found: Floats = values[self.indices] * self._full
        return found

    def values(self, angles: Floats) -> Floats:
        """Return the (joints,) parameter values for angles in rad, clipped to their ranges; NaN stays NaN."""
        found: Floats = np.clip(angles / self._full, self._low, self._high)
        return found

    def frames(self, values: Floats) -> list[Frame]:
        """Return the pose of each joint's link in its parent for a face (P,)."""
        found = []
        for joint, position_m, angle in zip(self._joints, self._position_m, self.angles(values).tolist(), strict=True):
            rotation = np.array([*(math.sin(0.5 * angle) * np.array(joint.axis)), math.cos(0.5 * angle)])
            found.append(Frame(joint.parent, joint.name, position_m, rotation))
        return found


class ActionUnits:
    """Converts between faces and intensities of action units, arrays that are indexed by FACS number.

    Attributes
    ----------
    moves : (P,) bool, whether any action unit moves the parameter.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._facs = Facs.load(parameters)
        numbered = [(column, _UNIT.fullmatch(name)) for column, name in enumerate(self._facs.names)]
        self._columns = [(column, int(found[1])) for column, found in numbered if found is not None]
        self.moves: Flags = np.asarray((self._facs.matrix != 0.0).any(axis=1))

    def read(self, values: Floats) -> Floats:
        """Return (UNITS,) intensities 0..1 that fit a face (P,) best; the greater of the two sides counts."""
        levels, found = self._facs.read(values), np.zeros(UNITS)
        for column, number in self._columns:
            found[number] = max(found[number], min(float(levels[column]), 1.0))
        return found

    def face(self, intensities: Floats) -> Floats:
        """Return the face (P,) of intensities (UNITS,); NaN counts as 0."""
        levels, given = np.zeros(len(self._facs.names)), np.nan_to_num(np.asarray(intensities, float), posinf=1.0)
        given[_JAW_SIDEWAYS] = 0.0
        for column, number in self._columns:
            levels[column] = min(max(float(given[number]), 0.0), 1.0)
        found: Floats = np.minimum(self._facs.matrix @ levels, 1.0)
        return found


def named_values(
    parameters: Parameters, joints: HeadJoints | None, names: Sequence[str], positions: Sequence[float]
) -> tuple[Floats, Flags, list[str]]:
    """Return the values (P,), the mask (P,) of those that are given, and the unknown names.

    names : of joints, whose positions are angles in rad, or of other parameters, whose positions are their values. A
    position that is not finite does not change its joint or parameter.
    """
    values, mask, unknown = parameters.neutral(), np.zeros(len(parameters), dtype=bool), []
    joint_rows = {} if joints is None else {name: row for row, name in enumerate(joints.names)}
    angles = np.full(len(joint_rows), np.nan)
    for name, position in zip(names, positions, strict=False):
        index = parameters.find(name)
        if name in joint_rows:
            angles[joint_rows[name]] = position
        elif index is None:
            unknown.append(name)
        elif math.isfinite(position):
            values[index], mask[index] = min(max(position, parameters.low[index]), parameters.high[index]), True
    if joints is not None:
        known = np.isfinite(angles)
        indices = joints.indices[known]
        values[indices], mask[indices] = joints.values(angles)[known], True
    return values, mask, unknown


def ros_expression(name: str, names: Mapping[str, str] = EXPRESSIONS) -> str:
    """Return the name of one of omote's expressions in hri_msgs/Expression."""
    return next((theirs for theirs, ours in names.items() if ours == name), name)
