"""From a pose to control points: group displacements, the jaw's arc, lids on the eyeball."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.head.model.data import HeadData, Jaw, PartData
from surface.head.model.meshes import domain_of, make_surface
from surface.head.model.parameters import SHAPES, Pose, rotation
from surface.head.model.rules import Drivers
from surface.head.posing.contact import LID_MM, ContactSolver, EyeballClearance, Follower
from surface.head.posing.kernels import keep_on_eyeball, mix_rows, swing_jaw
from surface.head.posing.moves import Moves

CLEARANCE_GRID = (72, 36)  # places looked at all over what lines the lids, along u and v
CLEARANCE_RADII = 1.4  # in radii: so near to an eye what lines its lids is kept out of it
_PLACE = {name: i for i, name in enumerate(SHAPES)}


class SkinRig:
    """Control points of one deforming part.

    Apply functions write into buffers made here; nothing grows while a face runs. What a pose asks of the part is
    worked out again only where it differs from the pose before.

    Parameters
    ----------
    part : its groups may name any of :data:`SHAPES` and the head's rules; others are left out.
    head : pivots, the jaw's path, rules, contacts.
    drivers : the head's, where several parts share them.

    Attributes
    ----------
    rest : (n, 3) float64, control points at rest; whoever changes them calls :meth:`invalidate`.
    points : (n, 3) float64, control points of the last pose.
    version : grows whenever ``points`` is worked out anew.
    invalidations : grows with every :meth:`invalidate`.
    """

    def __init__(self, part: PartData, head: HeadData, drivers: Drivers | None = None) -> None:
        n = len(part.points)
        self.rest = np.ascontiguousarray(part.points, np.float64)
        self._drivers = drivers or Drivers(head.rules)
        self._moves = Moves(part, self._drivers.names)
        self._open, self._jaw = part.jaw.astype(np.float64), head.jaw
        self._swings, self._whole = bool(self._open.any()), jaw_path(head.jaw, 1.0)
        self._undo = _undo_share(part)
        self._solvers, self._followers = _contacts(part, head)
        self._clearances = _clearances(part, head)
        self._lids = Lids(part, head, self._moves)
        self._amounts = np.zeros(len(self._moves.used))
        self._last_key: tuple[object, ...] = ()
        self._pushes: dict[str, Floats] = {}
        self.points = np.zeros((n, 3))
        self.version = self.invalidations = 0

    def apply(self, pose: Pose) -> Floats:
        """Positions (n, 3) of all control points before the head turns.

        The array is the rig's own and is overwritten each time. A part whose opening has contacts leaves what
        they ask for in ``pose.pushes``.
        """
        np.take(self._drivers.amounts(pose.shapes), self._moves.used, out=self._amounts)
        asked = self._pose_key(pose)
        if asked != self._last_key:
            self._last_key = asked
            self._evaluate(pose)
            self.version += 1
        pose.pushes.update(self._pushes)
        return self.points

    def invalidate(self) -> None:
        """Work everything out anew at the next pose: the points at rest have been changed."""
        self._last_key = ()
        self.invalidations += 1

    def apply_contacts(self, pose: Pose, points: Floats) -> None:
        """Let the part's own openings close, and what goes with others' openings follow, in control points (n, 3) that
        everything else has moved; what the openings ask for is left in ``pose.pushes``. The rig's own pose stays."""
        for solver in self._solvers:
            axis = optical_axis(pose.gaze[max(solver.contact.eye, 0)])
            pose.pushes[solver.contact.name] = solver.apply(axis, points)
        for name, follower in self._followers:
            if name in pose.pushes:
                follower.apply(pose.pushes[name], points)
        for eye, lining in self._clearances:
            lining.apply(optical_axis(pose.gaze[eye]), points)

    def _pose_key(self, pose: Pose) -> tuple[object, ...]:
        """All that the part's points depend on, to compare with the pose before."""
        jaw = (pose.jaw, pose.closed) if self._swings else ()
        gaze = pose.gaze.tobytes() if self._solvers or self._clearances else b""
        pushes = (pose.pushes[name].tobytes() for name, _ in self._followers if name in pose.pushes)
        return self._amounts.tobytes(), jaw, gaze, *pushes

    def _evaluate(self, pose: Pose) -> None:
        """Groups, jaw, lids and contacts, one after the other."""
        np.copyto(self.points, self.rest)
        self._moves.add(self._amounts, self.points)
        if pose.jaw > 0 and self._swings:
            turn, shift = jaw_path(self._jaw, pose.jaw)
            full_turn, full_shift = self._whole
            undo = self._undo * pose.closed
            swing_jaw(self.rest, self._open, turn, shift, full_turn * pose.jaw, full_shift * pose.jaw,
                      pose.jaw, undo, self.points)  # fmt: skip
        self._lids.apply(self._amounts, self.points)
        self.apply_contacts(pose, self.points)
        own = (solver.contact.name for solver in self._solvers)
        self._pushes = {name: pose.pushes[name].copy() for name in own}  # others may use the solvers meanwhile


class Lids:
    """Keeps the lids of one part at their distance from the eyeballs while they slide.

    Parameters
    ----------
    part : its ``lids`` say which points and how closely; head : the eyes; moves : what its groups do.
    """

    def __init__(self, part: PartData, head: HeadData, moves: Moves) -> None:
        self._ids = np.flatnonzero(part.lids).astype(np.int64)
        self._hold = np.abs(part.lids[self._ids])
        self._eye = head.eyes[(part.lids[self._ids] < 0).astype(int)]
        from_eye = part.points[self._ids] - self._eye
        self._rest = np.linalg.norm(from_eye, axis=1)
        self._moves = np.linalg.norm(from_eye + moves.at(self._ids), axis=2) - self._rest
        self._radius = self._rest.copy()
        self._least = np.minimum(self._rest, head.eye_radius + LID_MM)

    def apply(self, amounts: Floats, points: Floats) -> None:
        """Set the distance of the lids' points among ``points (n, 3)``; ``amounts (g,)`` of the groups."""
        if len(self._ids):
            mix_rows(amounts, self._moves, self._rest, self._least, self._radius)
            keep_on_eyeball(self._ids, self._eye, self._hold, self._radius, points)


def optical_axis(gaze: Floats) -> Floats:
    """(3,) unit vector along which an eye looks, from yaw and pitch (2,), rad."""
    return np.ascontiguousarray(rotation(*gaze)[:, 2])


def _contacts(part: PartData, head: HeadData) -> tuple[list[ContactSolver], list[tuple[str, Follower]]]:
    """What keeps the part's own openings from crossing, and what moves its points with other parts' openings."""
    solvers, followers = [], []
    for contact in head.contacts:
        if contact.part == part.name:
            solvers.append(ContactSolver(contact, part, make_surface(part), head))
        elif part.name in contact.followers:
            opening = next(p for p in head.parts if p.name == contact.part)
            follower = Follower(contact, part.points, make_surface(opening), head)
            followers.append((contact.name, follower))
    return solvers, followers


def _clearances(part: PartData, head: HeadData) -> list[tuple[int, EyeballClearance]]:
    """What keeps the part out of the eyeballs, if it is sewn to lids from behind."""
    lids = [c for c in head.contacts if c.eye >= 0 and part.name in c.followers]
    if not any(s.part_b == part.name and s.part_a == c.part for s in head.seams for c in lids):
        return []
    domain, surface = domain_of(part), make_surface(part)
    u0, u1, v0, v1 = domain.rect
    grid = np.stack(
        np.meshgrid(np.linspace(u0, u1, CLEARANCE_GRID[0]), np.linspace(v0, v1, CLEARANCE_GRID[1])), axis=-1
    )
    places = grid.reshape(-1, 2)[domain.inside(grid.reshape(-1, 2))]
    at, out = surface.evaluate(places), []
    for eye in (c.eye for c in lids):
        local = at - head.eyes[eye]
        near = (np.linalg.norm(local, axis=1) < CLEARANCE_RADII * head.eye_radius) & (local[:, 2] > 0.0)
        if near.any():
            out.append((eye, EyeballClearance(surface, places[near], head.eyes[eye], head.eye_radius)))
    return out


def _undo_share(part: PartData) -> Floats:
    """(n,) how much of the jaw's motion mouthClose takes back at each point, 0..1."""
    close = np.zeros_like(part.points)
    for g in part.groups:
        if g.name == "mouthClose":
            close[g.ids] = g.moves
    share: Floats = np.clip(np.linalg.norm(close, axis=1) / 20.0, 0.0, 1.0)
    return share


def jaw_path(jaw: Jaw, amount: float) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and shift (3,) of the lower jaw, opened by ``amount``: p -> turn @ p + shift.

    A rotation about the hinge plus a glide of the hinge, both growing with the amount.
    """
    turn = rotation(0.0, jaw.angle_rad * amount)
    centre = np.array(jaw.centre)
    return turn, centre - turn @ centre + amount * np.array(jaw.glide)


def motion_key(follows: str, head: HeadData, pose: Pose) -> tuple[float, ...]:
    """All that the motion of a part fixed to skull, jaw or an eye depends on, before the head turns."""
    if follows == "jaw":
        return (pose.jaw, *(float(pose.shapes[_PLACE[name]]) for name in head.jaw.tilts))
    if follows in ("left_eye", "right_eye"):
        yaw, pitch = pose.gaze[int(follows == "right_eye")]
        return float(yaw), float(pitch)
    return ()


def rigid_motion(follows: str, head: HeadData, pose: Pose) -> tuple[Floats, Floats]:
    """Linear part (3, 3) and shift (3,) of a part that is fixed to skull, jaw or an eye, before the head turns.

    Control points of a rational surface may be moved by any affine map: the surface follows exactly.
    """
    linear, shift = np.eye(3), np.zeros(3)
    if follows == "jaw":
        linear, shift = jaw_path(head.jaw, pose.jaw)
        for name, tilt in head.jaw.tilts.items():
            amount = pose.shapes[_PLACE[name]]
            linear, shift = linear + amount * tilt[:, :3], shift + amount * tilt[:, 3]
    elif follows in ("left_eye", "right_eye"):
        side = int(follows == "right_eye")
        linear = rotation(*pose.gaze[side])
        shift = head.eyes[side] - linear @ head.eyes[side]
    return linear, shift
