"""Pose a head's decimated triangles: only the vertices that they use, of all parts, in one array.

Where a picture moves, most of a pose's time goes to vertices that are not drawn and to calls for each part. Here all
parts that deform share one rig, and only vertices that are drawn or wanted are summed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32, Ints
from surface.deform.deformation import Deformation
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.own_groups import OwnMoves
from surface.head.model.parameters import Pose, rotation
from surface.head.posing.head import Head
from surface.head.posing.kernels import move_rigid, stitch_border
from surface.head.posing.part import HeadPart, RigidPart, SkinPart, Turn
from surface.head.posing.rig import SkinRig, motion_key, rigid_motion
from surface.head.posing.seams import SeamStitch
from surface.mesh.mesh import Mesh


class DecimatedPart:
    """A part's vertices among those of a decimated head.

    part : the head's own.
    first, last : its vertices are those from ``first`` to before ``last``.
    kept : (m,) int64, which vertices of the part they are, ascending.
    triangles : (t, 3) int32, of these.
    changed : ranges [start, stop) of these that the last pose touched.
    """

    def __init__(self, part: HeadPart, triangles: NDArray[np.integer], kept: Ints, first: int) -> None:
        self.part, self.kept = part, kept
        self.first, self.last = first, first + len(kept)
        self.triangles = np.searchsorted(kept, triangles).astype(np.int32)
        self.changed: list[tuple[int, int]] = [(0, len(kept))]

    @property
    def own(self) -> Ints:
        """Those of ``kept`` that the part's surface has; seams have added the others."""
        return self.kept[: int(np.searchsorted(self.kept, len(self.part.mesh.uv)))]

    def rows(self, ids: NDArray[np.integer]) -> Ints:
        """Return rows among the decimated head's vertices of the part's vertices ``ids (k,)``; all of them must be
        kept."""
        return self.first + np.searchsorted(self.kept, ids)


class DecimatedHead:
    """Vertices and normals of a head's decimated triangles.

    The head itself keeps its pose; changes to its rigs' points at rest are seen.

    parts : parts of the head, in the order of their vertices here; the attribute of this name says which vertices each
        part has.
    level : "full" or "fast"; a part without decimated triangles keeps all.
    wanted : other vertices to pose, by part.
    vertices, normals : (m, 3) float32, as posed last.
    """

    def __init__(self, head: Head, parts: Sequence[HeadPart], level: str, wanted: Mapping[str, Ints]) -> None:
        self._pivot, self._read_pose = head.data.neck.pivot, head.read_pose
        triangles = {part.name: part.decimated.get(level, part.triangles) for part in parts}
        kept, self.parts, first = _kept_vertices(head, triangles, wanted), [], 0
        for part in parts:
            self.parts.append(DecimatedPart(part, triangles[part.name], kept[part.name], first))
            first = self.parts[-1].last
        self.vertices, self.normals = np.zeros((first, 3), np.float32), np.zeros((first, 3), np.float32)
        skins = [(decimated, decimated.part) for decimated in self.parts if isinstance(decimated.part, SkinPart)]
        self._rig = JoinedRig([part for _, part in skins], head.data)
        self._skins = [_Skin(decimated, part, self._rig.rows[part.name]) for decimated, part in skins]
        self._rigids = [_Rigid(part, head.data) for part in self.parts if isinstance(part.part, RigidPart)]
        self._seams = _Seams(head.stitches, self.parts)
        self._turn: Turn | None = None
        self.pose(np.zeros(len(head.parameters)))

    def pose(self, values: Floats) -> None:
        """Move to parameter values (P,), as :meth:`surface.head.Head.pose`."""
        pose = self._read_pose(values)
        turn = Turn(rotation(*pose.head), self._pivot)
        turned = self._turn is None or not np.array_equal(turn.matrix, self._turn.matrix)
        self._turn = turn
        points = self._rig.apply(pose)
        for skin in self._skins:
            skin.pose(points, self._rig.version, turn, turned, self.vertices, self.normals)
        for rigid in self._rigids:
            rigid.pose(pose, turn, turned, self.vertices, self.normals)
        self._seams.close(self.vertices, self.normals)

    @property
    def lips_closed(self) -> bool:
        """Whether lips touch all along their opening in the last pose, so that they hide teeth and gums."""
        return self._rig.lips_closed

    @property
    def turn(self) -> Floats:
        """(3, 3) the head's rotation of the last pose."""
        return np.eye(3) if self._turn is None else self._turn.matrix


class JoinedRig(SkinRig):
    """The rigs of several parts as one, over their control points one after the other.

    Parameters
    ----------
    parts : whose points at rest it takes, now and whenever they change, and whose contacts it applies.

    Attributes
    ----------
    rows : slices of the points, by part.
    lips_closed : whether lips touch all along their opening in the last pose; False for parts without lips.
    """

    lips_closed = False

    def __init__(self, parts: Sequence[SkinPart], head: HeadData) -> None:
        of = {part.name: part for part in head.parts}
        super().__init__(_join([of[part.name] for part in parts]), head)
        ends = np.cumsum([0, *(len(part.rig.rest) for part in parts)]).tolist()
        self.rows = {part.name: slice(a, b) for part, a, b in zip(parts, ends, ends[1:], strict=False)}
        self._rigs = [(part.rig, self.rows[part.name]) for part in parts]
        self.own = [OwnMoves(own.index, own.ids + rows.start, own.moves) for rig, rows in self._rigs for own in rig.own]
        self._seen: list[int] = []

    def apply(self, pose: Pose, moved: Floats | None = None) -> Floats:
        invalidations = [rig.invalidations for rig, _ in self._rigs]
        if invalidations != self._seen:
            self._seen = invalidations
            for rig, rows in self._rigs:
                self.rest[rows] = rig.rest
            self.invalidate()
        return super().apply(pose, moved)

    def _pose_key(self, pose: Pose) -> tuple[object, ...]:
        return *super()._pose_key(pose), pose.gaze.tobytes(), pose.shapes.tobytes()

    def _evaluate(self, pose: Pose, moved: Floats | None) -> None:
        super()._evaluate(pose, moved)
        for rig, rows in self._rigs:
            rig.apply_contacts(pose, self.points[rows])
        lips = [solver for rig, _ in self._rigs for solver in rig.lips]
        self.lips_closed = bool(lips) and all(solver.gaps().max() <= 0.0 for solver in lips)


def _join(parts: Sequence[PartData]) -> PartData:
    """Return points, groups, jaw and lids of several parts as those of one."""
    groups: dict[str, list[tuple[int, Group]]] = {}
    first = 0
    for part in parts:
        for group in part.groups:
            groups.setdefault(group.name, []).append((first, group))
        first += len(part.points)
    together = [
        Group(
            name,
            np.concatenate([np.asarray(g.ids) + at for at, g in found]),
            np.concatenate([g.moves for _, g in found]),
        )
        for name, found in groups.items()
    ]
    points, jaw, lids = (np.concatenate([getattr(p, name) for p in parts]) for name in ("points", "jaw", "lids"))
    return replace(parts[0], name="", points=points, jaw=jaw, lids=lids, groups=together)


class _Skin:
    """Moves the vertices of a part that deforms, in its rows of ``vertices`` and ``normals`` (m, 3)."""

    def __init__(self, decimated: DecimatedPart, part: SkinPart, rows: slice) -> None:
        self._decimated, self._rows, self._version = decimated, rows, 0
        self._share = part.share[decimated.own]
        self._deformation = Deformation(part.surface, submesh(part.mesh, decimated.own))

    def pose(
        self, points: Floats, version: int, turn: Turn, turned: bool, vertices: Floats32, normals: Floats32
    ) -> None:
        """Move to control ``points`` (n, 3) of the whole head."""
        own, first = self._deformation, self._decimated.first
        self._decimated.changed = []
        if self._version != version:
            self._version = version
            own.set_points(points[self._rows])
            self._decimated.changed = own.changed
        if turned:
            self._decimated.changed = [(0, len(self._share))]
        for rows in self._decimated.changed:
            turn.rotate(own, self._share, rows, vertices[first:], normals[first:])


class _Rigid:
    """Moves the vertices of a rigid part, in its rows of ``vertices`` and ``normals`` (m, 3)."""

    def __init__(self, decimated: DecimatedPart, head: HeadData) -> None:
        self._decimated, self._head = decimated, head
        mesh, own = decimated.part.mesh, decimated.own
        self._rest = mesh.vertices[own].astype(np.float32), mesh.normals[own].astype(np.float32)
        self._last_key: tuple[object, ...] | None = None

    def pose(self, pose: Pose, turn: Turn, turned: bool, vertices: Floats32, normals: Floats32) -> None:
        follows, first = self._decimated.part.follows, self._decimated.first
        key = motion_key(follows, self._head, pose)
        moves = turned or key != self._last_key
        self._last_key = key
        self._decimated.changed = [(0, len(self._rest[0]))] if moves else []
        if moves:
            motion = turn.after(*rigid_motion(follows, self._head, pose))
            move_rigid(*self._rest, *motion, vertices[first:], normals[first:])


class _Seams:
    """All seams of a head, closed in one call."""

    def __init__(self, stitches: Sequence[SeamStitch], parts: Sequence[DecimatedPart]) -> None:
        by_name = {decimated.part.name: decimated for decimated in parts}
        self._pairs: list[tuple[DecimatedPart, DecimatedPart]] = []
        none = np.zeros(0, np.int64)
        rows = [(none, none, none, *2 * [np.zeros(0, np.float32)])]
        for stitch in stitches:
            one, two = by_name[stitch.first.name], by_name[stitch.second.name]
            drawn = np.isin(stitch.ids, two.kept)
            if drawn.any():
                self._pairs.append((one, two))
                low, high = one.rows(stitch.low[drawn]), one.rows(stitch.high[drawn])
                rows.append((two.rows(stitch.ids[drawn]), low, high, stitch.share[drawn], stitch.inward[drawn]))
        self._rows = [np.concatenate(column) for column in zip(*rows, strict=True)]

    def close(self, vertices: Floats32, normals: Floats32) -> None:
        """Put borders onto each other among ``vertices`` and ``normals`` (m, 3)."""
        touched = False
        for one, two in self._pairs:
            if one.changed or two.changed:  # by the pose, or by a seam before
                two.changed, touched = [(0, len(two.kept))], True
        if touched:
            stitch_border(vertices, normals, vertices, normals, *self._rows)


def _kept_vertices(
    head: Head, triangles: Mapping[str, NDArray[np.integer]], wanted: Mapping[str, Ints]
) -> dict[str, Ints]:
    """Return which vertices are drawn or wanted, by part, with those that seams put them between."""
    kept = {name: np.union1d(own, wanted.get(name, ())).astype(np.int64) for name, own in triangles.items()}
    for stitch in reversed(head.stitches):  # a later seam may take what an earlier one moves
        drawn = np.isin(stitch.ids, kept[stitch.second.name])
        between = [kept[stitch.first.name], stitch.low[drawn], stitch.high[drawn]]
        kept[stitch.first.name] = np.unique(np.concatenate(between))
    return kept


def submesh(mesh: Mesh, ids: Ints) -> Mesh:
    """Return a mesh of only the vertices ``ids (k,)``, ascending, and the cells that have any; without triangles."""
    cells, cell = np.unique(mesh.cell[ids], return_inverse=True)
    lists = [mesh.points_of(c) for c in cells.tolist()]
    return Mesh(
        mesh.vertices[ids], mesh.normals[ids], np.zeros((0, 3), np.int32), mesh.uv[ids], mesh.side[ids],
        cell.astype(np.int32), np.searchsorted(cell, np.arange(len(cells) + 1)), np.cumsum([0, *map(len, lists)]),
        np.concatenate([np.zeros(0, np.int32), *lists]), len(cells), mesh.flip,
    )  # fmt: skip
