"""Draws the times and amounts of idle motion, and sums its steps."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field, model_validator

from controller.base.config import Number, Positive, Settings
from controller.motion.motion import minimum_jerk

Pair = TypeVar("Pair", bound=tuple[float, float])

LONGEST_GAP_S = 60.0
"""After a pause of the clock longer than this, behaviours start again instead of making up for it."""


def in_order(span: Pair) -> Pair:
    """``span`` unchanged. Raises ValueError: its first number is the larger one."""
    if span[0] > span[1]:
        raise ValueError(f"must be [shortest, longest], not {list(span)}")
    return span


_Length = Annotated[Number, Field(ge=0, le=3600)]
_Longest = Annotated[Number, Field(gt=0, le=3600)]
Span = Annotated[tuple[_Length, _Longest], AfterValidator(in_order)]
"""Times that are drawn evenly between the shortest and the longest."""


class Spread(Settings):
    """Times of a gamma distribution that begins at ``least``; of ``sd`` = ``mean`` - ``least`` it is exponential."""

    mean: Annotated[Positive, Field(le=3600)]
    sd: Annotated[Positive, Field(le=3600)]
    least: _Length = 0.0

    @model_validator(mode="after")
    def _least_is_least(self) -> Spread:
        if self.least >= self.mean:
            raise ValueError(f"least must be smaller than mean, {self.mean:g} (is {self.least:g})")
        return self


Draw = Span | Spread
"""Times of a file: ``[shortest, longest]``, or ``{ mean, sd, least }``."""


def generator(seed: int, name: str) -> random.Random:
    """Random numbers of one behaviour: what others draw does not change them."""
    return random.Random(f"{seed} {name}")


def draw(times: Draw, numbers: random.Random) -> float:
    """A time (s) from a distribution of a file."""
    if not isinstance(times, Spread):
        return numbers.uniform(*times)
    mean = times.mean - times.least
    return times.least + numbers.gammavariate((mean / times.sd) ** 2, times.sd**2 / mean)


def mean_of(times: Draw) -> float:
    """The mean (s) of a distribution of a file."""
    return times.mean if isinstance(times, Spread) else sum(times) / 2.0


class Steps:
    """Values that move from goal to goal: the sum of minimum-jerk steps, which may overlap.

    A step that begins before the last one has ended is added to it, so that speed never jumps (superposition of
    movements: Flash and Henis 1991).

    goal : where the values come to rest.
    """

    def __init__(self, count: int) -> None:
        self.goal = [0.0] * count
        self._base = [0.0] * count  # replaced, never changed
        self._steps: list[tuple[float, float, list[float]]] = []

    def go(self, goal: Sequence[float], start_s: float, length_s: float) -> None:
        """Move to ``goal`` in ``length_s`` from ``start_s`` on."""
        self._steps.append((start_s, length_s, [to - now for to, now in zip(goal, self.goal, strict=True)]))
        self.goal = list(goal)

    def at(self, now_s: float) -> list[float]:
        """The values at ``now_s``; not before the time given to :meth:`settle`."""
        if not self._steps:
            return self._base
        values = list(self._base)
        for start_s, length_s, delta in self._steps:
            share = minimum_jerk((now_s - start_s) / length_s)
            values = [value + share * each for value, each in zip(values, delta, strict=True)]
        return values

    def settle(self, before_s: float) -> None:
        """Forget steps that had ended at ``before_s``."""
        while self._steps and self._steps[0][0] + self._steps[0][1] <= before_s:
            delta = self._steps.pop(0)[2]
            self._base = [value + each for value, each in zip(self._base, delta, strict=True)]

    def reset(self) -> None:
        """Be at 0, at rest."""
        self.__init__(len(self.goal))  # type: ignore[misc]
