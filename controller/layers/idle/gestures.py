"""Makes small movements of the face (fidgets, smiles, swallows) at random times: poses that rise, hold and fall."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.layers.idle.draws import draw
from controller.layers.idle.settings import FidgetSettings, GestureSettings, PoseSettings
from controller.motion.motion import Envelope
from controller.vocabulary.sides import sides

_OTHER_SIDE = 0.35
"""Factor on the values of the weaker side of a one-sided pose."""
_MAX_UNEVENNESS = 0.15
"""Greatest fraction by which one side of a two-sided pose is weaker."""
_MIN_AMOUNT = 0.6
"""Smallest fraction of its full amount with which a gesture shows."""


@dataclass(frozen=True)
class Pose:
    """A pose.

    values : (P,). left, right : (P,) 1 for the parameters of that side, else 0. often : relative frequency.
    """

    values: Floats
    left: Floats
    right: Floats
    one_sided: bool
    often: float

    @classmethod
    def of(cls, parameters: Parameters, settings: PoseSettings) -> Pose:
        """Return the pose of a table of names; a name without a side means both sides."""
        values, left, right = parameters.neutral(), parameters.neutral(), parameters.neutral()
        for name, weight in settings.weights.items():
            found = sides(parameters, name)
            values[found] = weight
            if len(found) == 2:
                left[found[0]] = right[found[1]] = 1.0
        return cls(values, left, right, settings.side == "either", settings.often)

    def draw(self, numbers: random.Random) -> Floats:
        """Return a random variation (P,) of the pose: one side is weaker, much so if the pose is one-sided."""
        less = 1.0 - _OTHER_SIDE if self.one_sided else numbers.uniform(0.0, _MAX_UNEVENNESS)
        weaker = self.left if numbers.random() < 0.5 else self.right
        drawn: Floats = numbers.uniform(_MIN_AMOUNT, 1.0) * self.values * (1.0 - less * weaker)
        return drawn


class Gestures:
    """Shows the poses of one table at random times, at most one at a time.

    next_s : time of the next one.
    """

    def __init__(self, parameters: Parameters, settings: GestureSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self._poses = poses(parameters, settings.poses)
        if isinstance(settings, FidgetSettings):
            self._poses += poses(parameters, {name: PoseSettings(weights={name: 1.0}) for name in settings.parameters})
        self._shown, self._envelope = parameters.neutral(), Envelope(-math.inf, 1.0, 0.0, 1.0)
        self.next_s = math.inf

    def begin(self, now_s: float) -> None:
        """Start with no pose."""
        self._envelope = Envelope(-math.inf, 1.0, 0.0, 1.0)
        self.next_s = now_s + draw(self._settings.interval_s, self._random)

    def advance(self, now_s: float, *, wanted: bool = True) -> None:
        """Begin the poses that are due until ``now_s``; unless ``wanted``, they are drawn but not shown."""
        gesture, numbers = self._settings, self._random
        while self.next_s <= now_s:
            new = Envelope(self.next_s, gesture.rise_s, draw(gesture.hold_s, numbers), gesture.fall_s)
            shown = draw_pose(self._poses, numbers)
            self.next_s = new.end_s + draw(gesture.interval_s, numbers)
            if wanted and shown is not None:
                self._envelope, self._shown = new, shown

    def add(self, out: Floats, now_s: float, liveliness: float) -> None:
        """Add the pose at ``now_s`` to ``out`` : (P,)."""
        level = self._envelope.level(now_s)
        if level > 0.0:
            out += level * self._settings.amount * liveliness * self._shown


def poses(parameters: Parameters, table: Mapping[str, PoseSettings]) -> list[Pose]:
    """Return the poses of a table."""
    return [Pose.of(parameters, settings) for settings in table.values()]


def draw_pose(candidates: Sequence[Pose], numbers: random.Random) -> Floats | None:
    """Return a random variation (P,) of a random pose; None if there is no pose."""
    weights = [pose.often for pose in candidates]
    if not sum(weights) > 0.0:
        return None
    drawn = numbers.choices(candidates, weights)[0].draw(numbers)
    return drawn if np.isfinite(drawn).all() else None
