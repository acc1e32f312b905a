"""Lets the mouse pick points of the face in the picture and drag them in the plane of the screen.

Dragging moves parameters; sculpting moves control points of the drawn head, which can be saved as a group file. Light
control points, which the user has added to the head, are moved one by one. This module does not depend on the window
library.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats, Parameters
from controller.face.sculpting import LightDrag, SculptDrag
from controller.face.skin_lines import even_line, knots_around, mirror_uv
from controller.face.skin_model import PART, Screen, SkinModels, head_rotation
from controller.face.skin_model import SkinModel as _Model
from controller.stage.inverse import GroupMoves, save_group
from controller.stage.pulling import Pin, PullSolver
from surface.head import Head
from surface.head.model.furrow import Furrow, even_moves, furrow_knots
from surface.head.model.light import WEIGHT, LightPoints, join_light, with_points
from surface.head.model.meshes import make_surface

_PICK_PIXELS = 16.0  # greatest distance of a picked point from the mouse
_HIDING_PIXELS, _HIDDEN_MM = 48.0, 40.0  # a point this much deeper than another one within these pixels is hidden
_MIN_CHANGE, _MIN_MOVE_MM = 0.004, 0.01
_MIDDLE_MM = 2.0  # points nearer to the plane of symmetry count as their own mirror images


class PointEditor:
    """Picks points of a head in a picture and drags them.

    It samples a copy of the head, in a separate thread, when the user first picks a point.

    head : the head that is drawn; sculpting moves its control points. models : makes the skin model of the head.
    light : the control points that the user has added, which are the head's last ones.

    Between the head's own control points and these, saved groups may have added other light ones, which move only with
    their groups: :attr:`moves` and :meth:`set_moves` do not include them.
    """

    def __init__(self, head: Head, models: SkinModels, light: Sequence[LightPoints] = ()) -> None:
        self.head, self._rig = head, head.part(PART).rig  # type: ignore[attr-defined]
        self._models, self._parameters = models, models.parameters
        self._rest, self.light = self._rig.rest.copy(), tuple(light)
        n, added = len(self._rest), sum(len(each) for each in light)
        self._free = np.arange(n) >= n - added  # those that the user added; the head's own follow below
        self._heavy: NDArray[np.bool_] = head.part(PART).surface.weights > WEIGHT
        self._free |= self._heavy
        self._set: Floats = np.zeros((int(self._free.sum()), 3))
        self._moves: Floats = np.zeros_like(self._rest)
        self._before = self._moves
        self._model: _Model | None = None
        self._held: _PointDrag | SculptDrag | LightDrag | None = None
        self._pending: tuple[tuple[float, float], Screen, Floats, bool, bool, float | None] | None = None
        self._pins: dict[int, Floats] = {}
        self._settled = False
        self._last: int | None = None
        self._thread = threading.Thread(target=self._prepare, name="point editor", daemon=True)

    @property
    def ready(self) -> bool:
        """Whether points can be picked."""
        return self._model is not None

    @property
    def dragging(self) -> bool:
        """Whether a point is held, or will be as soon as points can be picked."""
        return self._held is not None or self._pending is not None

    @property
    def settled(self) -> bool:
        """Whether the last drag was carried out; False while the points are being prepared."""
        return self._settled

    @property
    def moves(self) -> Floats:
        """(n, 3) mm, moves of the head's own control points, then of those the user added; a new array per change."""
        return self._set

    @property
    def own(self) -> int:
        """Number of the head's control points without added ones."""
        return int(self._heavy.sum())

    @property
    def sculpted(self) -> bool:
        """Whether control points were moved."""
        return bool(self._moves.any())

    def prepare(self) -> None:
        """Start preparing the points; may be called repeatedly."""
        if self._thread.ident is None:
            self._thread.start()

    def take(
        self, pixel: tuple[float, float], screen: Screen, values: Floats, *, sculpt: bool = False, tied: bool = False,
        falloff_mm: float | None = None,
    ) -> bool:  # fmt: skip
        """Pick the point of the skin under a pixel; return False if there is none.

        While the points are being prepared, the request is kept and carried out by :meth:`drag` afterwards.

        values : (P,) parameters of the shown face. sculpt : whether to move control points instead of parameters.
        tied : whether both sides of the face change alike. falloff_mm : see :class:`.sculpting.SculptDrag`.
        """
        self._settled = False
        if self._model is None:
            self._pending = (pixel, screen, values.copy(), sculpt, tied, falloff_mm)
            self.prepare()
            return True
        return self._take(self._model, pixel, screen, values, sculpt, tied, falloff_mm)

    def _take(
        self, model: _Model, pixel: tuple[float, float], screen: Screen, values: Floats, sculpt: bool, tied: bool,
        falloff_mm: float | None,
    ) -> bool:  # fmt: skip
        places, turn = self._places(model, values)
        shown = screen.project(places)
        towards = np.einsum("mc,mc->m", model.normals @ turn.T, np.array(screen.camera.eye) - places) > 0.0
        away = np.hypot(shown[:, 0] - pixel[0], shown[:, 1] - pixel[1]) + np.where(towards, 0.0, np.inf)
        first = np.min(shown[away < _HIDING_PIXELS, 2], initial=np.inf)
        point = int(np.argmin(np.where(shown[:, 2] < first + _HIDDEN_MM, away, np.inf)))
        if away[point] > _PICK_PIXELS:
            return False
        self._last = point
        if sculpt:
            self._take_skin(model, point, pixel, screen, values, tied, falloff_mm)
            return True
        offset = places[point] - screen.place(pixel, places[point])
        self._held = _PointDrag(
            model, point, places[point], offset, self._parameters, values, model.shown(values, self._moves), self._pins,
            tied=tied,
        )  # fmt: skip
        return True

    def _take_skin(
        self, model: _Model, point: int, pixel: tuple[float, float], screen: Screen, values: Floats, tied: bool,
        falloff_mm: float | None,
    ) -> None:  # fmt: skip
        """Pick the exact place of the skin under a pixel, or, just outside the face, the sampled point."""
        uv = model.under(np.array([pixel]), screen, values, self._moves)
        if not np.isfinite(uv).all():
            uv = model.skin.uv[point : point + 1]
        place = model.places_of(uv, values, self._moves)[0]
        offset = place - screen.place(pixel, place)
        self._held = SculptDrag(model, uv, place, offset, self._heavy, falloff_mm, tied=tied)

    def take_light(
        self, pixel: tuple[float, float], screen: Screen, values: Floats, *, tied: bool = False
    ) -> int | None:  # fmt: skip
        """Pick the user's control point nearest to a pixel, if ``tied`` with that on the other side.

        Returns its number among the user's control points; None if there is none near, or points are not ready.
        """
        self._settled = False
        model, found = self._model, self.light_at(pixel, screen, values)
        if model is None or found is None:
            return None
        centres = self._centres()
        rest = model.surface.evaluate(centres)
        across = np.linalg.norm(rest - rest[found] * [-1.0, 1.0, 1.0], axis=1)
        other = int(np.argmin(across))
        both = [found, other] if tied and other != found and across[other] < _MIDDLE_MM else [found]
        place = model.places_of(centres[found : found + 1], values, self._moves)[0]
        ids = len(self._rest) - len(centres) + np.array(both)
        self._held = LightDrag(model, ids, centres[both], place, place - screen.place(pixel, place))
        return found

    def light_at(self, pixel: tuple[float, float], screen: Screen, values: Floats) -> int | None:
        """Return the number of the user's control point nearest to a pixel; None if none is near."""
        shown = self.light_pixels(screen, values)
        if not shown:
            return None
        away = np.hypot(*(np.array(shown) - pixel).T)
        return int(np.argmin(away)) if away.min() < _PICK_PIXELS else None

    def light_pixels(self, screen: Screen, values: Floats) -> list[tuple[float, float]]:
        """Return the pixels of the control points that the user has added."""
        centres = self._centres()
        if self._model is None or not len(centres):
            return []
        shown = screen.project(self._model.places_of(centres, values, self._moves))
        return [(float(x), float(y)) for x, y, _ in shown]

    def _centres(self) -> Floats:
        own = [each.centres for each in self.light]
        return np.concatenate([np.zeros((0, 2)), *own])

    def point_at(
        self, pixel: tuple[float, float], screen: Screen, values: Floats, reach_mm: float, *, tied: bool = False
    ) -> LightPoints | None:
        """Return a control point to add under a pixel, if ``tied`` also on the other side; None outside the face.

        reach_mm : how far from its centre it moves the skin.
        """
        model = self._model
        uv = np.zeros((0, 2)) if model is None else model.under(np.array([pixel]), screen, values, self._moves)
        if model is None or not np.isfinite(uv).all():
            return None
        centres = [
            uv,
            *([mirror_uv(model.surface, uv, *model.mesh_rest)] if tied and self._is_off_centre(model, uv) else []),
        ]
        knots = [knots_around(model.surface, each[0], reach_mm) for each in centres]
        return LightPoints(PART, *(np.concatenate([pair[k] for pair in knots]) for k in range(2)))

    def wrinkle(
        self, pixels: Sequence[tuple[float, float]], screen: Screen, values: Floats, depth_mm: float, width_mm: float,
        *, tied: bool = False,
    ) -> tuple[LightPoints, Floats] | None:  # fmt: skip
        """Return k control points to add along a line of pixels, and their moves (k, 3) mm that make a furrow.

        None if the line is too short or not on the face. tied : whether to make another one on the other side.
        """
        model = self._model
        if model is None:
            return None
        line = even_line(model.surface, model.under(np.array(pixels), screen, values, self._moves), width_mm)
        if not len(line):
            return None
        other = tied and self._is_off_centre(model, line)
        lines = [line, *([mirror_uv(model.surface, line, *model.mesh_rest)] if other else [])]
        furrows = [Furrow(each, depth_mm, width_mm) for each in lines]
        knots = [furrow_knots(each, model.surface) for each in furrows]
        light = LightPoints(PART, *(np.concatenate([pair[k] for pair in knots]) for k in range(2)))
        surface, first = make_surface(with_points(model.data, light)), model.surface.n
        ids = [first + np.arange(len(line)) + i * len(line) for i in range(len(lines))]
        moves = [even_moves(each, surface, own) for each, own in zip(furrows, ids, strict=True)]
        return light, np.concatenate(moves)

    @staticmethod
    def _is_off_centre(model: _Model, uv: Floats) -> bool:
        """Whether all points (k, 2) are away from the plane of symmetry."""
        places = model.surface.evaluate(uv)
        return bool(np.abs(places[:, 0]).min() > _MIDDLE_MM)

    def drag(self, pixel: tuple[float, float], screen: Screen, values: Floats) -> dict[int, float]:
        """Move the held point to a pixel; return the values at which to hold parameters, by index."""
        model = self._model
        if model is not None and self._pending is not None:
            pending, self._pending = self._pending, None
            self._take(model, *pending)
        elif model is None and not self._thread.is_alive():
            self._pending = None  # the preparation has failed
        self._settled, held = self._pending is None, self._held
        if held is None or model is None:
            return {}
        wanted = screen.place(pixel, held.place) + held.offset
        turn = head_rotation(values[model.order])
        local = model.pivot + turn.T @ (wanted - model.pivot)
        if isinstance(held, _PointDrag):
            return held.solve(local, turn.T @ (wanted - np.array(screen.camera.eye)))
        moves = self._before.copy()
        moves[held.ids] += held.share * (turn.T @ (wanted - held.place))
        self._set_moves(moves)
        return {}

    @property
    def missed_mm(self) -> float:
        """Largest visible distance of a held or pinned point from its goal; 0 without a drag of parameters."""
        return self._held.missed_mm if isinstance(self._held, _PointDrag) else 0.0

    def pin(self, values: Floats) -> None:
        """Pin the held point at its position in the face ``values`` : (P,), which later drags of other points keep."""
        if isinstance(self._held, _PointDrag) and self._model is not None:
            self._pins[self._held.point] = self._model.local(values, self._moves)[self._held.point]

    def unpin(self) -> None:
        """Unpin all points."""
        self._pins = {}

    @property
    def pinned(self) -> int:
        """Number of pinned points."""
        return len(self._pins)

    def pin_pixels(self, screen: Screen, values: Floats) -> list[tuple[float, float]]:
        """Return the pixels of the goals of the pinned points."""
        if self._model is None or not self._pins:
            return []
        turn, pivot = head_rotation(values[self._model.order]), self._model.pivot
        shown = screen.project(pivot + (np.array(list(self._pins.values())) - pivot) @ turn.T)
        return [(float(x), float(y)) for x, y, _ in shown]

    def release(self) -> None:
        """Release the held point; moved control points stay moved."""
        self._held, self._pending, self._before = None, None, self._moves

    def undo(self) -> None:
        """Move all control points back to their original positions."""
        self.set_moves(None)

    def set_moves(self, moves: Floats | None) -> None:
        """Set the moves of the control points, (n, 3) mm from their original positions; None: no moves."""
        every = np.zeros_like(self._rest)
        if moves is not None:
            every[self._free] = moves
        self._set_moves(every, moves)
        self.release()

    def convert_moves(self, moves: Floats | None, light: Sequence[LightPoints]) -> Floats | None:
        """Return moves of a head with other added points ``light`` as moves (n, 3) of this head.

        Points that only one of the two has do not move. None if the heads have different control points of their own.
        """
        own, added = self.own, sum(len(each) for each in light)
        if moves is None or len(moves) - added != own:
            return None
        if tuple(light) == self.light:
            return moves
        out = np.zeros_like(self._set)
        out[:own] = moves[:own]
        same, row = 0, own
        while same < min(len(light), len(self.light)) and light[same] is self.light[same]:
            row += len(light[same])
            same += 1
        out[own:row] = moves[own:row]
        return out

    def group(self) -> GroupMoves:
        """Return the moves of the head's own control points and of added ones, as far as they were moved."""
        moved = np.linalg.norm(self._set, axis=1) >= _MIN_MOVE_MM
        own = self.own
        ids = np.flatnonzero(moved[:own]).astype(np.int32)
        found, added = GroupMoves(PART, ids, self._set[ids]), np.flatnonzero(moved[own:])
        if not len(added):
            return found
        light = join_light(self.light)[PART].take(added)
        return GroupMoves(PART, ids, found.moves, light, self._set[own + added])

    def last_pull(self, values: Floats) -> tuple[Floats, Floats]:
        """Return the rest position (3,) mm of the last held point, and its displacement (3,) mm in the face ``values``.

        values : (P,). The displacement includes moved control points but not the rotation of the head. Both are 0 if no
        point was held.
        """
        if self._model is None or self._last is None:
            return np.zeros(3), np.zeros(3)
        place = self._model.skin.rest[self._last]
        return place, self._model.local(values, self._moves)[self._last] - place

    def save(self, path: Path, name: str) -> None:
        """Write the moved control points as a group file, for ``groups`` in a stage file. Raises ControllerError."""
        save_group(path, name, self.group())

    def _set_moves(self, moves: Floats, free: Floats | None = None) -> None:
        self._moves, self._set = moves, moves[self._free] if free is None else free
        np.add(self._rest, moves, out=self._rig.rest)
        self._rig.invalidate()

    def _places(self, model: _Model, values: Floats) -> tuple[Floats, Floats]:
        """Return the positions (m, 3) mm of the sampled points, and the head's rotation (3, 3)."""
        return model.turned(model.local(values, self._moves), values)

    def _prepare(self) -> None:
        self._model = self._models.make(self.light)


class _PointDrag:
    """A held point whose position determines parameters, while pinned points keep their positions.

    pins : goals (3,) mm of the pinned points, by point.
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
        """Largest visible distance of a point from its goal."""
        return self._solver.missed_mm

    def solve(self, local: Floats, sight: Floats) -> dict[int, float]:
        """Return the parameters that changed since the last call, by index, for the point at ``local`` : (3,) mm.

        local : before the rotation of the head. sight : (3,) the line of sight to it.
        """
        found = self._solver.solve([*self._pins, Pin(self.point, local - self._sculpted[self.point], sight)])
        moved = self._solver.moved
        changed = moved[np.abs(found[moved] - self._returned[moved]) > _MIN_CHANGE]
        self._returned[changed] = found[changed]
        return {int(i): float(found[i]) for i in changed}
