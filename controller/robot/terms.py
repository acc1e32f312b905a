"""Terms of a channel's mix: how one parameter contributes to one channel.

A number weighs the parameter. A table may first keep it inside an input range, or map it through points::

    mix.jawOpen = 1
    mix.mouthClose = { by = -0.4, in = [0.2, 1] }
    mix.mouthFunnel = { at = [0, 0.5, 1], gives = [0, 0.3, 0.2], curve = "smooth" }

Smooth curves go through their points without overshooting between them (monotone cubics, Fritsch and Carlson 1980).
They are cut into short straight pieces, so that every curve is evaluated the same way.
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

_PIECES = 8  # number of straight pieces between two points of a smooth curve


def check_points(at: list[float], others: list[float], name: str) -> None:
    """Raise ValueError unless ``at`` is strictly ascending and both lists are equally long, two or more."""
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
    def _is_weight_or_curve(self) -> TermSettings:
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
    def is_weight(self) -> bool:
        """Whether the term is only a weight, without a range or a curve."""
        return self.within is None and self.at is None

    def points(self, low: float, high: float) -> tuple[Floats, Floats]:
        """Corners (k,) of the term as straight pieces, for a parameter in the range from ``low`` to ``high``."""
        if self.at is not None and self.gives is not None:
            return curve_corners(np.array(self.at), np.array(self.gives), self.curve)
        at = np.array(self.within or (low, high), dtype=np.float64)
        return at, self.by * at

    def describe(self, name: str) -> str:
        """The term as text: ``+0.5 jawOpen``."""
        if self.at is not None:
            return f"+{name} through {len(self.at)} points"
        inside = "" if self.within is None else f" in {self.within[0]:g}..{self.within[1]:g}"
        return f"{self.by:+g} {name}{inside}"


def _as_table(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float | dict | TermSettings):
        raise ValueError("must be a number, or a table like { by = 1, in = [0, 1] }")
    return {"by": value} if isinstance(value, int | float) else value


Term = Annotated[TermSettings, BeforeValidator(_as_table)]


def curve_corners(at: Floats, gives: Floats, curve: Curve) -> tuple[Floats, Floats]:
    """Corners (k,) of straight pieces along the curve through points (j,)."""
    if curve == "straight" or len(at) < 3:
        return at, gives
    widths, rises, slopes = np.diff(at)[:, None], np.diff(gives)[:, None], monotone_slopes(at, gives)
    t = np.arange(_PIECES) / _PIECES
    begin, end = slopes[:-1, None] * widths, slopes[1:, None] * widths
    values = gives[:-1, None] + t * (begin + t * (3.0 * rises - 2.0 * begin - end + t * (begin + end - 2.0 * rises)))
    x = (at[:-1, None] + t * widths).ravel()
    return np.append(x, at[-1]), np.append(values.ravel(), gives[-1])


def monotone_slopes(at: Floats, gives: Floats) -> Floats:
    """(j,) slopes at j >= 3 points of the cubics that overshoot nowhere (Fritsch and Butland 1984, as in PCHIP).

    Inside, a weighted harmonic mean of the slopes on either side, 0 at an extreme; at the ends, that of the parabola
    through three points, kept between 0 and three times the slope beside it.
    """
    widths, steep = np.diff(at), np.diff(gives) / np.diff(at)
    before, after = 2.0 * widths[1:] + widths[:-1], widths[1:] + 2.0 * widths[:-1]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # a slope may be next to zero
        mean = (before + after) / (before / steep[:-1] + after / steep[1:])
    inside = np.where(np.sign(steep[:-1]) * np.sign(steep[1:]) > 0.0, mean, 0.0)
    ends = [_end_slope(*widths[order][:2], *steep[order][:2]) for order in (slice(None), slice(None, None, -1))]
    return np.concatenate([ends[:1], inside, ends[1:]])


def _end_slope(width: float, next_width: float, steep: float, next_steep: float) -> float:
    slope = ((2.0 * width + next_width) * steep - width * next_steep) / (width + next_width)
    if np.sign(slope) != np.sign(steep):
        return 0.0
    if np.sign(steep) != np.sign(next_steep) and abs(slope) > 3.0 * abs(steep):
        return 3.0 * steep
    return slope
