"""What a face is in messages of ROS 2: angles of joints, frames, intensities of action units, names of expressions."""

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
"""Names of hri_msgs/Expression, and those of omote that differ; others are asked of the vocabulary as they are."""
_UNIT = re.compile(r"[LR]?(\d+)")
_SIDEWAYS = 30
"""The jaw goes to one side, which the number alone does not name."""


@dataclass(frozen=True)
class Frame:
    """Where a link is in its parent. at_m : (3,). turn : quaternion (4,), x y z w."""

    parent: str
    name: str
    at_m: Floats
    turn: Floats


class HeadJoints:
    """The joints of a head and the parameters that turn them.

    parameters : those of the face. head : the head's folder.

    Attributes
    ----------
    names : of the joints, parents first. indices : (joints,) int64, their places among the parameters.

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
        self._at_m = [ROS_AXES @ (joint.origin - origins[joint.parent]) * 1e-3 for joint in self._joints]

    def angles(self, values: Floats) -> Floats:
        """(joints,) rad of a face (P,)."""
        found: Floats = values[self.indices] * self._full
        return found

    def values(self, angles: Floats) -> Floats:
        """(joints,) values of parameters, within their ranges, for angles in rad; NaN stays."""
        found: Floats = np.clip(angles / self._full, self._low, self._high)
        return found

    def frames(self, values: Floats) -> list[Frame]:
        """Each joint's link in its parent."""
        found = []
        for joint, at_m, angle in zip(self._joints, self._at_m, self.angles(values).tolist(), strict=True):
            turn = np.array([*(math.sin(0.5 * angle) * np.array(joint.axis)), math.cos(0.5 * angle)])
            found.append(Frame(joint.parent, joint.name, at_m, turn))
        return found


class ActionUnits:
    """Intensities of action units, in arrays with one entry for each number of FACS."""

    def __init__(self, parameters: Parameters) -> None:
        self._facs = Facs.load(parameters)
        numbered = [(column, _UNIT.fullmatch(name)) for column, name in enumerate(self._facs.names)]
        self._columns = [(column, int(found[1])) for column, found in numbered if found is not None]
        self.moves: Flags = np.asarray((self._facs.matrix != 0.0).any(axis=1))

    def read(self, values: Floats) -> Floats:
        """(UNITS,) intensities 0..1 that show a face (P,) best: of both sides the greater."""
        levels, found = self._facs.read(values), np.zeros(UNITS)
        for column, number in self._columns:
            found[number] = max(found[number], min(float(levels[column]), 1.0))
        return found

    def face(self, intensities: Floats) -> Floats:
        """(P,) the face of intensities (UNITS,); NaN counts as 0."""
        levels, given = np.zeros(len(self._facs.names)), np.nan_to_num(np.asarray(intensities, float), posinf=1.0)
        given[_SIDEWAYS] = 0.0
        for column, number in self._columns:
            levels[column] = min(max(float(given[number]), 0.0), 1.0)
        found: Floats = np.minimum(self._facs.matrix @ levels, 1.0)
        return found


def named_values(
    parameters: Parameters, joints: HeadJoints | None, names: Sequence[str], positions: Sequence[float]
) -> tuple[Floats, Flags, list[str]]:
    """Values (P,), which of them are given, and the names that mean nothing here.

    Names are those of joints, with angles in rad, or of other parameters, with their values. A position that is no
    finite number leaves its joint or parameter alone.
    """
    values, mask, unknown = parameters.neutral(), np.zeros(len(parameters), dtype=bool), []
    own = {} if joints is None else {name: place for place, name in enumerate(joints.names)}
    angles = np.full(len(own), np.nan)
    for name, position in zip(names, positions, strict=False):
        index = parameters.find(name)
        if name in own:
            angles[own[name]] = position
        elif index is None:
            unknown.append(name)
        elif math.isfinite(position):
            values[index], mask[index] = min(max(position, parameters.low[index]), parameters.high[index]), True
    if joints is not None:
        known = np.isfinite(angles)
        at = joints.indices[known]
        values[at], mask[at] = joints.values(angles)[known], True
    return values, mask, unknown


def ros_expression(name: str, names: Mapping[str, str] = EXPRESSIONS) -> str:
    """How hri_msgs/Expression calls an expression of omote."""
    return next((theirs for theirs, ours in names.items() if ours == name), name)
