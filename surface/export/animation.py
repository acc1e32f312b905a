"""Motion of a head over time, as weights of its shapes and rotations of its head."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import ExportError
from surface.head.model.parameters import EYE_RAD, NAMES, SHAPES, read_pose, rotation

_AT = {name: i for i, name in enumerate(NAMES)}
_LOOK = [[_AT[f"eyeLook{d}{side}"] for d in ("Down", "Up", "Out", "In")] for side in ("Left", "Right")]


@dataclass(frozen=True, eq=False)
class Animation:
    """Values of parameters over time.

    name : for people. times_s : (n,) float64 from 0, ascending. values : (n, 59) float64, in the order of
    :data:`surface.head.model.parameters.NAMES`. own : (n,) how much of each of a user's own groups is shown, by name.

    Raises ExportError: times or values that cannot be.
    """

    name: str
    times_s: Floats
    values: Floats
    own: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rows = self.times_s.shape
        good = len(rows) == 1 and self.values.shape == (*rows, len(NAMES)) and rows[0]
        good = good and all(amounts.shape == rows for amounts in self.own.values())
        if not good or self.times_s[0] < 0 or (np.diff(self.times_s) <= 0).any():
            raise ExportError(f"{self.name}: an animation needs times that rise from 0", hint="check the take")
        if not all(np.isfinite(each).all() for each in (self.values, *self.own.values())):
            raise ExportError(f"{self.name}: holds values that are no numbers", hint="check the take")

    def weights(self) -> Floats:
        """Return (n, 52): weight of every shape, in the order of SHAPES, combined as the head combines them.

        Angles of the eyes become the shapes that turn them, and lids with them; see :func:`read_pose`.
        """
        poses = [read_pose(row) for row in self.values]
        shown = np.array([pose.shapes for pose in poses])
        gaze = np.array([pose.gaze for pose in poses]) / EYE_RAD
        for side, (down, up, out, inward) in enumerate(_LOOK):
            outward, pitch = gaze[:, side, 0] * (1 - 2 * side), gaze[:, side, 1]
            for at, amount in ((down, pitch), (up, -pitch), (out, outward), (inward, -outward)):
                shown[:, at] = np.maximum(amount, 0.0)
        return np.clip(shown, 0.0, 1.0, out=shown)

    def weights_of(self, names: Iterable[str]) -> Floats:
        """Return (n, k): weights of shapes and of a user's own groups, by name; 0 of groups that the animation
        lacks.
        """
        shown, still = dict(zip(SHAPES, self.weights().T, strict=True)), np.zeros(len(self.times_s))
        return np.column_stack([shown[name] if name in shown else self.own.get(name, still) for name in names])

    def head_quaternions(self) -> Floats | None:
        """Return (n, 4): rotation of the head, x, y, z, w, of one sign from frame to frame; None where it never
        turns.
        """
        angles = np.array([read_pose(row).head for row in self.values])
        if not angles.any():
            return None
        found = np.array([_quaternion(rotation(*row)) for row in angles])
        found[1:] *= np.cumprod(np.where((found[1:] * found[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))[:, None]
        return found


def _quaternion(matrix: Floats) -> Floats:
    """Return (4,): x, y, z, w of a rotation by less than 180 degrees."""
    w = 0.5 * np.sqrt(max(1.0 + np.trace(matrix), 1e-12))
    axis = np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    found: Floats = np.append(axis / (4.0 * w), w)
    return found / np.linalg.norm(found)
