"""Lids as they are drawn: above the eyeballs between control points, too, in every shape, and shut by a blink.

Lids that lie on an eyeball with all vertices of their mesh may still cut through it between them, in the fitted surface
or in the triangles that it is drawn with. So triangles are looked at closely, and control points moved until nothing of
the lids lies in an eyeball: at rest, then in each shape by its displacements.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.sparse import csr_matrix

from surface.base.arrays import Floats, Ints
from surface.check.raster import View
from surface.fit.points.eyeball import surface_height
from surface.head.model.data import Contact, Group, HeadData, PartData
from surface.head.model.meshes import make_surface, tessellate, unpack
from surface.head.model.parameters import NAMES, SHAPES, Pose, read_pose, smoothstep
from surface.head.posing.contact import ContactSolver, contact_rows
from surface.head.posing.rig import SkinRig, optical_axis
from surface.mesh.mesh import Mesh

# Distances from the eyeball's centre at rest, in radii.
SKIN_REACH = 2.5  # greatest of skin that may hide the eye
LID_REACH = 1.6  # greatest of lids
LID_DEPTH = 0.8  # least of lids
FRONT_RANGE = (
    0.05,
    0.35,
)  # in radii in front of the centre: where lids begin to be kept above the eyeball, and where they fully are
MIN_HEIGHT = 0.045, 0.01  # of lids above an eyeball, in radii, at rest and in shapes: 0.5 and 0.1 of 12 mm
SAMPLE_STEPS = 3  # samples of a triangle along an edge
MAX_ROUNDS = 6  # of lifting lids
GAIN = 1.2  # of each: least squares hold lids back
STIFFNESS = 0.02  # weight of moving no control point
HOLD_WEIGHT = 0.05  # weight of moving no sample that is high enough
TOLERANCE = 0.0025  # in radii: height that may be missing
MAX_CLOSINGS = 6  # corrections of a blink
MOST_MOVED = 3.0  # times the height of a gap, of the way that skin may go to close it: a fold would be worse than it
MAX_CORRECTIONS = 3  # of a head, one after the other
PIXEL = 0.008  # in radii, of the picture in which the open eye is measured
OVERLAP = 0.02  # in radii, by which a gap is closed further than it was open
CORNER_WIDTH = (
    0.06  # of the width of the lids: beside their columns, at the corners, nothing may be open this far either
)
MAX_LEFT_OPEN = 0.6  # of the opening at rest: a shape that leaves more open is no complete blink and stays unchanged
NOTE_MM = 0.5  # a gap of at least this height that was closed is reported
FORWARD = np.array([0.0, 0.0, 1.0])
BLINKS = "eyeBlinkLeft", "eyeBlinkRight"
SIDES = "left_eye", "right_eye"


def seat_drawn_lids(head: HeadData) -> tuple[HeadData, list[str]]:
    """The head with lids that are drawn above its eyeballs in every shape, and with blinks that are drawn shut.

    head : complete, with meshes and contacts. Also what was changed, in words.
    """
    notes: list[str] = []
    eyes = [DrawnLids(head, c) for c in head.contacts if c.eye >= 0]
    for lids in eyes:
        head = lids.cleared_at_rest(head)
    for lids in eyes:
        head, was_open, is_open = lids.shut(head)
        if was_open - is_open > NOTE_MM:
            fault = f"{lids.blink} left up to {was_open:.1f} mm of the eye open"
            notes.append(f"{fault}: its displacements were lengthened, to {is_open:.1f} mm")
    return head, notes


class DrawnLids:
    """The lids of one eye, as the triangles that they are drawn with.

    head : complete, with meshes; contact : of that eye. blink : name of the shape that shuts it.
    """

    def __init__(self, head: HeadData, contact: Contact) -> None:
        self._contact, self._eye, self._radius = contact, np.asarray(head.eyes[contact.eye]), head.eye_radius
        self.blink = BLINKS[contact.eye]
        part = self._face(head)
        surface, mesh = make_surface(part), _mesh_of(part)
        local = mesh.vertices - self._eye
        near = (np.linalg.norm(local, axis=1) < SKIN_REACH * self._radius) & (local[:, 2] > 0)
        used, corner = np.unique(mesh.triangles[near[mesh.triangles].all(axis=1)], return_inverse=True)
        self._triangles = np.ascontiguousarray(corner.reshape(-1, 3).astype(np.int32))
        self._vertices = surface.basis_matrix(mesh.uv[used], side=mesh.side[used])
        samples = (_shares(corner.reshape(-1, 3), len(used)) @ self._vertices).tocsr()
        away = np.linalg.norm(samples @ part.points - self._eye, axis=1) / self._radius
        self._samples = samples[(away > LID_DEPTH) & (away < LID_REACH)]
        self._ids = np.unique(self._samples.indices)
        self._dense = self._samples[:, self._ids].toarray()
        self._square = self._dense.T @ self._dense
        self._ball = _mesh_of(next(p for p in head.parts if p.follows == SIDES[contact.eye]))
        self._places = surface.basis_matrix(contact.places.reshape(-1, 2))

    def _face(self, head: HeadData) -> PartData:
        return next(p for p in head.parts if p.name == self._contact.part)

    def cleared_at_rest(self, head: HeadData) -> HeadData:
        """The head with these lids above the eyeball at rest."""
        part = self._face(head)
        points = part.points.copy()
        for _ in range(MAX_ROUNDS):
            moves = self._lift(points, FORWARD, MIN_HEIGHT[0])
            if not len(moves):
                break
            points[self._ids] += moves
        return _with_part(head, replace(part, points=points))

    def shut(self, head: HeadData) -> tuple[HeadData, float, float]:
        """The head with these lids above the eyeball in every shape and a blink that shuts; and how much of the eye,
        mm, the blink left open before and leaves after that.

        A head keeps its lids at their distances from the eyeball while they slide, and so takes a long correction only
        in part: what it really leaves open is measured, and corrected again.
        """
        more, was_open, is_open = self.corrections(head)
        best, least = head, np.inf
        for _ in range(MAX_CORRECTIONS):
            head = self.with_more(head, more)
            more, now, is_open = self.corrections(head)
            if now < least:
                best, least = head, now
            if now <= is_open:
                break
        return best, was_open, least

    def corrections(self, head: HeadData) -> tuple[dict[str, Floats], float, float]:
        """What to add to the displacements (n, 3) of shapes, so that lids keep above the eyeball and a blink shuts;
        and how much of the eye, mm, the blink left open before and leaves after that."""
        part, more, gaps = self._face(head), dict[str, Floats](), (0.0, 0.0)
        rig = SkinRig(part, replace(head, contacts=[]))
        solver = ContactSolver(self._contact, make_surface(part), head)
        moved = {g.name for g in part.groups}
        for name in (n for n in SHAPES if n in moved):
            pose = _pose(name)
            axis, before = optical_axis(pose.gaze[self._contact.eye]), rig.apply(pose).copy()
            after = self._cleared(before, axis, solver)
            if name == self.blink:
                after, *gaps = self._closed(part, before, after, solver)  # type: ignore[assignment]
            if (after != before).any():
                more[name] = after - before
        return more, gaps[0], gaps[1]

    def _cleared(self, points: Floats, axis: Floats, solver: ContactSolver) -> Floats:
        """Control points (n, 3), as groups have moved them, moved on until lids are above an eye that looks along
        ``axis (3,)`` once contacts have moved them, too; those with which least is missing."""
        best, least, points = points, np.inf, points.copy()
        for _ in range(MAX_ROUNDS):
            posed = _posed(points, axis, solver)
            worst = float(self._sampled(posed, axis, MIN_HEIGHT[1])[1].max(initial=0.0))
            if worst < least:
                best, least = points.copy(), worst
            moves = self._lift(posed, axis, MIN_HEIGHT[1])
            if not len(moves):
                break
            points[self._ids] += moves
        return best

    def _sampled(self, points: Floats, axis: Floats, above: float) -> tuple[Floats, Floats]:
        """Directions (s, 3) of samples from the eye's centre, and the height (s,), mm, that they lack to be ``above``
        radii over an eye that looks along ``axis (3,)``; ``points (n, 3)``."""
        at = self._samples @ points - self._eye
        length = np.maximum(np.linalg.norm(at, axis=1), 1e-9)
        unit = at / length[:, None]
        ground = self._radius * (surface_height(unit, axis) + above)
        before = smoothstep(at[:, 2] / self._radius, *FRONT_RANGE)
        return unit, np.maximum(ground - length, 0.0) * before

    def _lift(self, points: Floats, axis: Floats, above: float) -> Floats:
        """(k, 3) moves of the control points ``self._ids`` that lift the samples which lack height, in least squares;
        none where that is little."""
        unit, missing = self._sampled(points, axis, above)
        low = missing > 0
        if missing.max(initial=0.0) <= TOLERANCE * self._radius:
            return np.zeros((0, 3))
        own = self._dense[low]
        normal = HOLD_WEIGHT * self._square + (1.0 - HOLD_WEIGHT) * (own.T @ own)
        normal[np.diag_indices(len(normal))] += STIFFNESS * float(np.diag(self._square).mean())
        moves: Floats = np.linalg.solve(normal, own.T @ (GAIN * missing[low, None] * unit[low]))
        return moves

    def with_more(self, head: HeadData, more: dict[str, Floats]) -> HeadData:
        """The head with displacements (n, 3) added to groups of the lids' part, by name."""
        part = self._face(head)
        groups = [_with_more(g, more[g.name]) if g.name in more else g for g in part.groups]
        return _with_part(head, replace(part, groups=groups))

    def _closed(
        self, part: PartData, before: Floats, points: Floats, solver: ContactSolver
    ) -> tuple[Floats, float, float]:  # fmt: skip
        """Control points (n, 3) of a blink, as groups have moved them, moved on until it is drawn shut; and how much of
        the eye, mm, ``before`` and they leave open. Only such blinks are changed as shut most of the eye. What is
        open beside the columns of the contact, which cannot reach it, stays rather than folds the skin around it."""
        was_open = self._most_open(_posed(before, FORWARD, solver))
        start, best, first, points = points, points, self._most_open(_posed(points, FORWARD, solver)), points.copy()
        least = np.inf
        if was_open > MAX_LEFT_OPEN * self._most_open(part.points):
            return best, was_open, was_open
        for k in range(MAX_CLOSINGS):
            posed = _posed(points, FORWARD, solver)
            x, seen = self._open(posed)
            if seen.max() < least and self._way(points - start) <= MOST_MOVED * max(first - seen.max(), 0.0):
                best, least = points.copy(), float(seen.max())
            if least <= PIXEL * self._radius:
                break
            solver.move_sides(-(1.0 + k) * self._needs(posed, x, seen), points)  # corners follow only in part
            points = self._cleared(points, FORWARD, solver)
        return best, was_open, least

    def _way(self, moves: Floats) -> float:
        """How far moves (n, 3) of control points take the skin of the lids at most, mm."""
        return float(np.linalg.norm(self._samples @ moves, axis=1).max(initial=0.0))

    def _most_open(self, points: Floats) -> float:
        return float(self._open(points)[1].max())

    def _open(self, points: Floats) -> tuple[Floats, Floats]:
        """x (w,) of columns of a picture from the front, and the height, mm, of the eye that shows in each (w,),
        between the corners of the lids."""
        ball = self._ball.vertices
        (x0, y0), (x1, y1) = ball[:, :2].min(axis=0), ball[:, :2].max(axis=0)
        view = View((x0, x1), (y0, y1), PIXEL * self._radius)
        skin = (self._vertices @ points).astype(np.float32), self._triangles
        picture = view.draw([skin, (ball.astype(np.float32), self._ball.triangles.astype(np.int32))])
        seen = (picture.parts == 1).sum(axis=0) * view.step
        x, columns = x0 + view.step * np.arange(len(seen)), self._columns(points)
        beside = CORNER_WIDTH * float(np.ptp(columns))
        return x, np.where((x > columns.min() - beside) & (x < columns.max() + beside), seen, 0.0)

    def _columns(self, points: Floats) -> Floats:
        """(2, k) x of the contact's columns."""
        shape = self._contact.places.shape[:3]
        at = np.asarray(self._places @ points).reshape(*shape, 3)[:, :, : contact_rows(self._contact), 0]
        columns: Floats = at.mean(axis=2)
        return columns

    def _needs(self, points: Floats, x: Floats, seen: Floats) -> Floats:
        """(2, k) how far the sides have to come together in every column of the contact, mm."""
        columns = self._columns(points)
        spacing = float(np.ptp(columns[0])) / max(columns.shape[1] - 1, 1)
        most = maximum_filter1d(seen, 2 * max(1, round(spacing / (x[1] - x[0]))) + 1)
        wanted = np.where(most > 0, most + OVERLAP * self._radius, 0.0)
        return np.stack([np.interp(own, x, wanted) for own in columns])


def _mesh_of(part: PartData) -> Mesh:
    """The part's triangles at rest, as stored, or made."""
    surface = make_surface(part)
    return unpack(part.mesh or {}, surface, part.budget, rough=False) or tessellate(part, surface)


def _shares(triangles: Ints, count: int) -> csr_matrix:
    """(t k, count) samples all over triangles (t, 3) of ``count`` vertices, as weights of these."""
    s, t = np.meshgrid(
        np.arange(SAMPLE_STEPS + 1) / SAMPLE_STEPS, np.arange(SAMPLE_STEPS + 1) / SAMPLE_STEPS, indexing="ij"
    )
    inside = s + t <= 1.0 + 1e-9
    share = np.column_stack([1.0 - s[inside] - t[inside], s[inside], t[inside]])
    rows = np.repeat(np.arange(len(triangles) * len(share)), 3)
    columns = np.repeat(triangles[:, None], len(share), axis=1).ravel()
    data = np.tile(share.ravel(), len(triangles))
    return csr_matrix((data, (rows, columns)), shape=(len(triangles) * len(share), count))


def _pose(name: str) -> Pose:
    return read_pose(np.array([float(n == name) for n in NAMES]))


def _with_part(head: HeadData, part: PartData) -> HeadData:
    return replace(head, parts=[part if p.name == part.name else p for p in head.parts])


def _posed(points: Floats, axis: Floats, solver: ContactSolver) -> Floats:
    """Control points (n, 3) as contacts leave them while the eye looks along ``axis (3,)``."""
    posed = points.copy()
    solver.apply(axis, posed)
    return posed


def _with_more(group: Group, moves: Floats) -> Group:
    """The group with displacements (n, 3) added."""
    dense = moves.copy()
    dense[group.ids] += group.moves
    own = np.flatnonzero(np.abs(dense).max(axis=1) > 0).astype(np.int32)
    return Group(group.name, own, np.round(dense[own], 4).astype(np.float32))
