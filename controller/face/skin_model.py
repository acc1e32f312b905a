"""Models the skin of a head for the mouse: where points of the skin are in a picture, and what moves them.

This module does not depend on the window library.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.face.skin_lines import uv_under
from controller.robot.anchors import head_order, sample_skin, shapes_of, skin_points
from controller.stage.inverse import SculptSolver
from controller.stage.pulling import Pin, PullSolver, lip_pairs
from surface.head import Head
from surface.head.model.data import PartData
from surface.head.model.light import LightPoints, join_light, with_points
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import NAMES, read_pose, rotation
from surface.view.scene.camera import Camera

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix  # imported lazily: only dragging needs it

PART = "face"
_VERTEX_SAMPLES = 900  # samples at vertices of the mesh, which are dense where the face has features
_AREA_SAMPLES = 600  # samples spread evenly over the area, so that flat cheeks can be picked too
_SEED = 11


@dataclass(frozen=True)
class Screen:
    """The projection of a picture: its camera and its size (width, height) in pixels."""

    camera: Camera
    size: tuple[float, float]

    def project(self, places: Floats) -> Floats:
        """Return pixel x, pixel y and depth (m, 3) of positions (m, 3) mm."""
        clip = np.column_stack([places, np.ones(len(places))]) @ self._matrix.T
        x, y = clip[:, 0] / clip[:, 3], clip[:, 1] / clip[:, 3]
        return np.column_stack([(x + 1) / 2 * self.size[0], (1 - y) / 2 * self.size[1], clip[:, 3]])

    def place(self, pixel: tuple[float, float], beside: Floats) -> Floats:
        """Return the position (3,) mm under a pixel, at the depth of the position ``beside`` : (3,) mm."""
        clip = self._matrix @ np.append(beside, 1.0)
        clip[0] = (2 * pixel[0] / self.size[0] - 1) * clip[3]
        clip[1] = (1 - 2 * pixel[1] / self.size[1]) * clip[3]
        found = np.linalg.solve(self._matrix, clip)
        point: Floats = found[:3] / found[3]
        return point

    @property
    def _matrix(self) -> Floats:
        return self.camera.matrix(self.size[0] / self.size[1]).astype(np.float64)


class SkinModel:
    """Samples of a head's skin, computed once, and how parameters and control points move them."""

    def __init__(self, head: Head, parameters: Parameters) -> None:
        part = head.part(PART)
        self.data: PartData = next(part for part in head.data.parts if part.name == PART)
        self.order = head_order(NAMES, parameters)
        self._head, self._all = head, head_order(head.parameters, parameters)
        self.skin = sample_skin(
            head, PART, np.concatenate([skin_points(head, PART, _VERTEX_SAMPLES, _SEED), _sample_area(head)])
        )
        self.basis = part.surface.basis_matrix(self.skin.uv)
        along_u, along_v = part.surface.derivatives(self.skin.uv)[1:]
        normals = np.cross(along_u, along_v)
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        if self.normals[np.argmax(self.skin.rest[:, 2]), 2] < 0.0:
            self.normals = -self.normals
        self.surface, self.jaw = part.surface, np.asarray(self.data.jaw, np.float64)
        self.sculptor = SculptSolver(head, PART)
        self.lips = lip_pairs(head, PART)
        self.pivot = np.array(head.data.neck.pivot)
        self._own = part.rig.own  # type: ignore[attr-defined]
        self._mesh_basis: csr_matrix | None = None  # of all vertices, computed when a moved skin is first drawn on

    def shown(self, values: Floats, moves: Floats) -> Floats:
        """Return what sculpting and the user's groups add to the sampled points of a face (P,), (m, 3) mm.

        moves : (n, 3) mm, of the control points.
        """
        amounts, moved = self._head.read_pose(values[self._all]).own, moves
        for own in self._own:
            moved = moved.copy()
            moved[own.ids] += amounts[own.index] * own.moves
        return np.asarray(self.basis @ moved)

    def with_light(self, light: Sequence[LightPoints]) -> SkinModel:
        """Return the model of the same head with added control points after its own.

        Nothing is sampled again, because added points change neither the skin at rest nor how parameters move it.
        """
        if not light:
            return self
        found = copy(self)
        found.data = with_points(self.data, join_light(light)[PART])
        found.surface, found.jaw = make_surface(found.data), np.asarray(found.data.jaw, np.float64)
        found.basis, found._mesh_basis = found.surface.basis_matrix(self.skin.uv), None
        return found

    @property
    def mesh_rest(self) -> tuple[Floats, Floats]:
        """(m, 3) mm and (m, 2): the vertices of the part at rest, and their (u, v) coordinates."""
        mesh = self._head.part(PART).mesh
        return self.surface.evaluate(mesh.uv), mesh.uv

    def local(self, values: Floats, moves: Floats) -> Floats:
        """Return the positions (m, 3) mm of the sampled points in a face (P,), before the rotation of the head.

        moves : (n, 3) mm, of the control points.
        """
        moved = self.skin.displacement(shapes_of(values, self.order))
        local: Floats = self.skin.rest + moved + self.shown(values, moves)
        return local

    def turned(self, local: Floats, values: Floats) -> tuple[Floats, Floats]:
        """Return positions (m, 3) mm with the rotation of the head in a face (P,), and this rotation (3, 3)."""
        turn = head_rotation(values[self.order])
        return self.pivot + (local - self.pivot) @ turn.T, turn

    def places_of(self, uv: Floats, values: Floats, moves: Floats) -> Floats:
        """Return the positions (k, 3) mm of the skin at ``uv`` : (k, 2) in a face (P,), with moves (n, 3) mm."""
        index = self._head.parts.index(self._head.part(PART))
        part = self._head.parts[index]
        points = self._head.place_points(self._of_head(values))[0][index]
        places = part.surface.basis_matrix(uv) @ points + self.surface.basis_matrix(uv) @ moves
        return self.turned(np.asarray(places), values)[0]

    def under(self, pixels: Floats, screen: Screen, values: Floats, moves: Floats) -> Floats:
        """Return the (u, v) coordinates (k, 2) under pixels (k, 2) in the picture of a face (P,); NaN beside the face.

        moves : (n, 3) mm, of the control points.
        """
        self._head.pose(self._of_head(values))
        mesh, part = self._head.part(PART).mesh, self._head.part(PART)
        places = part.vertices[: len(mesh.uv)].astype(np.float64)
        if moves.any():
            if self._mesh_basis is None:
                self._mesh_basis = self.surface.basis_matrix(mesh.uv)
            places += np.asarray(self._mesh_basis @ moves) @ head_rotation(values[self.order]).T
        return uv_under(pixels, screen.project(places), mesh.triangles, mesh.uv)

    def _of_head(self, values: Floats) -> Floats:
        return values[self._all]


class SkinModels:
    """Makes the model of a head at the first call, and variants of it with added control points; thread-safe.

    copy : loads the head without added control points.
    """

    def __init__(self, copy: Callable[[], Head], parameters: Parameters) -> None:
        self.parameters, self._copy = parameters, copy
        self._lock, self._model = threading.Lock(), None  # type: threading.Lock, SkinModel | None

    def make(self, light: Sequence[LightPoints]) -> SkinModel:
        """Return the model with these control points; the first call takes seconds."""
        with self._lock:
            self._model = self._model or self._make_first()
        return self._model.with_light(light)

    def _make_first(self) -> SkinModel:
        model, parameters = SkinModel(self._copy(), self.parameters), self.parameters
        solver = PullSolver(model.skin, model.lips, model.order, parameters, parameters.neutral())
        solver.solve([Pin(0, model.skin.rest[0])])  # compiles before the first drag
        return model


def _sample_area(head: Head) -> Floats:
    """Return random (u, v) coordinates (_AREA_SAMPLES, 2), uniform over the area of the skin at rest."""
    part, rng = head.part(PART), np.random.default_rng(_SEED)
    a, b, c = (part.vertices[part.mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = part.mesh.triangles[rng.choice(len(area), _AREA_SAMPLES, p=area / area.sum())]
    weights = rng.dirichlet(np.ones(3), _AREA_SAMPLES)
    found: Floats = (weights[..., None] * part.mesh.uv[chosen]).sum(axis=1)
    return found


def head_rotation(head_values: Floats) -> Floats:
    """Return the rotation (3, 3) of the head for values (h,) in the head's order."""
    return rotation(*read_pose(head_values).head)
