"""Pulls points of the skin to wanted places as a person who makes a face would: with few parameters, the rest at rest.

With x the parameters, x0 those when the pull began and y = x - x0, each pull minimises over the bounds of x

    sum over pins |P_i (p_i(x) - goal_i)|^2
    + k (w_stay^2 |q(x) - q(x0)|^2 + w_lips^2 |gap(x) - gap(x0)|^2 + ridge |y|^2 + sparsity |y|_1)

P_i takes only what is seen of a way: across the line of sight, since a mouse says nothing of the depth. q are points
all over the face that shall stay; gap the ways between points of the upper and the lower lip, so that sealed lips stay
sealed. k begins at 1 and is lowered until every pin is closer than a limit to its goal, or the face cannot go further:
what must give then gives as little as needed. The bounded solve is that of :mod:`controller.base.solve`; where shapes
bend (jaw, lids) it is repeated with the slopes at the face that was found (Gauss and Newton).
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
"""A pin is at its goal from here on."""
_STAY, _LIPS = 0.25, 0.6
_OTHER_SIDE, _DEPTH = 0.8, 0.1  # weights of the pins' mirrored places, and of the depth of a pin
_RIDGE, _SPARSITY, _TOLERANCE = 0.5, 1.5, 1e-4
_EASE, _STEPS, _ROUNDS = 0.2, 6, 3
_WORTH = 0.12
"""By which share a weaker prior must bring the pins closer to be worth what it costs the rest of the face."""
_TOUCH_MM = 0.4
"""A shape that moves every pin by less takes no part."""
_OWN = 0.3
"""A shape that moves every pin by less than this share of its farthest point belongs to another place of the face: a
lowered brow takes the lid along, but who pulls the lid does not mean the brow."""
_OPENING = (0.68, 0.78)
"""Share of the jaw's motion that a pin follows: from the first on lips may open and the jaw take what it carries along,
from the second on nothing hinders it."""
_NEVER = ("eyeLook", "tongue", "mouthClose")
"""Shapes that no pull of the skin changes: gaze, tongue, and what an open jaw alone gives a meaning."""
_SETTLED = 0.01
_STAYING, _FAR_MM = 40, 28.0
_EVERY, _SEALED_MM = 2, 1.5  # columns of a contact; lips that are farther apart than at rest by less are sealed


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
        """(3, 3): what counts of a way; ``depth`` : how much its part along the line of sight does."""
        if self.sight is None:
            return np.eye(3)
        along = np.asarray(self.sight, np.float64) / max(float(np.linalg.norm(self.sight)), 1e-12)
        return np.eye(3) - (1.0 - depth) * np.outer(along, along)

    def miss(self, place: Floats) -> float:
        """How far a place is from the goal as it is seen, mm."""
        away = place - self.goal
        if self.sight is not None:
            along = np.asarray(self.sight, np.float64) / max(float(np.linalg.norm(self.sight)), 1e-12)
            away = away - along * float(away @ along)
        return float(np.linalg.norm(away))


def lip_pairs(head: Head, part: str) -> tuple[SkinSamples, int]:
    """Points of the upper lip's rim, then those of the lower one that each touches; and how many pairs there are.

    None for a head whose files do not say where its lips meet.
    """
    contact = next((each for each in head.data.contacts if each.part == part and each.eye < 0), None)
    rims = np.zeros((2, 0, 2)) if contact is None else contact.places[:, ::_EVERY, 0]
    if not rims.size:
        return sample_skin(head, part, np.zeros((1, 2)) + 0.5).subset(slice(0, 0)), 0
    return sample_skin(head, part, np.concatenate([rims[0], rims[1]])), rims.shape[1]


class PullSolver:
    """Pulls points of ``skin`` from a face.

    skin : samples of the skin. lips : see :func:`lip_pairs`. order : see :func:`controller.robot.anchors.head_order`.
    parameters : all of them, p. start : (p,) the face that is pulled. tied : whether both sides change alike.
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
        self._lips = lips[0] if self._sealed(*lips) else None
        self._tied, self._farthest = tied, _reach(skin)
        self._prepared: tuple[int, ...] = ()
        self.missed_mm = 0.0

    def _bounds(self) -> tuple[Floats, Floats]:
        """Bounds of the changes, where both sides change alike those that both keep."""
        low, high = self._parameters.low[self.moved] - self._x0, self._parameters.high[self.moved] - self._x0
        member = self._ties > 0.0
        lows = np.where(member, low[:, None], -np.inf).max(axis=0)
        highs = np.where(member, high[:, None], np.inf).min(axis=0)
        return np.minimum(lows, 0.0), np.maximum(highs, 0.0)

    def _sealed(self, lips: SkinSamples, pairs: int) -> bool:
        """Whether the lips touch in the face that is pulled; apart, they may go where they like."""
        if not pairs:
            return False
        at_rest = np.linalg.norm(_gap(lips.rest), axis=1)
        gap = np.linalg.norm(_gap(lips.rest + lips.displacement(self._x0)), axis=1)
        return bool((gap - at_rest).max() < _SEALED_MM)

    def solve(self, pins: Sequence[Pin]) -> Floats:
        """Parameters (p,) of the face that brings every pin to its goal, as far as a face can.

        Starts from the last solution. ``missed_mm`` is how far the farthest pin is from its goal then, as it is seen.
        """
        self._prepare(tuple(pin.point for pin in pins))
        best, least = self._last, np.inf
        for step in range(_STEPS):
            x = self._settle(pins, _EASE**step, best)
            missed = self._miss(pins, x)
            if missed < (1.0 - _WORTH) * least:
                best, least = x, missed
            if missed <= CLOSE_MM:
                break
        self._last, self.missed_mm = best, least
        self._values[self.moved] = best
        return self._values.copy()

    def _prepare(self, points: tuple[int, ...]) -> None:
        """Choose what takes part, for pins at ``points``."""
        if points == self._prepared:
            return
        self._prepared, chosen = points, np.array(points, np.intp)
        self._held = self._skin.subset(chosen)
        stay, other = self._stay(chosen), self._other_side(chosen)
        self._staying = self._skin.subset(np.concatenate([stay, other]))
        self._held_slopes = Slopes(self._held)
        opening = np.clip((self._held.jaw.max(initial=0.0) - _OPENING[0]) / (_OPENING[1] - _OPENING[0]), 0.0, 1.0)
        weights = np.array([_STAY] * len(stay) + [_OTHER_SIDE] * len(other))
        weights *= 1.0 - opening * np.clip(self._staying.jaw / _OPENING[0], 0.0, 1.0)
        self._stay_weights = np.repeat(weights, 3)[:, None]
        self._stay_slopes = Slopes(self._staying, lambda moves: self._stay_weights * _flat(moves))
        reach = _reach(self._held)
        names = [self._parameters.names[i] for i in self.moved]
        able = (reach > _TOUCH_MM) & [not name.startswith(_NEVER) for name in names]
        own = reach / np.maximum(self._farthest, _TOUCH_MM)
        able &= own >= min(_OWN, own[able].max(initial=0.0))  # where no shape is at home, the one that is most so
        self._free = np.flatnonzero(able @ self._ties > 0.0)
        self._lips_weight = _LIPS * float(1.0 - opening)
        if self._lips is not None:
            self._lip_slopes = Slopes(self._lips, lambda moves: self._lips_weight * _flat(_gap(moves)))

    def _other_side(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Points across the face of the pins, where no pin is near; none where both sides move alike."""
        if self._tied:
            return np.zeros(0, np.intp)
        rest = self._skin.rest
        across = np.linalg.norm(rest[:, None] - (rest[chosen] * [-1.0, 1.0, 1.0])[None], axis=2).argmin(axis=0)
        away = np.linalg.norm(rest[across][:, None] - rest[chosen][None], axis=2).min(axis=1)
        found: NDArray[np.intp] = across[away > _FAR_MM]
        return found

    def _miss(self, pins: Sequence[Pin], x: Floats) -> float:
        places = self._held.rest + self._held.displacement(x)
        return max((pin.miss(place) for pin, place in zip(pins, places, strict=True)), default=0.0)

    def _stay(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Points that shall stay: spread over the face, none close to a pin."""
        away = np.linalg.norm(self._skin.rest[:, None] - self._skin.rest[chosen][None], axis=2).min(axis=1)
        far = np.flatnonzero(away > _FAR_MM)
        return far[:: max(1, len(far) // _STAYING)]

    def _settle(self, pins: Sequence[Pin], k: float, x: Floats) -> Floats:
        """Solve with priors of strength ``k``, from ``x``, until it settles."""
        for _ in range(_ROUNDS):
            before, x = x, self._step(pins, k, x)
            if np.abs(x - before).max() < _SETTLED:
                break
        return x

    def _step(self, pins: Sequence[Pin], k: float, x: Floats) -> Floats:
        soft, held, staying = np.sqrt(k), self._held, self._staying
        rows, goals = [], []
        slopes, here = self._held_slopes(x), held.rest + held.displacement(x)
        for i, pin in enumerate(pins):
            weights = pin.weights(soft * _DEPTH)
            rows.append(weights @ slopes[i])
            goals.append(weights @ (pin.goal - here[i]))
        rows.append(soft * self._stay_slopes(x))
        back = staying.displacement(self._x0) - staying.displacement(x)
        goals.append(soft * self._stay_weights[:, 0] * back.ravel())
        if self._lips is not None and self._lips_weight:
            rows.append(soft * self._lip_slopes(x))
            way = _gap(self._lips.displacement(self._x0)) - _gap(self._lips.displacement(x))
            goals.append(soft * self._lips_weight * way.ravel())
        matrix, goal = np.vstack(rows), np.concatenate(goals)
        goal = goal + matrix @ (x - self._x0)
        ties, free = self._ties[:, self._free], self._free
        solver = BoundedSolver(
            matrix @ ties, self._low[free], self._high[free],
            ridge=k * _RIDGE, sparsity=k * _SPARSITY, tolerance=_TOLERANCE,
        )  # fmt: skip
        change = ties.T @ (x - self._x0) / ties.sum(axis=0)
        return self._x0 + ties @ solver.solve(goal, start=change)


def _reach(samples: SkinSamples) -> Floats:
    """(s,) how far each shape moves the point that it moves the furthest, mm."""
    reach: Floats = np.linalg.norm(samples.moves.sum(axis=3), axis=1).max(axis=0, initial=0.0)
    return reach


class Slopes:
    """How points move with each shape, mm per unit, kept until a shape passes from one of its levels to the next.

    samples : the points. finish : what is made of the slopes (m, 3, s), and kept; themselves without.
    """

    def __init__(self, samples: SkinSamples, finish: Callable[[Floats], Floats] = lambda moves: moves) -> None:
        self._moves, self._finish = samples.moves, finish
        self._level = np.full(1, -1)

    def __call__(self, x: Floats) -> Floats:
        """At ``x`` : (s,); the same array until a level changes, which is not to be written to."""
        levels = self._moves.shape[3]
        level = np.clip((x * levels).astype(np.intp), 0, levels - 1)
        if not np.array_equal(level, self._level):
            self._level = level
            self._slopes = self._finish(self._moves[:, :, np.arange(len(x)), level] * levels)
        return self._slopes


def _flat(moves: Floats) -> Floats:
    """(m, 3, s) as (3 m, s)."""
    return moves.reshape(-1, moves.shape[2])


def _gap(moves: Floats) -> Floats:
    """The ways from the points of the lower lip to those of the upper one."""
    pairs = len(moves) // 2
    return moves[:pairs] - moves[pairs:]


def _ties(parameters: Parameters, moved: NDArray[np.intp]) -> Floats:
    """(s, k) which changes go together where both sides change alike: one column a pair, one for each in the middle.

    What moves the mouth or jaw aside has no column: it cannot be alike on both sides.
    """
    mirror, place = parameters.mirror(), {int(index): i for i, index in enumerate(moved)}
    columns: dict[tuple[int, ...], None] = {}
    for index, i in place.items():
        other = place.get(int(mirror[index]), i)
        name = parameters.names[index]
        if name not in ("jawLeft", "jawRight", "mouthLeft", "mouthRight"):
            columns[tuple(sorted({i, other}))] = None
    ties = np.zeros((len(moved), len(columns)))
    for k, members in enumerate(columns):
        ties[list(members), k] = 1.0
    return ties
