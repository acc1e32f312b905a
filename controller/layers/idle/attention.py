"""Chooses what the gaze rests on (the listener's face, points of interest, or somewhere else) and for how long.

During a glance at the listener, the fixations alternate between parts of the face; during a glance away, they are on
points of interest or wander. How long glances last depends on the manner: alone, listening or speaking.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from controller.layers.idle.draws import draw
from controller.layers.idle.settings import GazeSettings, MannerSettings, PointSettings

Choice = TypeVar("Choice")

_VERTICAL_FACTOR = 0.8
"""Vertical amplitude of a random glance, relative to the horizontal one."""


@dataclass(frozen=True)
class Shift:
    """A gaze shift to a direction (degrees; yaw positive to the left, pitch positive downwards) at a time."""

    time_s: float
    yaw_deg: float
    pitch_deg: float


class Attention:
    """Chooses what to look at, one fixation after another.

    on_listener : whether the current glance is at the listener's face.
    """

    def __init__(self, settings: GazeSettings, numbers: random.Random) -> None:
        self._settings, self._random = settings, numbers
        self.on_listener = True
        self._place: PointSettings | None = None
        self._glance_end_s = self._fixation_end_s = math.inf

    def begin(self, now_s: float, manner: MannerSettings) -> Iterator[Shift]:
        """Start with a glance at the listener."""
        yield from self._glance(now_s, manner, on_listener=True)

    def advance(self, now_s: float, manner: MannerSettings) -> Iterator[Shift]:
        """Yield the gaze shifts that are due until ``now_s``, in order."""
        while min(self._glance_end_s, self._fixation_end_s) <= now_s:
            if self._glance_end_s <= self._fixation_end_s:
                yield from self._glance(self._glance_end_s, manner, on_listener=not self.on_listener)
            else:
                yield self._fixate(self._fixation_end_s, manner)

    def turn(self, now_s: float, manner: MannerSettings, *, on_listener: bool) -> Iterator[Shift]:
        """Begin a glance at the listener, or away; if the current glance is that already, only extend it."""
        if self.on_listener != on_listener:
            yield from self._glance(now_s, manner, on_listener=on_listener)
        else:
            self._draw_glance_end(now_s, manner)

    def _glance(self, now_s: float, manner: MannerSettings, *, on_listener: bool) -> Iterator[Shift]:
        self.on_listener = on_listener
        self._draw_glance_end(now_s, manner)
        yield self._fixate(now_s, manner)

    def _draw_glance_end(self, now_s: float, manner: MannerSettings) -> None:
        self._glance_end_s = now_s + draw(manner.look_s if self.on_listener else manner.away_s, self._random)

    def _fixate(self, now_s: float, manner: MannerSettings) -> Shift:
        self._fixation_end_s = now_s + draw(self._settings.fixation_s, self._random)
        yaw_deg, pitch_deg = self._on_face() if self.on_listener else self._elsewhere(manner.farthest_deg)
        return Shift(now_s, yaw_deg, pitch_deg)

    def _on_face(self) -> tuple[float, float]:
        """Return a direction on the listener's face, on another part than the last one."""
        parts = list(self._settings.listener.values())
        others = [part for part in parts if part is not self._place] or parts
        self._place = self._choose(others, [part.weight for part in others])
        return self._near(self._place)

    def _elsewhere(self, farthest_deg: float) -> tuple[float, float]:
        points, wander = list(self._settings.points.values()), self._settings.wander
        self._place = self._choose([*points, None], [*(point.weight for point in points), wander.weight])
        return self._near(self._place) if self._place is not None else self._wander(farthest_deg)

    def _near(self, point: PointSettings) -> tuple[float, float]:
        yaw_deg, pitch_deg = (self._random.gauss(0.0, point.spread_deg) for _ in range(2))
        return point.yaw_deg + yaw_deg, point.pitch_deg + pitch_deg

    def _wander(self, farthest_deg: float) -> tuple[float, float]:
        """Return a direction with an exponential amplitude in one of eight sectors (Lee, Badler and Badler 2002)."""
        wander = self._settings.wander
        amplitude = wander.least_deg + self._random.expovariate(1.0 / wander.mean_deg)
        amplitude = min(amplitude, max(farthest_deg, wander.least_deg))
        sector = self._choose(range(8), wander.directions)
        angle = (sector + self._random.uniform(-0.5, 0.5)) * math.pi / 4
        return amplitude * math.cos(angle), -_VERTICAL_FACTOR * amplitude * math.sin(angle)

    def _choose(self, choices: Sequence[Choice], weights: Sequence[float]) -> Choice:
        return self._random.choices(choices, weights if sum(weights) > 0.0 else None)[0]
