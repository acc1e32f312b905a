"""Plays named expressions: they rise, hold and fall, starting at the current face, so that interrupting never jumps.

There is one mood, held until the next one, and at most one timed expression over it; when its time is over, the face
returns to the mood. A timed gesture moves only what it names, so that a wink during a smile keeps the smile.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats
from controller.motion.motion import minimum_jerk
from controller.vocabulary.expression import Expression

_OVERRIDES = 3


@dataclass
class _Pose:
    """A target of the face: an expression at an intensity.

    goal : (P + 3,) values, then how much blinks, gaze and speech are suppressed. offset_s : time in which it falls.
    """

    name: str
    intensity: float
    goal: Floats
    offset_s: float


class ExpressionPlayer:
    """Moves between expressions, from and back to ``neutral``."""

    def __init__(self, neutral: Expression) -> None:
        self._now = np.zeros(len(neutral.weights) + _OVERRIDES)
        self._from = self._now.copy()
        self._neutral = self._mood = self._target = self._pose(neutral, 1.0)
        self._start_s, self._length_s = -np.inf, 0.0
        self._fall_at_s = np.inf

    @property
    def name(self) -> str:
        """Name of the expression that is shown or approached."""
        return self._target.name

    @property
    def intensity(self) -> float:
        """Its intensity, 0..1."""
        return self._target.intensity

    @property
    def blocks(self) -> tuple[float, float, float]:
        """How much blinks, gaze and speech are suppressed, 0..1 each."""
        blink, gaze, mouth = self._now[-_OVERRIDES:].tolist()
        return blink, gaze, mouth

    def play(self, expression: Expression, intensity: float, duration_s: float | None, now_s: float) -> None:
        """Show an expression for ``duration_s`` until it falls; None: as the new mood.

        Raises ParameterError: its values are not finite.
        """
        pose = self._pose(expression, intensity)
        self.update(now_s)
        if duration_s is None:
            self._mood = pose
            self._fall_at_s = np.inf
            self._move_to(pose, expression.onset_s, now_s)
        else:
            if expression.kind == "gesture":
                stronger = np.abs(pose.goal) > np.abs(self._mood.goal)
                pose.goal = np.where(stronger, pose.goal, self._mood.goal)
            self._fall_at_s = now_s + duration_s
            self._move_to(pose, min(expression.onset_s, duration_s), now_s)

    def rest(self, seconds: float, now_s: float) -> None:
        """Return to the neutral mood over ``seconds``."""
        self.update(now_s)
        self._mood = self._neutral
        self._fall_at_s = np.inf
        self._move_to(self._mood, seconds, now_s)

    def update(self, now_s: float) -> Floats:
        """Advance to ``now_s`` and return the face, (P,) float64; a view that later calls overwrite."""
        if now_s >= self._fall_at_s:
            self._blend(self._fall_at_s)
            fall_at, self._fall_at_s = self._fall_at_s, np.inf
            self._move_to(self._mood, self._target.offset_s, fall_at)
        self._blend(now_s)
        return self._now[:-_OVERRIDES]

    def _move_to(self, pose: _Pose, length_s: float, now_s: float) -> None:
        self._from[:] = self._now
        self._target = pose
        self._start_s, self._length_s = now_s, length_s

    def _blend(self, now_s: float) -> None:
        passed = max(now_s - self._start_s, 0.0)  # a command can be newer than the first tick that shows it
        if passed >= self._length_s:
            self._now[:] = self._target.goal
            return
        np.subtract(self._target.goal, self._from, out=self._now)
        self._now *= minimum_jerk(passed / self._length_s)
        self._now += self._from

    @staticmethod
    def _pose(expression: Expression, intensity: float) -> _Pose:
        overrides = [_override(kind, intensity) for kind in (expression.blink, expression.gaze, expression.mouth)]
        goal = np.concatenate([expression.pose(intensity), overrides])
        if not np.isfinite(goal).all():
            raise ParameterError(f"expression {expression.name}: not all of its values are finite numbers")
        return _Pose(expression.name, intensity, goal, expression.offset_s)


def _override(kind: str, intensity: float) -> float:
    """Return how much an override suppresses, by the rule of VRM 1.0.

    "block" suppresses completely as soon as the expression shows, "blend" in proportion to its intensity.
    """
    if kind == "blend":
        return intensity
    return 1.0 if kind == "block" and intensity > 0.0 else 0.0
