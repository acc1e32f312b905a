"""From a pose to control points: group displacements, the jaw's arc, lids on the eyeball."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.head.contact import LID_MM, Feeler, Follower
from surface.head.data import HeadData, Jaw, PartData
from surface.head.kernels import keep_on_eyeball, swing_jaw
from surface.head.meshes import make_surface
from surface.head.parameters import SHAPES, Pose, rotation
from surface.head.rules import Drivers

Floats = NDArray[np.float64]


class SkinRig:
    """Control points of one deforming part.

    Apply functions write into buffers made here; nothing grows while a face runs.

    Parameters
    ----------
    part : its groups may name any of :data:`SHAPES` and the head's rules; others are left out.
    head : pivots, the jaw's path, rules, contacts.
    """

    def __init__(self, part: PartData, head: HeadData) -> None:
        n = len(part.points)
        self.rest = np.ascontiguousarray(part.points, np.float64)
        self._drivers = Drivers(head.rules)
        self.used, self._moves = _stack(part, self._drivers.names)
        self._open, self._jaw = part.jaw.astype(np.float64), head.jaw
        self._undo = _undo_share(part)
        self._feelers, self._followers = _contacts(part, head)
        self._lids = Lids(part, head, self._moves.reshape(len(self.used), n, 3))
        self._amounts = np.zeros(len(self.used), np.float32)
        self._linear = np.zeros(3 * n, np.float32)
        self.points = np.zeros((n, 3))

    def apply(self, pose: Pose) -> Floats:
        """Positions (n, 3) of all control points before the head turns.

        The array is the rig's own and is overwritten each time. A part whose opening has contacts leaves what
        they ask for in ``pose.pushes``.
        """
        self._amounts[:] = self._drivers.amounts(pose.shapes)[self.used]
        np.dot(self._amounts, self._moves, out=self._linear)
        np.add(self.rest, self._linear.reshape(-1, 3), out=self.points)
        if pose.jaw > 0:
            turn, shift = jaw_path(self._jaw, pose.jaw)
            full_turn, full_shift = jaw_path(self._jaw, 1.0)
            undo = self._undo * pose.closed
            swing_jaw(self.rest, self._open, turn, shift, full_turn * pose.jaw, full_shift * pose.jaw,
                      pose.jaw, undo, self.points)  # fmt: skip
        self._lids.apply(self._amounts, self.points)
        for feeler in self._feelers:
            axis = optical_axis(pose.gaze[max(feeler.contact.eye, 0)])
            pose.pushes[feeler.contact.name] = feeler.apply(axis, self.points)
        for name, follower in self._followers:
            if name in pose.pushes:
                follower.apply(pose.pushes[name], self.points)
        return self.points


class Lids:
    """Keeps the lids of one part at their distance from the eyeballs while they slide.

    Parameters
    ----------
    part : its ``lids`` say which points and how closely; head : the eyes; moves : (g, n, 3) of its groups.
    """

    def __init__(self, part: PartData, head: HeadData, moves: NDArray[np.float32]) -> None:
        self._ids = np.flatnonzero(part.lids).astype(np.int64)
        self._hold = np.abs(part.lids[self._ids])
        self._eye = head.eyes[(part.lids[self._ids] < 0).astype(int)]
        from_eye = part.points[self._ids] - self._eye
        self._rest = np.linalg.norm(from_eye, axis=1)
        self._moves = np.linalg.norm(from_eye + moves[:, self._ids], axis=2) - self._rest
        self._least = np.minimum(self._rest, head.eye_radius + LID_MM)

    def apply(self, amounts: NDArray[np.float32], points: Floats) -> None:
        """Set the distance of the lids' points among ``points (n, 3)``; ``amounts (g,)`` of the groups."""
        if len(self._ids):
            radius = self._rest + amounts.astype(np.float64) @ self._moves
            np.maximum(radius, self._least, out=radius)
            keep_on_eyeball(self._ids, self._eye, self._hold, radius, points)


def optical_axis(gaze: Floats) -> Floats:
    """(3,) unit vector along which an eye looks, from yaw and pitch (2,), rad."""
    return np.ascontiguousarray(rotation(*gaze)[:, 2])


def _contacts(part: PartData, head: HeadData) -> tuple[list[Feeler], list[tuple[str, Follower]]]:
    """What keeps the part's own openings from crossing, and what moves its points with other parts' openings."""
    feelers, followers = [], []
    for contact in head.contacts:
        if contact.part == part.name:
            feelers.append(Feeler(contact, part, make_surface(part), head))
        elif part.name in contact.followers:
            opening = next(p for p in head.parts if p.name == contact.part)
            follower = Follower(contact, part.points, make_surface(opening), head)
            followers.append((contact.name, follower))
    return feelers, followers


def _stack(part: PartData, names: tuple[str, ...]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Indices into ``names`` of the part's groups, and their displacements (g, 3 n)."""
    groups = [g for g in part.groups if g.name in names]
    moves = np.zeros((len(groups), len(part.points), 3), np.float32)
    for row, g in zip(moves, groups, strict=True):
        row[g.ids] = g.moves
    used = np.array([names.index(g.name) for g in groups], np.int64)
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
