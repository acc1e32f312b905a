"""Computes a part's control points for a pose: displacements of groups, rotation of the jaw, lids, contacts."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

import numpy as np

from surface.base.addresses import make_table
from surface.base.arrays import Floats
from surface.head.model.data import HeadData, Jaw, PartData
from surface.head.model.meshes import domain_of, make_surface
from surface.head.model.own_groups import OwnMoves
from surface.head.model.parameters import SHAPES, Pose, rotation
from surface.head.model.rules import Drivers, SealDriver
from surface.head.model.sway import SWAYS, breath_moves
from surface.head.posing.contact import FORWARD, LID_MM, ContactSolver, EyeballClearance, Follower
from surface.head.posing.kernels import hold_lids, swing_jaw
from surface.head.posing.moves import Moves
from surface.head.posing.tongue import tongue_rest

CLEARANCE_GRID = (72, 36)  # samples of the part behind the lids, along u and v
CLEARANCE_RADII = 1.4  # distance in eyeball radii below which points behind the lids are kept outside the eyeball
LID_WAY_MM = 20.0
"""Points of what lines the lids that a group moves further than any lid goes are not kept at their distance from the
eyeball. Least squares sends those so far that hardly act, and distances of several groups do not add up there."""
UNDONE_MM = 20.0  # displacement by mouthClose that takes back the whole motion of the jaw
OWN_PARTED_MM = 2.0
"""Own changes that part the lips by so much open them in full. The seal says by what share of it lips stay together."""
_PLACE = {name: i for i, name in enumerate(SHAPES)}


class SkinRig:
    """Control points of one deforming part; they are computed again only where a pose differs from the one before.

    Parameters
    ----------
    part : its groups may name any of :data:`SHAPES` and the head's rules; others are left out.
    head : pivots, the jaw's path, rules, contacts.
    drivers : of corrective groups; several parts of a head share one.

    Attributes
    ----------
    rest : (n, 3) float64, control points at rest; whoever changes them calls :meth:`invalidate`.
    own : what groups of a user move of it; set before the first pose.
    points : (n, 3) float64, control points of the last pose; the same array for every pose.
    version : grows whenever ``points`` is computed; invalidations : grows with every :meth:`invalidate`.
    """

    def __init__(self, part: PartData, head: HeadData, drivers: Drivers | None = None) -> None:
        self.rest = np.ascontiguousarray(part.points, np.float64)
        self._drivers = drivers or Drivers(head.rules)
        self._moves, self._sways = Moves(part, self._drivers.names), Moves(part, SWAYS)
        breath = breath_moves(part.points.astype(np.float64), head.neck)
        self._breathing = np.flatnonzero(breath.any(axis=1))
        self._breath = breath[self._breathing]
        self._open, self._jaw = part.jaw.astype(np.float64), head.jaw
        self._swings, self._whole = bool(self._open.any()), jaw_path(head.jaw, 1.0)
        self._undo = _undo_share(part)
        own = [c for c in head.contacts if c.part == part.name]
        others = [c for c in head.contacts if c.part != part.name and part.name in c.followers]
        surfaces = {p.name: make_surface(p) for p in head.parts if p.name in {c.part for c in (*own, *others)}}
        self._solvers = [ContactSolver(c, surfaces[c.part], head) for c in own]
        self._seals = [SealDriver(c.seal) for c in own]
        before = self.rest.copy()
        pairs = zip(self._solvers, own, strict=True)
        self._openings = [OwnOpenings(solver, before) if contact.seal else None for solver, contact in pairs]
        self._measured = False  # are these those of the present points at rest?
        self._followers = [(c.name, Follower(c, part.points, surfaces[c.part], head)) for c in others]
        self._clearances = _clearances(part, head)
        lips = any(c.eye < 0 and c.part != part.name for c in head.contacts)
        tongue = part.material == "tongue" and part.name  # parts joined in one have no name
        out = lips and tongue and any(g.name == "tongueOut" for g in part.groups)  # it moves teeth and skin, too
        self._head, self._rest = head, tongue_rest(part, head) if out else None
        self._lids = Lids(part, head, self._moves)
        self._amounts = np.zeros(len(self._moves.used))
        self._last_key: tuple[object, ...] = ()
        self._pushes: dict[str, Floats] = {}
        self.own: Sequence[OwnMoves] = ()
        self.points = np.zeros_like(self.rest)
        self.version = self.invalidations = 0

    def move_all(self, poses: Sequence[Pose]) -> Floats:
        """Return (h, n, 3): control points as groups alone move them in each of the poses: what :meth:`apply` takes."""
        amounts = np.array([self._drivers.amounts(pose.shapes)[self._moves.used] for pose in poses])
        moved = self._moves.add_all(amounts.reshape(len(poses), -1), self.rest)
        for pose, points in zip(poses, moved, strict=True):
            self._add_own(pose, points)
        return moved

    def apply(self, pose: Pose, moved: Floats | None = None) -> Floats:
        """Return the positions (n, 3) of all control points before the head turns, overwritten by the next call.

        Corrections at the part's own contacts are put into ``pose.pushes``, and those of lips into ``pose.lip``.
        moved : (n, 3) positions as moved by groups alone, if known.
        """
        self._drivers.amounts(pose.shapes).take(self._moves.used, out=self._amounts, mode="clip")  # unbuffered
        key = self._pose_key(pose)
        if key != self._last_key:
            self._last_key = key
            self._evaluate(pose, moved)
            self.version += 1
        pose.pushes.update(self._pushes)
        for solver in self._solvers:
            if solver.contact.eye < 0:
                pose.lip = solver.lower
        return self.points

    def invalidate(self) -> None:
        """Compute everything again at the next pose: the points at rest have been changed."""
        self._last_key, self._measured = (), False
        self.invalidations += 1

    @property
    def lips(self) -> list[ContactSolver]:
        """Those of the part's own contacts that are lips."""
        return [solver for solver in self._solvers if solver.contact.eye < 0]

    def apply_contacts(self, pose: Pose, points: Floats) -> None:
        """Correct control points (n, 3), moved by everything else, at the part's own contacts and at those it follows;
        corrections at its own are put into ``pose.pushes``."""
        for solver, driver, seal in zip(self._solvers, self._seals, self._seal_amounts(pose), strict=True):
            axis = _axis_of(pose, max(solver.contact.eye, 0))
            pose.pushes[solver.contact.name] = solver.apply(axis, points, seal, driver.rounding(pose.shapes))
            if solver.contact.eye < 0:
                pose.lip = solver.lower
        for name, follower in self._followers:
            if name in pose.pushes:
                follower.apply(pose.pushes[name], points)
        if self._rest is not None and self._rest.share(pose) > 0.0:
            self._rest.apply(pose, pose.lip, *rigid_motion("jaw", self._head, pose), points)
        for eye, clearance in self._clearances:
            clearance.apply(_axis_of(pose, eye), points)

    def _pose_key(self, pose: Pose) -> tuple[object, ...]:
        """Return everything in a pose that the part's points depend on."""
        jaw = (pose.jaw, pose.closed) if self._swings else ()
        gaze = pose.gaze.tobytes() if self._solvers or self._clearances else b""
        seals = [*self._seal_amounts(pose), *(driver.rounding(pose.shapes) for driver in self._seals)]
        pushes = (pose.pushes[name].tobytes() for name, _ in self._followers if name in pose.pushes)
        rests = self._rest is not None and self._rest.share(pose) > 0.0
        rest = (pose.lip.tobytes(), motion_key("jaw", self._head, pose)) if rests else ()
        lag = pose.lag.tobytes() if len(self._sways.used) else b""
        rise = pose.rise_mm if len(self._breathing) else 0.0
        own = pose.own.tobytes() if self.own else b""
        return self._amounts.tobytes(), *rest, jaw, gaze, lag, rise, own, *seals, *pushes

    def _seal_amounts(self, pose: Pose) -> list[float]:
        """Return how firmly each contact of the part keeps its sides together in a pose."""
        if not self._solvers:
            return []
        if not self._measured:
            self._measured = True
            for opening in filter(None, self._openings):
                opening.measure(self.rest, self.own)
        pairs = zip(self._seals, self._openings, strict=True)
        return [seal.amount(pose.shapes, own.amount(pose) if own else 0.0) for seal, own in pairs]

    def _add_own(self, pose: Pose, points: Floats) -> None:
        """Add what a user's groups move to ``points`` (n, 3)."""
        for own in self.own:
            if pose.own[own.index]:
                points[own.ids] += pose.own[own.index] * own.moves

    def _evaluate(self, pose: Pose, moved: Floats | None) -> None:
        """Groups, jaw, lids and contacts, one after the other."""
        if moved is None:
            self._moves.add(self._amounts, self.rest, self.points)
            self._add_own(pose, self.points)
        else:
            np.copyto(self.points, moved)
        if len(self._sways.used) and pose.lag.any():
            self._sways.add(pose.lag[self._sways.used], self.points, self.points)
        if len(self._breathing) and pose.rise_mm:
            self.points[self._breathing] += pose.rise_mm * self._breath
        if pose.jaw > 0 and self._swings:
            turn, shift = _path_of(pose, self._jaw)
            full_turn, full_shift = self._whole
            undo = self._undo * pose.closed
            swing_jaw(self.rest, self._open, turn, shift, full_turn * pose.jaw, full_shift * pose.jaw,
                      pose.jaw, undo, self.points)  # fmt: skip
        self._lids.apply(self._amounts, self.points)
        self.apply_contacts(pose, self.points)
        own = (solver.contact.name for solver in self._solvers)
        self._pushes = {name: pose.pushes[name].copy() for name in own}  # others may use the solvers meanwhile


class OwnOpenings:
    """What a user's own changes add to what opens one pair of lips, for :meth:`.rules.SealDriver.amount`.

    Lips stay together in poses that hardly open them, which is judged by the shapes of the face. Groups of a user, and
    control points that were moved at rest, have no shares in that, so how far they part the lips is measured.

    solver : of the lips. before : (n, 3) control points at rest, of the head's file.
    """

    def __init__(self, solver: ContactSolver, before: Floats) -> None:
        self._solver, self._before = solver, before
        self._closed_mm: float | None = None  # how far the lips of the file stand open, once it is needed
        self._own: Sequence[OwnMoves] = ()
        self._at_rest, self._shares = 0.0, list[tuple[int, float, float]]()

    def measure(self, rest: Floats, own: Sequence[OwnMoves]) -> None:
        """Take control points at rest (n, 3), as the user moved them, and the user's groups."""
        self._at_rest = 0.0 if np.array_equal(self._before, rest) else self._share(rest)
        if own is not self._own:
            self._own, self._shares = own, [(each.index, *self._both_ways(each)) for each in own]

    def amount(self, pose: Pose) -> float:
        """Return what they add in a pose."""
        amount = self._at_rest
        for index, more, less in self._shares:
            shown = float(pose.own[index])
            amount += shown * more if shown > 0.0 else -shown * less
        return amount

    def _both_ways(self, own: OwnMoves) -> tuple[float, float]:
        """Shares of a group at 1 and at -1."""
        points = np.stack([self._before, self._before])
        points[:, own.ids] += np.array([1.0, -1.0])[:, None, None] * own.moves
        return self._share(points[0]), self._share(points[1])

    def _share(self, points: Floats) -> float:
        """By what share of :data:`OWN_PARTED_MM` points (n, 3) part the lips further than those of the file."""
        if self._closed_mm is None:
            self._closed_mm = _gap(self._solver, self._before)
        return max(_gap(self._solver, points) - self._closed_mm, 0.0) / OWN_PARTED_MM


def _gap(solver: ContactSolver, points: Floats) -> float:
    """How far lips stand open at most, mm, where nothing but the contact itself moves ``points (n, 3)``."""
    solver.apply(FORWARD, points.copy())
    return max(float(solver.gaps().max()), 0.0)


class Lids:
    """Keeps the lids of one part, its points with ``lids``, at their distance from the eyeballs while they slide."""

    def __init__(self, part: PartData, head: HeadData, moves: Moves) -> None:
        ids = np.flatnonzero(part.lids).astype(np.int64)
        if all(c.part != part.name for c in head.contacts):
            ids = ids[np.linalg.norm(moves.at(ids), axis=2).max(axis=0, initial=0.0) < LID_WAY_MM]
        self._ids = ids
        eye = np.ascontiguousarray(head.eyes[(part.lids[ids] < 0).astype(int)], np.float64)
        from_eye = part.points[ids] - eye
        rest = np.linalg.norm(from_eye, axis=1)
        away = np.linalg.norm(from_eye + moves.at(ids), axis=2) - rest
        used = np.flatnonzero(away.any(axis=1))
        arrays = {
            "used": used, "moves": away[used].astype(np.float32), "rest": rest,
            "least": np.minimum(rest, head.eye_radius + LID_MM), "radius": rest.copy(), "ids": ids, "eye": eye,
            "hold": np.abs(part.lids[ids]).astype(np.float64), "amounts": np.zeros(len(used)),
        }  # fmt: skip
        self._kept, self._table = arrays, make_table(arrays)

    def apply(self, amounts: Floats, points: Floats) -> None:
        """Set the distance of the lids' points among ``points (n, 3)``; ``amounts (g,)`` of the groups."""
        if len(self._ids):
            hold_lids(self._table, amounts, points)


def optical_axis(gaze: Floats) -> Floats:
    """Return (3,): unit vector along which an eye looks, from yaw and pitch (2,), rad."""
    yaw, pitch = gaze
    return np.array([sin(yaw) * cos(pitch), -sin(pitch), cos(yaw) * cos(pitch)])  # the third column of `rotation`


def _axis_of(pose: Pose, eye: int) -> Floats:
    """Return the optical axis of an eye in a pose, computed once."""
    key = ("axis", eye)
    if key not in pose.found:
        pose.found[key] = optical_axis(pose.gaze[eye])
    axis: Floats = pose.found[key]
    return axis


def _path_of(pose: Pose, jaw: Jaw) -> tuple[Floats, Floats]:
    """Return the jaw's path in a pose, computed once."""
    key = ("path", id(jaw))
    if key not in pose.found:
        pose.found[key] = jaw_path(jaw, pose.jaw)
    turn, shift = pose.found[key]
    return turn, shift


def _clearances(part: PartData, head: HeadData) -> list[tuple[int, EyeballClearance]]:
    """Return, by eye, what keeps the part out of the eyeball; empty unless the part is sewn to lids from behind."""
    lids = [c for c in head.contacts if c.eye >= 0 and part.name in c.followers]
    if not any(s.part_b == part.name and s.part_a == c.part for s in head.seams for c in lids):
        return []
    domain, surface = domain_of(part), make_surface(part)
    u0, u1, v0, v1 = domain.rect
    columns, rows = CLEARANCE_GRID
    grid = np.stack(np.meshgrid(np.linspace(u0, u1, columns), np.linspace(v0, v1, rows)), axis=-1).reshape(-1, 2)
    places = grid[domain.inside(grid)]
    at, out = surface.evaluate(places), []
    for eye in (c.eye for c in lids):
        local = at - head.eyes[eye]
        near = (np.linalg.norm(local, axis=1) < CLEARANCE_RADII * head.eye_radius) & (local[:, 2] > 0.0)
        if near.any():
            out.append((eye, EyeballClearance(surface, places[near], head.eyes[eye], head.eye_radius)))
    return out


def _undo_share(part: PartData) -> Floats:
    """Return (n,): share of the jaw's motion that mouthClose takes back at each point, 0..1."""
    close = np.zeros_like(part.points)
    for g in part.groups:
        if g.name == "mouthClose":
            close[g.ids] = g.moves
    return np.clip(np.linalg.norm(close, axis=1) / UNDONE_MM, 0.0, 1.0)  # type: ignore[no-any-return]


def jaw_path(jaw: Jaw, amount: float) -> tuple[Floats, Floats]:
    """Return the rotation (3, 3) and shift (3,) of the lower jaw, opened by ``amount``: p -> turn @ p + shift.

    A rotation about the hinge plus a glide of the hinge, both growing with the amount.
    """
    turn = rotation(0.0, jaw.angle_rad * amount)
    centre = np.array(jaw.centre)
    return turn, centre - turn @ centre + amount * np.array(jaw.glide)


def motion_key(follows: str, head: HeadData, pose: Pose) -> tuple[float, ...]:
    """Return everything in a pose that :func:`rigid_motion` depends on, computed once for all parts that follow
    alike.
    """
    key = ("key", follows, id(head))
    if key not in pose.found:
        pose.found[key] = _make_key(follows, head, pose)
    found: tuple[float, ...] = pose.found[key]
    return found


def _make_key(follows: str, head: HeadData, pose: Pose) -> tuple[float, ...]:
    """Compute the result of :func:`motion_key`."""
    if follows == "jaw":
        return (pose.jaw, *(float(pose.shapes[_PLACE[name]]) for name in head.jaw.tilts))
    if follows in ("left_eye", "right_eye"):
        yaw, pitch = pose.gaze[int(follows == "right_eye")]
        return float(yaw), float(pitch)
    return ()


def rigid_motion(follows: str, head: HeadData, pose: Pose) -> tuple[Floats, Floats]:
    """Return linear part (3, 3) and shift (3,) of a part that is fixed to skull, jaw or an eye, before the head turns.

    Control points of a rational surface may be moved by any affine map: the surface follows exactly.
    """
    key = ("motion", follows, id(head))
    if key not in pose.found:
        pose.found[key] = _make_motion(follows, head, pose)
    linear, shift = pose.found[key]
    return linear, shift


def _make_motion(follows: str, head: HeadData, pose: Pose) -> tuple[Floats, Floats]:
    """Compute the result of :func:`rigid_motion`."""
    linear, shift = np.eye(3), np.zeros(3)
    if follows == "jaw":
        linear, shift = _path_of(pose, head.jaw)
        for name, tilt in head.jaw.tilts.items():
            amount = pose.shapes[_PLACE[name]]
            linear, shift = linear + amount * tilt[:, :3], shift + amount * tilt[:, 3]
    elif follows in ("left_eye", "right_eye"):
        side = int(follows == "right_eye")
        linear = rotation(*pose.gaze[side])
        shift = head.eyes[side] - linear @ head.eyes[side]
    return linear, shift
