"""From a pose to control points: group displacements, the jaw's arc, lids on the eyeball."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.head.data import HeadData, Jaw, PartData
from surface.head.kernels import keep_on_eyeball, swing_jaw
from surface.head.parameters import SHAPES, Pose, rotation

Floats = NDArray[np.float64]
LID_MM = 1.2  # a lid is this thick: what rests nearer to the eyeball than that never sinks further


class SkinRig:
    """Control points of one deforming part.

    Apply functions write into buffers made here; nothing grows while a face runs.

    Parameters
    ----------
    part : its groups may name any of :data:`SHAPES`; others are left out.
    head : pivots and the jaw's path.
    """

    def __init__(self, part: PartData, head: HeadData) -> None:
        n = len(part.points)
        self.rest = np.ascontiguousarray(part.points, np.float64)
        self.used, self._moves = _stack(part)
        self._open, self._jaw = part.jaw.astype(np.float64), head.jaw
        self._undo = _undo_share(part)
        self._lid = np.flatnonzero(part.lids).astype(np.int64)
        self._lid_hold = np.abs(part.lids[self._lid])
        self._lid_eye = head.eyes[(part.lids[self._lid] < 0).astype(int)]
        self._radius, self._radius_moves = self._radii()
        self._least = np.minimum(self._radius, head.eye_radius + LID_MM)
        self._amounts = np.zeros(len(self.used), np.float32)
        self._linear = np.zeros(3 * n, np.float32)
        self.points = np.zeros((n, 3))

    def _radii(self) -> tuple[Floats, Floats]:
        """Distances of the lid points from the eyeball's centre, and what every group at 1 adds to them."""
        from_eye = self.rest[self._lid] - self._lid_eye
        rest = np.linalg.norm(from_eye, axis=1)
        moves = self._moves.reshape(len(self.used), len(self.rest), 3)[:, self._lid]
        return rest, np.linalg.norm(from_eye + moves, axis=2) - rest

    def apply(self, pose: Pose) -> Floats:
        """Positions (n, 3) of all control points before the head turns.

        The array is the rig's own and is overwritten each time.
        """
        self._amounts[:] = pose.shapes[self.used]
        np.dot(self._amounts, self._moves, out=self._linear)
        np.add(self.rest, self._linear.reshape(-1, 3), out=self.points)
        if pose.jaw > 0:
            turn, shift = jaw_path(self._jaw, pose.jaw)
            full_turn, full_shift = jaw_path(self._jaw, 1.0)
            undo = self._undo * pose.closed
            swing_jaw(self.rest, self._open, turn, shift, full_turn * pose.jaw, full_shift * pose.jaw,
                      pose.jaw, undo, self.points)  # fmt: skip
        if len(self._lid):
            radius = self._radius + self._amounts.astype(np.float64) @ self._radius_moves
            np.maximum(radius, self._least, out=radius)
            keep_on_eyeball(self._lid, self._lid_eye, self._lid_hold, radius, self.points)
        return self.points


def _stack(part: PartData) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Indices into SHAPES of the part's groups, and their displacements (g, 3 n)."""
    groups = [g for g in part.groups if g.name in SHAPES]
    moves = np.zeros((len(groups), len(part.points), 3), np.float32)
    for row, g in zip(moves, groups, strict=True):
        row[g.ids] = g.moves
    used = np.array([SHAPES.index(g.name) for g in groups], np.int64)
    return used, moves.reshape(len(groups), 3 * len(part.points))


def _undo_share(part: PartData) -> Floats:
    """(n,) how much of the jaw's motion mouthClose takes back at each point, 0..1."""
    close = np.zeros_like(part.points)
    for g in part.groups:
        if g.name == "mouthClose":
            close[g.ids] = g.moves
    return np.clip(np.linalg.norm(close, axis=1) / 20.0, 0.0, 1.0)


def jaw_path(jaw: Jaw, amount: float) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and shift (3,) of the lower jaw, opened by ``amount``: p -> turn @ p + shift.

    A rotation about the hinge plus a glide of the hinge, both growing with the amount.
    """
    turn = rotation(0.0, jaw.angle_rad * amount)
    centre = np.array(jaw.centre)
    return turn, centre - turn @ centre + amount * np.array(jaw.glide)


def rigid_motion(follows: str, head: HeadData, pose: Pose) -> tuple[Floats, Floats]:
    """Linear part (3, 3) and shift (3,) of a part that is fixed to skull, jaw or an eye, before the head turns.

    Control points of a rational surface may be moved by any affine map: the surface follows exactly.
    """
    linear, shift = np.eye(3), np.zeros(3)
    if follows == "jaw":
        linear, shift = jaw_path(head.jaw, pose.jaw)
        for name, tilt in head.jaw.tilts.items():
            amount = pose.shapes[SHAPES.index(name)]
            linear, shift = linear + amount * tilt[:, :3], shift + amount * tilt[:, 3]
    elif follows in ("left_eye", "right_eye"):
        side = int(follows == "right_eye")
        linear = rotation(*pose.gaze[side])
        shift = head.eyes[side] - linear @ head.eyes[side]
    return linear, shift
