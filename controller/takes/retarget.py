"""Fits takes to a person: for each parameter, the range that this face goes through where the take goes through all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.parameters import Floats, Parameters
from controller.vocabulary.sides import sides, unknown_names

_Amount = Annotated[Number, Field(ge=-1, le=1)]


class RangesFile(Settings):
    """A file of ranges: what 0 and 1 become of a parameter, and what -1 and 1 become of an angle."""

    ranges: Annotated[dict[str, tuple[_Amount, _Amount]], Field(min_length=1)]


def load_ranges(path: Path, parameters: Parameters) -> tuple[Floats, Floats]:
    """Low and high ends (P,), those of the parameters where the file names none.

    Raises ConfigError: it cannot be read, or is wrong; every fault with its key.
    """
    file = load(path, RangesFile, lambda given: _faults(given, parameters))
    low, high = parameters.low.copy(), parameters.high.copy()
    for name, (least, most) in file.ranges.items():
        at = sides(parameters, name)
        low[at], high[at] = least, most
    return low, high


def retarget(values: Floats, low: Floats, high: Floats, parameters: Parameters) -> Floats:
    """Values (n, P) in other ranges (P,): straight from 0 to 1, and of an angle from -1 over 0, which stays, to 1."""
    is_angle = parameters.low < 0.0
    shares = low + values * (high - low)
    angles = np.where(values < 0.0, -values * low, values * high)
    found: Floats = np.where(is_angle, angles, shares)
    return np.clip(found, parameters.low, parameters.high)


def _faults(file: RangesFile, parameters: Parameters) -> list[str]:
    faults = unknown_names(parameters, "ranges", file.ranges)
    for name, (low, high) in file.ranges.items():
        for at in sides(parameters, name)[:1]:
            if parameters.low[at] < 0.0 and not low <= 0.0 <= high:
                faults.append(f"ranges.{name}: an angle goes from 0 or less to 0 or more")
            if low < parameters.low[at]:
                faults.append(f"ranges.{name}: begins at {parameters.low[at]:g} or higher")
    return faults
