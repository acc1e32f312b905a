"""Parts of a head as the picture sees them: vertices and normals that are current after every pose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32, Ints
from surface.dcp import DCPSurface
from surface.deform.deformation import Deformation
from surface.head.model.data import HeadData, PartData
from surface.head.model.meshes import make_surface as make_surface
from surface.head.model.parameters import Pose, rotation_vector
from surface.head.model.rules import Drivers
from surface.head.posing.kernels import move_rigid
from surface.head.posing.rig import SkinRig, motion_key, rigid_motion
from surface.head.posing.turning import turn_head
from surface.mesh.mesh import Mesh, border_edges


class Posed(Protocol):
    """Vertices and normals (m, 3) float32 before the head turns, as a deformation has them."""

    @property
    def vertices(self) -> Any: ...
    @property
    def normals(self) -> Any: ...


class Turn:
    """The head's rotation of one pose: matrix (3, 3), rotation vector (3,), pivot (3,)."""

    def __init__(self, matrix: Floats, pivot: tuple[float, float, float]) -> None:
        self.matrix, self.vector, self.pivot = matrix, rotation_vector(matrix), np.array(pivot)
        self.none, self.key = not self.vector.any(), (matrix + 0.0).tobytes()  # 0 is -0

    def rotate(
        self, source: Posed, share: Floats32, rows: tuple[int, int], vertices: Floats32, normals: Floats32
    ) -> None:
        """Write rows [start, stop) of what is posed, turned by each one's share, to ``vertices`` and ``normals``."""
        start, stop = rows
        if self.none:
            vertices[start:stop] = source.vertices[start:stop]
            normals[start:stop] = source.normals[start:stop]
        else:
            turn_head(source.vertices, source.normals, share, self.vector, self.pivot, start, stop, vertices, normals)

    def after(self, linear: Floats, shift: Floats) -> tuple[Floats32, Floats32]:
        """Return linear part (3, 3) and shift (3,) of an affine motion followed by the whole rotation."""
        turned = self.matrix @ (shift - self.pivot) + self.pivot
        return (self.matrix @ linear).astype(np.float32), turned.astype(np.float32)


class HeadPart:
    """One surface of the head, tessellated.

    name, material, follows : str.
    triangles : (t, 3) int32; uv : (m, 2) float32.
    vertices, normals : (m, 3) float32, current, in head space including the head's rotation.
    changed : vertex ranges [start, stop) that the last pose touched.
    attributes : static per-vertex arrays (m, k) float32 by name.
    decimated : fewer triangles over the same vertices, by level; see :mod:`surface.head.posing.baked`.
    borders : (k, 2) directed edges that only one triangle of the tessellation has.
    of_mesh : (m,) int64, which vertex of the tessellation each vertex is, or was copied from.
    surface : the DCP surface at rest. mesh : its tessellation.
    stored : was the tessellation in the head's file? Else it was made when the head was loaded.
    """

    stored = False

    def __init__(self, data: PartData, mesh: Mesh, surface: DCPSurface, attributes: Mapping[str, Floats32]) -> None:
        self.name, self.material, self.follows = data.name, data.material, data.follows
        self.surface, self.mesh = surface, mesh
        self.triangles = np.asarray(mesh.triangles, np.int32)
        self.uv = np.asarray(mesh.uv, np.float32)
        self.vertices = np.array(mesh.vertices, np.float32)
        self.normals = np.array(mesh.normals, np.float32)
        self.attributes = dict(attributes)
        self.decimated: dict[str, NDArray[np.int32]] = {}
        self.borders, self.of_mesh = border_edges(self.triangles), np.arange(len(self.vertices))
        self.changed: list[tuple[int, int]] = [(0, len(self.vertices))]
        self._turn = Turn(np.eye(3), (0.0, 0.0, 0.0))
        self._share = np.ones(len(self.vertices), np.float32)

    def pose(self, pose: Pose, turn: Turn) -> None:
        """Move to a pose; ``turn`` is the head's rotation."""
        raise NotImplementedError

    @property
    def control_points(self) -> Floats:
        """(n, 3) control points of the last pose, before the head turns."""
        raise NotImplementedError

    def place_points(self, pose: Pose, moved: Floats | None = None) -> Floats:
        """Return what :class:`surface.head.posing.influence.Influence` sums over, (k, 3), before the head turns;
        vertices and normals are left as they are. ``moved`` : as :meth:`.rig.SkinRig.apply` takes it."""
        raise NotImplementedError

    @property
    def turn(self) -> Floats:
        """(3, 3) the head's rotation of the last pose."""
        return self._turn.matrix

    @property
    def share(self) -> Floats32:
        """(m,) share of the head's rotation that each vertex of the mesh takes, 0..1."""
        return self._share

    def append(self, like: Ints, triangles: NDArray[np.int32]) -> None:
        """Add copies of vertices ``like (k,)`` after the part's own, and triangles that may use them; the caller moves
        the copies."""
        for name in ("vertices", "normals", "uv", "of_mesh"):
            array = getattr(self, name)
            setattr(self, name, np.concatenate([array, array[like]]))
        self.attributes = {k: np.concatenate([a, a[like]]) for k, a in self.attributes.items()}
        self.triangles = np.concatenate([self.triangles, triangles.astype(np.int32)])

    def touch(self) -> None:
        """Report every vertex as changed: a seam has written into the part."""
        self.changed = [(0, len(self.vertices))]

    def show(self, vertices: Floats32, normals: Floats32, turn: Turn | None = None) -> None:
        """Take vertices and normals (m, 3) that were posed elsewhere, and the head's rotation there, until the next
        :meth:`pose`."""
        self.vertices[:], self.normals[:], self._turn = vertices, normals, turn or self._turn
        self.touch()


class SkinPart(HeadPart):
    """A part whose control points move one by one; vertices follow by Eq. (2)."""

    def __init__(
        self, data: PartData, head: HeadData, mesh: Mesh, surface: DCPSurface, attributes: Mapping[str, Floats32],
        drivers: Drivers | None = None,
    ) -> None:  # fmt: skip
        super().__init__(data, mesh, surface, attributes)
        self.rig, self._version = SkinRig(data, head, drivers), 0
        self.deformation = Deformation(surface, mesh)
        self._at_rest = self.rig.invalidations
        self._straight = True  # does the deformation write to the part's own arrays?
        self.deformation.write_to(self.vertices, self.normals)
        self._share[:] = head.neck.share(self.vertices.astype(np.float64))
        self._shown = False  # are the vertices from elsewhere?

    def show(self, vertices: Floats32, normals: Floats32, turn: Turn | None = None) -> None:
        super().show(vertices, normals, turn)
        self._shown = True

    def pose(self, pose: Pose, turn: Turn) -> None:
        points, ranges = self.rig.apply(pose), []
        turned, self._turn = self._shown or turn.key != self._turn.key, turn
        self._direct(turn.none)
        if self._shown:
            self._shown = False
            self.deformation.refresh()
        if self._version != self.rig.version:
            self._version = self.rig.version
            self.deformation.set_points(points)
            self._forget_rounding()
            ranges = self.deformation.changed
        self.changed = [(0, len(self._share))] if turned else ranges
        if not turn.none:
            for rows in self.changed:
                turn.rotate(self.deformation, self._share, rows, self.vertices, self.normals)

    def _forget_rounding(self) -> None:
        """Sum again where the points at rest have changed, so that who puts them back gets the same vertices: their
        differences, added one after the other, leave some rounding."""
        if self._at_rest != self.rig.invalidations:
            self._at_rest = self.rig.invalidations
            self.deformation.refresh()

    def append(self, like: Ints, triangles: NDArray[np.int32]) -> None:
        super().append(like, triangles)
        self._straight = False
        self._direct(True)

    def _direct(self, straight: bool) -> None:
        """Let the deformation write straight to the part's own arrays, unless the head is turned: then vertices are
        kept as they were before that. They are the current ones then, without what seams did to them."""
        if straight == self._straight:
            return
        self._straight, m = straight, len(self._share)
        aside = np.empty((2, m, 3), np.float32)
        self.deformation.write_to(*((self.vertices[:m], self.normals[:m]) if straight else aside))

    @property
    def control_points(self) -> Floats:
        return self.deformation.points

    def place_points(self, pose: Pose, moved: Floats | None = None) -> Floats:
        return self.rig.apply(pose, moved)


class RigidPart(HeadPart):
    """A part fixed to skull, jaw or eye.

    An affine map of the control points of a rational surface moves the surface by the same map, which is applied to the
    vertices themselves.
    """

    def __init__(
        self, data: PartData, head: HeadData, mesh: Mesh, surface: DCPSurface, attributes: Mapping[str, Floats32]
    ) -> None:
        super().__init__(data, mesh, surface, attributes)
        self._head = head
        self._rest, self._rest_normals = self.vertices.copy(), self.normals.copy()
        self._motion = np.eye(3), np.zeros(3)
        self._last_key: tuple[object, ...] = ()

    def show(self, vertices: Floats32, normals: Floats32, turn: Turn | None = None) -> None:
        super().show(vertices, normals, turn)
        self._last_key = ()

    def pose(self, pose: Pose, turn: Turn) -> None:
        key = (*motion_key(self.follows, self._head, pose), turn.key)
        self._turn, self.changed = turn, []
        if key == self._last_key:
            return
        self._last_key, self.changed = key, [(0, len(self._rest))]
        self._motion = rigid_motion(self.follows, self._head, pose)
        after = self._turn_motion(pose, turn)
        move_rigid(self._rest, self._rest_normals, *after, self.vertices, self.normals)

    def _turn_motion(self, pose: Pose, turn: Turn) -> tuple[Floats32, Floats32]:
        """Return :meth:`Turn.after` of the part's motion in a pose, computed once for all parts that follow alike."""
        key = ("after", self.follows, id(self._head), id(turn))
        if key not in pose.found:
            pose.found[key] = turn.after(*self._motion)
        after: tuple[Floats32, Floats32] = pose.found[key]
        return after

    def move(self, linear: Floats, shift: Floats, turn: Turn, vertices: Floats32, normals: Floats32) -> None:
        """Write the part, moved by ``linear (3, 3)`` and ``shift (3,)`` and turned with the head, to ``vertices`` and
        ``normals`` (m, 3)."""
        move_rigid(self._rest, self._rest_normals, *turn.after(linear, shift), vertices, normals)

    @property
    def control_points(self) -> Floats:
        linear, shift = self._motion
        return self.surface.points @ linear.T + shift

    def place_points(self, pose: Pose, moved: Floats | None = None) -> Floats:
        linear, shift = rigid_motion(self.follows, self._head, pose)
        return np.vstack([linear.T, shift])
