"""Parts of a head as the picture sees them: arrays that are current after every pose."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from surface.dcp import DCPSurface
from surface.deformation import Deformation
from surface.head.data import HeadData, PartData
from surface.head.parameters import Pose
from surface.head.rig import SkinRig, rigid_motion
from surface.mesh import Mesh

Floats32 = NDArray[np.float32]


class HeadPart:
    """One surface of the head, tessellated.

    Attributes
    ----------
    name, material : str.
    triangles : (t, 3) int32; uv : (m, 2) float32.
    vertices, normals : (m, 3) float32, current, in head space including the head's rotation.
    changed : vertex ranges [start, stop) that the last pose touched.
    borders : (k, 2) directed edges that only one triangle of the tessellation has.
    attributes : static per-vertex arrays (m, k) float32 by name.
    surface : the DCP surface at rest.
    """

    def __init__(self, data: PartData, mesh: Mesh, surface: DCPSurface, attributes: Mapping[str, Floats32]) -> None:
        self.name, self.material, self.follows = data.name, data.material, data.follows
        self.surface, self.mesh = surface, mesh
        self.triangles = np.asarray(mesh.triangles, np.int32)
        self.uv = np.asarray(mesh.uv, np.float32)
        self.vertices = np.array(mesh.vertices, np.float32)
        self.normals = np.array(mesh.normals, np.float32)
        self.attributes = dict(attributes)
        self.borders = border_edges(self.triangles)
        self.changed: list[tuple[int, int]] = [(0, len(self.vertices))]

    def pose(self, pose: Pose, turn: NDArray[np.float64]) -> None:
        """Move to a pose; ``turn`` is the head's rotation (3, 3)."""
        raise NotImplementedError

    @property
    def control_points(self) -> NDArray[np.float64]:
        """(n, 3) float64, where the control points stand now."""
        raise NotImplementedError

    def append(self, like: NDArray[np.int64], triangles: NDArray[np.int32]) -> None:
        """Add vertices that look like others, ids ``like (k,)``, and triangles that may use them.

        The new vertices stand behind the part's own; whoever adds them moves them.
        """
        for name in ("vertices", "normals", "uv"):
            array = getattr(self, name)
            setattr(self, name, np.concatenate([array, array[like]]))
        self.attributes = {k: np.concatenate([a, a[like]]) for k, a in self.attributes.items()}
        self.triangles = np.concatenate([self.triangles, triangles.astype(np.int32)])

    def touch(self) -> None:
        """Report every vertex as changed: a seam has written into the part."""
        self.changed = [(0, len(self.vertices))]


class SkinPart(HeadPart):
    """A part whose control points move one by one; vertices follow by Eq. (2)."""

    def __init__(self, data: PartData, head: HeadData, mesh: Mesh, surface: DCPSurface,
                 attributes: Mapping[str, Floats32]) -> None:  # fmt: skip
        super().__init__(data, mesh, surface, attributes)
        self.rig = SkinRig(data, head)
        self.deformation = Deformation(surface, mesh)
        self._follow([(0, len(self.vertices))])

    def pose(self, pose: Pose, turn: NDArray[np.float64]) -> None:
        self.deformation.set_points(self.rig.apply(pose, turn))
        self.changed = self.deformation.changed
        self._follow(self.changed)

    def _follow(self, ranges: list[tuple[int, int]]) -> None:
        for start, stop in ranges:
            self.vertices[start:stop] = self.deformation.vertices[start:stop]
            self.normals[start:stop] = self.deformation.normals[start:stop]

    @property
    def control_points(self) -> NDArray[np.float64]:
        return self.deformation.points


class RigidPart(HeadPart):
    """A part fixed to skull, jaw or eye.

    A rational surface is carried along exactly by an affine map of its control points, so the map is applied
    to the vertices themselves.
    """

    def __init__(self, data: PartData, head: HeadData, mesh: Mesh, surface: DCPSurface,
                 attributes: Mapping[str, Floats32]) -> None:  # fmt: skip
        super().__init__(data, mesh, surface, attributes)
        self._head = head
        self._rest, self._rest_normals = self.vertices.copy(), self.normals.copy()
        self._own = len(self._rest)
        self._linear, self._shift = np.eye(3), np.zeros(3)

    def pose(self, pose: Pose, turn: NDArray[np.float64]) -> None:
        linear, shift = rigid_motion(self.follows, self._head, pose, turn)
        if np.array_equal(linear, self._linear) and np.array_equal(shift, self._shift):
            self.changed = []
            return
        self._linear, self._shift = linear, shift
        matrix = np.ascontiguousarray(linear.T, np.float32)
        own = slice(self._own)
        np.dot(self._rest, matrix, out=self.vertices[own])
        self.vertices[own] += shift.astype(np.float32)
        np.dot(self._rest_normals, matrix, out=self.normals[own])
        self.changed = [(0, len(self.vertices))]

    @property
    def control_points(self) -> NDArray[np.float64]:
        return self.surface.points @ self._linear.T + self._shift


def make_surface(data: PartData) -> DCPSurface:
    """The part's DCP surface."""
    return DCPSurface.from_padded(
        data.points, data.weights, data.knots_u, data.knots_v, data.degrees[:, 0], data.degrees[:, 1]
    )


def border_edges(triangles: NDArray[np.int32]) -> NDArray[np.int64]:
    """(k, 2) edges that only one triangle has, in the direction of that triangle."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    key, back = edges[:, 0] << 32 | edges[:, 1], edges[:, 1] << 32 | edges[:, 0]
    return edges[~np.isin(key, back)]
