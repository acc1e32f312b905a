"""Draws the times and amounts of idle motion, and sums its steps."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field, model_validator

from controller.base.config import Number, Positive, Settings
from controller.motion.motion import minimum_jerk

Pair = TypeVar("Pair", bound=tuple[float, float])

MAX_GAP_S = 60.0
"""After a longer pause of the clock, behaviours start again instead of catching up."""


def in_order(span: Pair) -> Pair:
    """Return ``span`` unchanged. Raises ValueError: its first number is the larger one."""
    if span[0] > span[1]:
        raise ValueError(f"must be [shortest, longest], not {list(span)}")
    return span


_Length = Annotated[Number, Field(ge=0, le=3600)]
_Longest = Annotated[Number, Field(gt=0, le=3600)]
Span = Annotated[tuple[_Length, _Longest], AfterValidator(in_order)]
"""Times of a uniform distribution from the shortest to the longest."""


class Spread(Settings):
    """Times of a gamma distribution that begins at ``least``; exponential if ``sd`` = ``mean`` - ``least``."""

    mean: Annotated[Positive, Field(le=3600)]
    sd: Annotated[Positive, Field(le=3600)]
    least: _Length = 0.0

    @model_validator(mode="after")
    def _least_is_least(self) -> Spread:
        if self.least >= self.mean:
            raise ValueError(f"least must be smaller than mean, {self.mean:g} (is {self.least:g})")
        return self


Draw = Span | Spread
"""Distribution of times in a settings file: ``[shortest, longest]``, or ``{ mean, sd, least }``."""


def generator(seed: int, name: str) -> random.Random:
    """Return the random numbers of one behaviour, which do not depend on what other behaviours draw."""
    return random.Random(f"{seed} {name}")


def draw(times: Draw, numbers: random.Random) -> float:
    """Return a random time (s) from a distribution."""
    if not isinstance(times, Spread):
        return numbers.uniform(*times)
    mean = times.mean - times.least
    return times.least + numbers.gammavariate((mean / times.sd) ** 2, times.sd**2 / mean)


def mean_of(times: Draw) -> float:
    """Return the mean (s) of a distribution."""
    return times.mean if isinstance(times, Spread) else sum(times) / 2.0


class Steps:
    """Values that move from goal to goal by minimum-jerk steps, which are summed where they overlap.

    So the speed does not jump when a step begins before the last one has ended (superposition of movements: Flash and
    Henis 1991).

    goal : the values after all steps have ended.
    """

    def __init__(self, count: int) -> None:
        self.goal = [0.0] * count
        self._base = [0.0] * count  # replaced, never changed
        self._steps: list[tuple[float, float, list[float]]] = []

    def move_to(self, goal: Sequence[float], start_s: float, length_s: float) -> None:
        """Move to ``goal`` in ``length_s`` from ``start_s`` on."""
        self._steps.append((start_s, length_s, [to - now for to, now in zip(goal, self.goal, strict=True)]))
        self.goal = list(goal)

    def at(self, now_s: float) -> list[float]:
        """Return the values at ``now_s``, which must not be before the last time given to :meth:`drop_finished`."""
        if not self._steps:
            return self._base
        values = list(self._base)
        for start_s, length_s, delta in self._steps:
            progress = minimum_jerk((now_s - start_s) / length_s)
            values = [value + progress * each for value, each in zip(values, delta, strict=True)]
        return values

    def drop_finished(self, before_s: float) -> None:
        """Merge the steps that have ended by ``before_s`` into the base values."""
        while self._steps and self._steps[0][0] + self._steps[0][1] <= before_s:
            delta = self._steps.pop(0)[2]
            self._base = [value + each for value, each in zip(self._base, delta, strict=True)]

    def reset(self) -> None:
        """Set the values to 0, at rest."""
        self.__init__(len(self.goal))  # type: ignore[misc]
