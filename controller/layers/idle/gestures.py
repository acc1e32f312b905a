"""Small movements of the face: poses of several parameters that rise, hold and fall, now and then or when asked for."""

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
"""How much of a one-sided pose the other side shows."""
_UNEVEN = 0.15
"""How much less one side of a pose for both sides shows at most."""
_LEAST = 0.6
"""Share of its full amount that a gesture has at least."""


@dataclass(frozen=True)
class Pose:
    """Values (P,) of a pose, and which of them are of the left and the right side, (P,) 0 or 1 each."""

    values: Floats
    left: Floats
    right: Floats
    one_sided: bool
    often: float

    @classmethod
    def of(cls, parameters: Parameters, settings: PoseSettings) -> Pose:
        """The pose of a table of names; a name without a side means both."""
        values, left, right = parameters.neutral(), parameters.neutral(), parameters.neutral()
        for name, weight in settings.weights.items():
            found = sides(parameters, name)
            values[found] = weight
            if len(found) == 2:
                left[found[0]] = right[found[1]] = 1.0
        return cls(values, left, right, settings.side == "either", settings.often)

    def drawn(self, numbers: random.Random) -> Floats:
        """(P,) the pose as it comes out this time: a side of its own where it is one-sided, else nearly even."""
        less = 1.0 - _OTHER_SIDE if self.one_sided else numbers.uniform(0.0, _UNEVEN)
        weaker = self.left if numbers.random() < 0.5 else self.right
        drawn: Floats = numbers.uniform(_LEAST, 1.0) * self.values * (1.0 - less * weaker)
        return drawn


class Gestures:
    """Poses of one table, at most one at a time.

    next_s : when the next comes by itself.
    """

    def __init__(self, parameters: Parameters, settings: GestureSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self._poses = poses(parameters, settings.poses)
        if isinstance(settings, FidgetSettings):
            self._poses += poses(parameters, {name: PoseSettings(weights={name: 1.0}) for name in settings.parameters})
        self._shown, self._envelope = parameters.neutral(), Envelope(-math.inf, 1.0, 0.0, 1.0)
        self.next_s = math.inf

    def begin(self, now_s: float) -> None:
        """Start without any."""
        self._envelope = Envelope(-math.inf, 1.0, 0.0, 1.0)
        self.next_s = now_s + draw(self._settings.interval_s, self._random)

    def advance(self, now_s: float, *, wanted: bool = True) -> None:
        """Begin what is due until ``now_s``; nothing where none is wanted, but the next is drawn all the same."""
        gesture, numbers = self._settings, self._random
        while self.next_s <= now_s:
            new = Envelope(self.next_s, gesture.rise_s, draw(gesture.hold_s, numbers), gesture.fall_s)
            shown = chosen(self._poses, numbers)
            self.next_s = new.end_s + draw(gesture.interval_s, numbers)
            if wanted and shown is not None:
                self._envelope, self._shown = new, shown

    def add(self, out: Floats, now_s: float, liveliness: float) -> None:
        """Add what shows at ``now_s`` to ``out`` : (P,)."""
        level = self._envelope.level(now_s)
        if level > 0.0:
            out += level * self._settings.amount * liveliness * self._shown


def poses(parameters: Parameters, table: Mapping[str, PoseSettings]) -> list[Pose]:
    """The poses of a table."""
    return [Pose.of(parameters, settings) for settings in table.values()]


def chosen(among: Sequence[Pose], numbers: random.Random) -> Floats | None:
    """(P,) one of some poses as it comes out this time; None where there is none."""
    weights = [pose.often for pose in among]
    if not sum(weights) > 0.0:
        return None
    drawn = numbers.choices(among, weights)[0].drawn(numbers)
    return drawn if np.isfinite(drawn).all() else None
