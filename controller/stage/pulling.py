"""Pulls points of the skin to goals as a person who makes a face would: with few parameters, the others unchanged.

With x the parameters, x0 their values when the pull began and y = x - x0, each pull minimises over the bounds of x

    sum over pins |P_i (p_i(x) - goal_i)|^2
    + k (w_stay^2 |q(x) - q(x0)|^2 + w_lips^2 |gap(x) - gap(x0)|^2 + ridge |y|^2 + sparsity |y|_1)

P_i projects a displacement across the line of sight, since a mouse gives no depth. q are points all over the face that
are to stay in place; gap the vectors between points of the upper and the lower lip, so that sealed lips stay sealed. k
begins at 1 and is lowered until every pin is within a limit of its goal, or the face cannot come closer. So the rest of
the face changes as little as needed. The bounded solve is that of :mod:`controller.base.solve`; for shapes that are not
linear (jaw, lids) it is repeated with the slopes at the solution (Gauss-Newton).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.anchors import SkinSamples, sample_skin
from surface.head import Head

CLOSE_MM = 0.85
"""Distance to its goal at which a pin counts as there."""
_STAY_WEIGHT, _LIPS_WEIGHT = 0.25, 0.6
_MIRROR_WEIGHT = 0.8  # of the points opposite to the pins on the other side of the face, which are to stay
_DEPTH_WEIGHT = 0.1  # of a pin's displacement along the line of sight
_RIDGE, _SPARSITY, _TOLERANCE = 0.5, 1.5, 1e-4
_PRIOR_FACTOR, _MAX_PRIOR_STEPS, _MAX_ROUNDS = 0.2, 6, 3
_MIN_GAIN = 0.12
"""Least relative reduction of the pins' distance that justifies a weaker prior on the rest of the face."""
_MIN_MOVE_MM = 0.4
"""A shape that moves every pin by less than this is not used."""
_MIN_LOCALITY = 0.3
"""A shape that moves every pin by less than this fraction of its largest displacement belongs to another region, and is
not used: a lowered brow moves the lid, but someone who pulls the lid does not mean the brow."""
_OPENING = (0.68, 0.78)
"""Fractions of the jaw's motion that a pin follows. Above the first, the constraints on lips and on points that the jaw
carries begin to weaken; above the second, they are off."""
_EXCLUDED = ("eyeLook", "tongue", "mouthClose")
"""Prefixes of shapes that no pull changes: gaze, tongue, and mouthClose, which only has a meaning with an open jaw."""
_CONVERGED = 0.01
"""Change of parameters below which the rounds end."""
_STAY_POINTS, _FAR_MM = 40, 28.0
_COLUMN_STEP = 2
"""Every second column of a contact is used."""
_SEALED_MM = 1.5
"""Lips count as sealed if they are at most this much farther apart than at rest."""


@dataclass(frozen=True)
class Pin:
    """A point that is pulled or held.

    point : its index among the samples. goal : (3,) mm, head not turned.
    sight : (3,) the line of sight, along which it may move; None holds it in every direction.
    """

    point: int
    goal: Floats
    sight: Floats | None = None

    def weights(self, depth: float) -> Floats:
        """Return (3, 3), which weights a displacement: 1 across the line of sight, ``depth`` along it."""
        if self.sight is None:
            return np.eye(3)
        along = np.asarray(self.sight, np.float64) / max(float(np.linalg.norm(self.sight)), 1e-12)
        return np.eye(3) - (1.0 - depth) * np.outer(along, along)

    def miss(self, position: Floats) -> float:
        """Return the distance (mm) of a position from the goal, across the line of sight."""
        offset = position - self.goal
        if self.sight is not None:
            along = np.asarray(self.sight, np.float64) / max(float(np.linalg.norm(self.sight)), 1e-12)
            offset = offset - along * float(offset @ along)
        return float(np.linalg.norm(offset))


def lip_pairs(head: Head, part: str) -> tuple[SkinSamples, int]:
    """Return points of the upper lip's rim, followed by the points of the lower lip that they touch; and their number.

    The number of pairs is 0, with no points, for a head whose files do not define where its lips meet.
    """
    contact = next((each for each in head.data.contacts if each.part == part and each.eye < 0), None)
    rims = np.zeros((2, 0, 2)) if contact is None else contact.places[:, ::_COLUMN_STEP, 0]
    if not rims.size:
        return sample_skin(head, part, np.zeros((1, 2)) + 0.5).subset(slice(0, 0)), 0
    return sample_skin(head, part, np.concatenate([rims[0], rims[1]])), rims.shape[1]


class PullSolver:
    """Pulls points of ``skin`` from a face.

    skin : samples of the skin. lips : see :func:`lip_pairs`. order : see :func:`controller.robot.anchors.head_order`.
    parameters : all of them, p. start : (p,) the face that is pulled. tied : whether both sides change equally.

    missed_mm : after a solve, the distance of the farthest pin from its goal, across the line of sight.
    """

    def __init__(
        self, skin: SkinSamples, lips: tuple[SkinSamples, int], order: NDArray[np.intp], parameters: Parameters,
        start: Floats, *, tied: bool = False,
    ) -> None:  # fmt: skip
        count, self._levels = skin.moves.shape[2:]
        self.moved = order[:count]
        self._skin, self._parameters = skin, parameters
        self._x0 = np.clip(start[self.moved], parameters.low[self.moved], parameters.high[self.moved])
        self._values, self._last = start.copy(), self._x0.copy()
        self._ties = _ties(parameters, self.moved) if tied else np.eye(count)
        self._low, self._high = self._bounds()
        self._lips = lips[0] if self._are_sealed(*lips) else None
        self._tied, self._farthest = tied, _max_displacements(skin)
        self._prepared: tuple[int, ...] = ()
        self.missed_mm = 0.0

    def _bounds(self) -> tuple[Floats, Floats]:
        """Return bounds of the changes; of tied sides, the bounds that both can keep."""
        low, high = self._parameters.low[self.moved] - self._x0, self._parameters.high[self.moved] - self._x0
        member = self._ties > 0.0
        lows = np.where(member, low[:, None], -np.inf).max(axis=0)
        highs = np.where(member, high[:, None], np.inf).min(axis=0)
        return np.minimum(lows, 0.0), np.maximum(highs, 0.0)

    def _are_sealed(self, lips: SkinSamples, pairs: int) -> bool:
        """Whether the lips touch in the face that is pulled; open lips are not constrained."""
        if not pairs:
            return False
        at_rest = np.linalg.norm(_gap(lips.rest), axis=1)
        gap = np.linalg.norm(_gap(lips.rest + lips.displacement(self._x0)), axis=1)
        return bool((gap - at_rest).max() < _SEALED_MM)

    def solve(self, pins: Sequence[Pin]) -> Floats:
        """Return parameters (p,) of the face that brings every pin as near to its goal as possible.

        Starts from the last solution, and updates ``missed_mm``.
        """
        self._prepare(tuple(pin.point for pin in pins))
        best, least = self._last, np.inf
        for step in range(_MAX_PRIOR_STEPS):
            x = self._iterate(pins, _PRIOR_FACTOR**step, best)
            missed = self._max_miss(pins, x)
            if missed < (1.0 - _MIN_GAIN) * least:
                best, least = x, missed
            if missed <= CLOSE_MM:
                break
        self._last, self.missed_mm = best, least
        self._values[self.moved] = best
        return self._values.copy()

    def _prepare(self, points: tuple[int, ...]) -> None:
        """Choose the shapes, the points that stay and the weights, for pins at ``points``."""
        if points == self._prepared:
            return
        self._prepared, chosen = points, np.array(points, np.intp)
        self._held = self._skin.subset(chosen)
        stay, other = self._points_to_keep(chosen), self._mirrored_points(chosen)
        self._staying = self._skin.subset(np.concatenate([stay, other]))
        self._held_slopes = Slopes(self._held)
        opening = np.clip((self._held.jaw.max(initial=0.0) - _OPENING[0]) / (_OPENING[1] - _OPENING[0]), 0.0, 1.0)
        weights = np.array([_STAY_WEIGHT] * len(stay) + [_MIRROR_WEIGHT] * len(other))
        weights *= 1.0 - opening * np.clip(self._staying.jaw / _OPENING[0], 0.0, 1.0)
        self._stay_weights = np.repeat(weights, 3)[:, None]
        self._stay_slopes = Slopes(self._staying, lambda moves: self._stay_weights * _flat(moves))
        reach = _max_displacements(self._held)
        names = [self._parameters.names[i] for i in self.moved]
        usable = (reach > _MIN_MOVE_MM) & [not name.startswith(_EXCLUDED) for name in names]
        locality = reach / np.maximum(self._farthest, _MIN_MOVE_MM)
        usable &= locality >= min(_MIN_LOCALITY, locality[usable].max(initial=0.0))  # always keeps the most local one
        self._free = np.flatnonzero(usable @ self._ties > 0.0)
        self._lips_weight = _LIPS_WEIGHT * float(1.0 - opening)
        if self._lips is not None:
            self._lip_slopes = Slopes(self._lips, lambda moves: self._lips_weight * _flat(_gap(moves)))

    def _mirrored_points(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the points opposite to the pins that are far from every pin; none if both sides are tied."""
        if self._tied:
            return np.zeros(0, np.intp)
        rest = self._skin.rest
        opposite = np.linalg.norm(rest[:, None] - (rest[chosen] * [-1.0, 1.0, 1.0])[None], axis=2).argmin(axis=0)
        distance = np.linalg.norm(rest[opposite][:, None] - rest[chosen][None], axis=2).min(axis=1)
        found: NDArray[np.intp] = opposite[distance > _FAR_MM]
        return found

    def _max_miss(self, pins: Sequence[Pin], x: Floats) -> float:
        positions = self._held.rest + self._held.displacement(x)
        return max((pin.miss(position) for pin, position in zip(pins, positions, strict=True)), default=0.0)

    def _points_to_keep(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return points that are to stay in place: spread over the face, none close to a pin."""
        distance = np.linalg.norm(self._skin.rest[:, None] - self._skin.rest[chosen][None], axis=2).min(axis=1)
        far = np.flatnonzero(distance > _FAR_MM)
        return far[:: max(1, len(far) // _STAY_POINTS)]

    def _iterate(self, pins: Sequence[Pin], k: float, x: Floats) -> Floats:
        """Solve with priors of strength ``k``, starting at ``x``, until it converges."""
        for _ in range(_MAX_ROUNDS):
            before, x = x, self._step(pins, k, x)
            if np.abs(x - before).max() < _CONVERGED:
                break
        return x

    def _step(self, pins: Sequence[Pin], k: float, x: Floats) -> Floats:
        soft, held, staying = np.sqrt(k), self._held, self._staying
        rows, goals = [], []
        slopes, positions = self._held_slopes(x), held.rest + held.displacement(x)
        for i, pin in enumerate(pins):
            weights = pin.weights(soft * _DEPTH_WEIGHT)
            rows.append(weights @ slopes[i])
            goals.append(weights @ (pin.goal - positions[i]))
        rows.append(soft * self._stay_slopes(x))
        back = staying.displacement(self._x0) - staying.displacement(x)
        goals.append(soft * self._stay_weights[:, 0] * back.ravel())
        if self._lips is not None and self._lips_weight:
            rows.append(soft * self._lip_slopes(x))
            change_mm = _gap(self._lips.displacement(self._x0)) - _gap(self._lips.displacement(x))
            goals.append(soft * self._lips_weight * change_mm.ravel())
        matrix, goal = np.vstack(rows), np.concatenate(goals)
        goal = goal + matrix @ (x - self._x0)
        ties, free = self._ties[:, self._free], self._free
        solver = BoundedSolver(
            matrix @ ties, self._low[free], self._high[free],
            ridge=k * _RIDGE, sparsity=k * _SPARSITY, tolerance=_TOLERANCE,
        )  # fmt: skip
        change = ties.T @ (x - self._x0) / ties.sum(axis=0)
        return self._x0 + ties @ solver.solve(goal, start=change)


def _max_displacements(samples: SkinSamples) -> Floats:
    """Return (s,) the largest displacement (mm) of any point by each shape."""
    reach: Floats = np.linalg.norm(samples.moves.sum(axis=3), axis=1).max(axis=0, initial=0.0)
    return reach


class Slopes:
    """Slopes of points (mm per unit of each shape), cached until a shape passes from one of its levels to the next.

    samples : m points. finish : converts the slopes (m, 3, s) before they are cached. Default: no conversion.
    """

    def __init__(self, samples: SkinSamples, finish: Callable[[Floats], Floats] = lambda moves: moves) -> None:
        self._moves, self._finish = samples.moves, finish
        self._level = np.full(1, -1)

    def __call__(self, x: Floats) -> Floats:
        """Return the slopes at ``x`` : (s,); the same array until a level changes, so do not write to it."""
        levels = self._moves.shape[3]
        level = np.clip((x * levels).astype(np.intp), 0, levels - 1)
        if not np.array_equal(level, self._level):
            self._level = level
            self._slopes = self._finish(self._moves[:, :, np.arange(len(x)), level] * levels)
        return self._slopes


def _flat(moves: Floats) -> Floats:
    """Reshape (m, 3, s) to (3 m, s)."""
    return moves.reshape(-1, moves.shape[2])


def _gap(moves: Floats) -> Floats:
    """Return the vectors from the points of the lower lip to those of the upper lip."""
    pairs = len(moves) // 2
    return moves[:pairs] - moves[pairs:]


def _ties(parameters: Parameters, moved: NDArray[np.intp]) -> Floats:
    """Return (s, k), whose columns are the shapes that change together if both sides change equally.

    A column has 1 for a left and right pair, or for one shape in the middle. Shapes that move the mouth or jaw sideways
    have no column.
    """
    mirror, position = parameters.mirror(), {int(index): i for i, index in enumerate(moved)}
    columns: dict[tuple[int, ...], None] = {}
    for index, i in position.items():
        other = position.get(int(mirror[index]), i)
        name = parameters.names[index]
        if name not in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            columns[tuple(sorted({i, other}))] = None
    ties = np.zeros((len(moved), len(columns)))
    for k, members in enumerate(columns):
        ties[list(members), k] = 1.0
    return ties
