"""Terms of a channel's mix: how one parameter reaches one channel.

A number weighs the parameter. A table may first keep it inside an input range, or carry it through points of its own::

    mix.jawOpen = 1
    mix.mouthClose = { by = -0.4, in = [0.2, 1] }
    mix.mouthFunnel = { at = [0, 0.5, 1], gives = [0, 0.3, 0.2], curve = "smooth" }

Smooth curves go through their points without overshooting between them (monotone cubics, Fritsch and Carlson 1980).
They are kept as short straight pieces, so that every curve is evaluated the same way.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from controller.base.config import Settings
from controller.base.parameters import Floats

Finite = Annotated[float, Field(allow_inf_nan=False)]
Curve = Literal["straight", "smooth"]

_PIECES = 8


def check_points(at: list[float], others: list[float], name: str) -> None:
    """Raise ValueError unless ``at`` rises and both lists are equally long, two or more."""
    if len(at) != len(others) or len(at) < 2:
        raise ValueError(f"at and {name} need the same number of points, two or more")
    if any(b <= a for a, b in pairwise(at)):
        raise ValueError("at must rise from point to point")


class TermSettings(Settings):
    """One term: ``by`` times the parameter kept inside ``in``, or the curve through ``at`` and ``gives``."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    by: Finite = 1.0
    within: tuple[Finite, Finite] | None = Field(default=None, alias="in")
    at: list[Finite] | None = None
    gives: list[Finite] | None = None
    curve: Curve = "straight"

    @model_validator(mode="after")
    def _one_way(self) -> TermSettings:
        if self.within is not None and not self.within[0] < self.within[1]:
            raise ValueError("in must be [lowest, highest]")
        if (self.at is None) != (self.gives is None):
            raise ValueError("at and gives go together")
        if self.at is not None and self.gives is not None:
            if self.within is not None or self.by != 1.0:
                raise ValueError("at and gives take the place of by and in")
            check_points(self.at, self.gives, "gives")
        return self

    @property
    def plain(self) -> bool:
        """Whether the term is nothing but a weight."""
        return self.within is None and self.at is None

    def points(self, low: float, high: float) -> tuple[Floats, Floats]:
        """Corners (k,) of the term as straight pieces, for a parameter that runs from ``low`` to ``high``."""
        if self.at is not None and self.gives is not None:
            return bend(np.array(self.at), np.array(self.gives), self.curve)
        at = np.array(self.within or (low, high), dtype=np.float64)
        return at, self.by * at

    def words(self, name: str) -> str:
        """The term for a person: ``+0.5 jawOpen``."""
        if self.at is not None and self.gives is not None:
            return f"+{name} through {len(self.at)} points"
        inside = "" if self.within is None else f" in {self.within[0]:g}..{self.within[1]:g}"
        return f"{self.by:+g} {name}{inside}"


def _as_table(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float | dict | TermSettings):
        raise ValueError("must be a number, or a table like { by = 1, in = [0, 1] }")
    return {"by": value} if isinstance(value, int | float) else value


Term = Annotated[TermSettings, BeforeValidator(_as_table)]


def bend(at: Floats, gives: Floats, curve: Curve) -> tuple[Floats, Floats]:
    """Corners (k,) of straight pieces along the curve through points (j,)."""
    if curve == "straight" or len(at) < 3:
        return at, gives
    slopes = _monotone_slopes(np.diff(at), np.diff(gives) / np.diff(at))
    share = np.arange(_PIECES)[None] / _PIECES
    width = np.diff(at)[:, None]
    x = at[:-1, None] + share * width
    y = (
        (1 + 2 * share) * (1 - share) ** 2 * gives[:-1, None]
        + share * (1 - share) ** 2 * width * slopes[:-1, None]
        + share**2 * (3 - 2 * share) * gives[1:, None]
        + share**2 * (share - 1) * width * slopes[1:, None]
    )
    return np.append(x.ravel(), at[-1]), np.append(y.ravel(), gives[-1])


def _monotone_slopes(width: Floats, rise: Floats) -> Floats:
    """Slopes (j,) at the points: weighted harmonic means, zero where the curve turns (Fritsch and Butland 1984)."""
    a, b = width[:-1] + 2 * width[1:], 2 * width[:-1] + width[1:]
    product = rise[:-1] * rise[1:]
    same = product > 0
    inner = np.zeros(len(rise) - 1)
    inner[same] = ((a + b) * product)[same] / (a * rise[1:] + b * rise[:-1])[same]  # no tiny rise is divided by
    ends = [_end_slope(*width[:2], *rise[:2]), _end_slope(*width[:-3:-1], *rise[:-3:-1])]
    return np.concatenate([ends[:1], inner, ends[1:]])


def _end_slope(width: float, next_width: float, rise: float, next_rise: float) -> float:
    """Slope at an end from the two pieces beside it, such that the curve does not overshoot."""
    slope = ((2 * width + next_width) * rise - width * next_rise) / (width + next_width)
    if slope * rise <= 0:
        return 0.0
    return slope if abs(slope) <= 3 * abs(rise) else 3 * rise
