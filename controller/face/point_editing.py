"""Points of the face that the mouse picks on the picture and drags in the plane of the screen.

Dragging moves parameters; sculpting moves control points of the drawn head, which can be saved as a group file.
Independent of the window library.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.robot.anchors import head_order, sample_skin, shapes_of, skin_points
from controller.stage.inverse import GroupMoves, SculptSolver, save_group
from controller.stage.pulling import Pin, PullSolver, lip_pairs
from surface.head import Head
from surface.head.model.parameters import NAMES, read_pose, rotation
from surface.view.scene.camera import Camera

PART = "face"
_POINTS = 900
_SEED = 11
_PICK_PIXELS, _HIDING_PIXELS, _HIDDEN_MM = 16.0, 48.0, 40.0
_LEAST_CHANGE, _LEAST_MM = 0.004, 0.01


@dataclass(frozen=True)
class Screen:
    """The projection of a picture: its camera and its size (width, height) in pixels."""

    camera: Camera
    size: tuple[float, float]

    def project(self, places: Floats) -> Floats:
        """(m, 3) pixel x, pixel y and depth of places (m, 3) mm."""
        clip = np.column_stack([places, np.ones(len(places))]) @ self._matrix.T
        x, y = clip[:, 0] / clip[:, 3], clip[:, 1] / clip[:, 3]
        return np.column_stack([(x + 1) / 2 * self.size[0], (1 - y) / 2 * self.size[1], clip[:, 3]])

    def place(self, pixel: tuple[float, float], beside: Floats) -> Floats:
        """(3,) mm: the place under a pixel, at the depth of the place ``beside`` : (3,)."""
        clip = self._matrix @ np.append(beside, 1.0)
        clip[0] = (2 * pixel[0] / self.size[0] - 1) * clip[3]
        clip[1] = (1 - 2 * pixel[1] / self.size[1]) * clip[3]
        found = np.linalg.solve(self._matrix, clip)
        point: Floats = found[:3] / found[3]
        return point

    @property
    def _matrix(self) -> Floats:
        return self.camera.matrix(self.size[0] / self.size[1]).astype(np.float64)


class _Model:
    """Samples of a head, computed once: points of its skin, how shapes move them, and how control points do."""

    def __init__(self, head: Head, parameters: Parameters) -> None:
        part = head.part(PART)
        self.order = head_order(NAMES, parameters)
        self._head, self._all = head, head_order(head.parameters, parameters)
        self.skin = sample_skin(head, PART, skin_points(head, PART, _POINTS, _SEED))
        self.basis = part.surface.basis_matrix(self.skin.uv)
        along_u, along_v = part.surface.derivatives(self.skin.uv)[1:]
        normals = np.cross(along_u, along_v)
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        if self.normals[np.argmax(self.skin.rest[:, 2]), 2] < 0.0:
            self.normals = -self.normals
        self.sculptor = SculptSolver(head, PART)
        self.lips = lip_pairs(head, PART)
        self.pivot = np.array(head.data.neck.pivot)
        self._own = part.rig.own  # type: ignore[attr-defined]

    def shown(self, values: Floats, moves: Floats) -> Floats:
        """(m, 3) mm that control points moved by hand, ``moves`` (n, 3), and a user's own groups add to a face (P,)."""
        amounts, moved = self._head.read_pose(values[self._all]).own, moves
        for own in self._own:
            moved = moved.copy()
            moved[own.ids] += amounts[own.index] * own.moves
        return np.asarray(self.basis @ moved)


class PointEditor:
    """Takes points of a head in a picture and drags them.

    It samples a copy of the head, in a separate thread, when the user first picks a point.

    head : the head that is drawn; sculpting moves its control points. copy : loads the same head again.
    """

    def __init__(self, head: Head, copy: Callable[[], Head], parameters: Parameters) -> None:
        self.head, self._rig, self._parameters = head, head.part(PART).rig, parameters  # type: ignore[attr-defined]
        self._rest = self._rig.rest.copy()
        self._moves: Floats = np.zeros_like(self._rest)
        self._before = self._moves
        self._model: _Model | None = None
        self._held: _PointDrag | _SculptDrag | None = None
        self._asked: tuple[tuple[float, float], Screen, Floats, bool, bool] | None = None
        self._pins: dict[int, Floats] = {}
        self._settled = False
        self._last: int | None = None
        self._thread = threading.Thread(target=self._prepare, args=(copy,), name="point editor", daemon=True)

    @property
    def ready(self) -> bool:
        """Whether points can be taken."""
        return self._model is not None

    @property
    def dragging(self) -> bool:
        """Whether a point is held, or will be once points can be taken."""
        return self._held is not None or self._asked is not None

    @property
    def settled(self) -> bool:
        """Whether the last drag was carried out: not while points get ready."""
        return self._settled

    @property
    def moves(self) -> Floats:
        """(n, 3) mm that the control points were moved by; another array after each change."""
        return self._moves

    @property
    def sculpted(self) -> bool:
        """Whether control points were moved."""
        return bool(self._moves.any())

    def prepare(self) -> None:
        """Start to get ready; may be called again."""
        if self._thread.ident is None:
            self._thread.start()

    def take(
        self, pixel: tuple[float, float], screen: Screen, values: Floats, *, sculpt: bool = False, tied: bool = False
    ) -> bool:
        """Take the point of the skin under a pixel; False when there is none.

        One that is asked for while points get ready is taken by :meth:`drag` as soon as they are, where it was then.

        ``values`` : (P,) parameters of the shown face. ``sculpt`` : move control points instead of parameters.
        ``tied`` : both sides of the face change alike.
        """
        self._settled = False
        if self._model is None:
            self._asked = (pixel, screen, values.copy(), sculpt, tied)
            self.prepare()
            return True
        return self._take(self._model, pixel, screen, values, sculpt, tied)

    def _take(
        self, model: _Model, pixel: tuple[float, float], screen: Screen, values: Floats, sculpt: bool, tied: bool
    ) -> bool:
        places, turn = self._places(model, values)
        shown = screen.project(places)
        towards = np.einsum("mc,mc->m", model.normals @ turn.T, np.array(screen.camera.eye) - places) > 0.0
        away = np.hypot(shown[:, 0] - pixel[0], shown[:, 1] - pixel[1]) + np.where(towards, 0.0, np.inf)
        first = np.min(shown[away < _HIDING_PIXELS, 2], initial=np.inf)
        point = int(np.argmin(np.where(shown[:, 2] < first + _HIDDEN_MM, away, np.inf)))
        if away[point] > _PICK_PIXELS:
            return False
        self._last = point
        offset = places[point] - screen.place(pixel, places[point])
        self._held = _SculptDrag(model, point, places[point], offset) if sculpt else _PointDrag(
            model, point, places[point], offset, self._parameters, values, model.shown(values, self._moves), self._pins,
            tied=tied,
        )  # fmt: skip
        return True

    def drag(self, pixel: tuple[float, float], screen: Screen, values: Floats) -> dict[int, float]:
        """Move the held point under a pixel; returns indices of parameters and the values to hold them at."""
        model = self._model
        if model is not None and self._asked is not None:
            asked, self._asked = self._asked, None
            self._take(model, *asked)
        elif model is None and not self._thread.is_alive():
            self._asked = None  # it failed
        self._settled, held = self._asked is None, self._held
        if held is None or model is None:
            return {}
        wanted = screen.place(pixel, held.place) + held.offset
        turn = _turn(values[model.order])
        local = model.pivot + turn.T @ (wanted - model.pivot)
        if isinstance(held, _PointDrag):
            return held.solve(local, turn.T @ (wanted - np.array(screen.camera.eye)))
        moves = self._before.copy()
        moves[held.ids] += held.share[:, None] * (turn.T @ (wanted - held.place))
        self._set_moves(moves)
        return {}

    @property
    def missed_mm(self) -> float:
        """How far the farthest held or pinned point is from where it shall be, as it is seen; 0 without a pull."""
        return self._held.missed_mm if isinstance(self._held, _PointDrag) else 0.0

    def pin(self, values: Floats) -> None:
        """Pin the held point where it is in the face ``values`` (P,); later pulls of others leave it there."""
        if isinstance(self._held, _PointDrag) and self._model is not None:
            self._pins[self._held.point] = self._local(self._model, values)[self._held.point]

    def unpin(self) -> None:
        """Let go of all pinned points."""
        self._pins = {}

    @property
    def pinned(self) -> int:
        """How many points are pinned."""
        return len(self._pins)

    def pin_pixels(self, screen: Screen, values: Floats) -> list[tuple[float, float]]:
        """Where the pinned points shall be in the picture."""
        if self._model is None or not self._pins:
            return []
        turn, pivot = _turn(values[self._model.order]), self._model.pivot
        shown = screen.project(pivot + (np.array(list(self._pins.values())) - pivot) @ turn.T)
        return [(float(x), float(y)) for x, y, _ in shown]

    def release(self) -> None:
        """Release the point; moved control points stay."""
        self._held, self._asked, self._before = None, None, self._moves

    def undo(self) -> None:
        """Move all control points back."""
        self.set_moves(None)

    def set_moves(self, moves: Floats | None) -> None:
        """Move the control points by (n, 3) mm from where they were at first; None for not at all."""
        self._set_moves(np.zeros_like(self._rest) if moves is None else moves)
        self.release()

    def group(self) -> GroupMoves:
        """The control points that were moved."""
        ids = np.flatnonzero(np.linalg.norm(self._moves, axis=1) >= _LEAST_MM).astype(np.int32)
        return GroupMoves(PART, ids, self._moves[ids])

    def last_pull(self, values: Floats) -> tuple[Floats, Floats]:
        """(3,) mm where the point that was held last lies at rest, and (3,) mm how far the face ``values`` (P,) and
        moved control points bring it; the head not turned. No pull, where none was held."""
        if self._model is None or self._last is None:
            return np.zeros(3), np.zeros(3)
        place = self._model.skin.rest[self._last]
        return place, self._local(self._model, values)[self._last] - place

    def save(self, path: Path, name: str) -> None:
        """Write the moved control points as a group file; a stage adds it with ``groups``. Raises ControllerError."""
        save_group(path, name, self.group())

    def _set_moves(self, moves: Floats) -> None:
        self._moves = moves
        np.add(self._rest, moves, out=self._rig.rest)
        self._rig.invalidate()

    def _places(self, model: _Model, values: Floats) -> tuple[Floats, Floats]:
        """(m, 3) mm where the points are in the picture, and the head's rotation (3, 3)."""
        turn = _turn(values[model.order])
        return model.pivot + (self._local(model, values) - model.pivot) @ turn.T, turn

    def _local(self, model: _Model, values: Floats) -> Floats:
        """(m, 3) mm where the points are, head not turned."""
        moved = model.skin.displacement(shapes_of(values, model.order))
        local: Floats = model.skin.rest + moved + model.shown(values, self._moves)
        return local

    def _prepare(self, copy: Callable[[], Head]) -> None:
        model = _Model(copy(), self._parameters)
        solver = PullSolver(model.skin, model.lips, model.order, self._parameters, self._parameters.neutral())
        solver.solve([Pin(0, model.skin.rest[0])])  # compile before the first drag needs it
        self._model = model


class _PointDrag:
    """A held point whose place determines parameters, among pinned ones and others that shall stay where they are.

    pins : goals of the pinned points (3,) mm, by point.
    """

    def __init__(
        self, model: _Model, point: int, place: Floats, offset: Floats, parameters: Parameters, values: Floats,
        sculpted: Floats, pins: Mapping[int, Floats], *, tied: bool,
    ) -> None:  # fmt: skip
        self.place, self.offset, self.point = place, offset, point
        self._sculpted = np.broadcast_to(sculpted, model.skin.rest.shape)
        self._pins = [Pin(i, goal - self._sculpted[i]) for i, goal in pins.items() if i != point]
        self._solver = PullSolver(model.skin, model.lips, model.order, parameters, values, tied=tied)
        self._returned = values.copy()

    @property
    def missed_mm(self) -> float:
        """How far the farthest point is from its goal, as it is seen."""
        return self._solver.missed_mm

    def solve(self, local: Floats, sight: Floats) -> dict[int, float]:
        """Parameters that changed since the last call, for the point at ``local`` : (3,), head not turned.

        ``sight`` : (3,) the line of sight to it.
        """
        found = self._solver.solve([*self._pins, Pin(self.point, local - self._sculpted[self.point], sight)])
        at = self._solver.moved
        changed = at[np.abs(found[at] - self._returned[at]) > _LEAST_CHANGE]
        self._returned[changed] = found[changed]
        return {int(i): float(found[i]) for i in changed}


class _SculptDrag:
    """A held point that control points ``ids`` : (k,) follow in every direction, each by its ``share`` : (k,)."""

    def __init__(self, model: _Model, point: int, place: Floats, offset: Floats) -> None:
        self.place, self.offset = place, offset
        unit = model.sculptor.solve(model.skin.uv[point : point + 1], np.array([[1.0, 0.0, 0.0]]), least_mm=1e-4)
        self.ids, self.share = unit.ids, unit.moves[:, 0]


def _turn(head_values: Floats) -> Floats:
    """(3, 3) rotation of the head for values (h,) in its own order."""
    return rotation(*read_pose(head_values).head)
