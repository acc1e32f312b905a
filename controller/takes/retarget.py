"""Fits takes to a person: maps the whole range of each parameter to the range that this person's face reaches."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from controller.base.config import Number, Settings, load
from controller.base.parameters import Flags, Floats, Parameters
from controller.vocabulary.sides import sides, unknown_names


class RangesFile(Settings):
    """A file of ranges: what the lower and the upper end of a parameter's range become."""

    ranges: Annotated[dict[str, tuple[Number, Number]], Field(min_length=1)]


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
    """Values (n, P) in other ranges (P,): straight from end to end; of an angle from either end to 0."""
    old_low, old_high = parameters.low, parameters.high
    is_angle = _are_angles(parameters)
    straight = low + (values - old_low) / (old_high - old_low) * (high - low)
    below = values / np.where(is_angle, old_low, 1.0) * low
    above = values / np.where(is_angle, old_high, 1.0) * high
    found: Floats = np.where(is_angle, np.where(values < 0.0, below, above), straight)
    return np.clip(found, old_low, old_high)


def _are_angles(parameters: Parameters) -> Flags:
    """(P,) whether a parameter goes to both sides of 0."""
    found: Flags = (parameters.low < 0.0) & (parameters.high > 0.0)
    return found


def _faults(file: RangesFile, parameters: Parameters) -> list[str]:
    faults = unknown_names(parameters, "ranges", file.ranges)
    for name, (low, high) in file.ranges.items():
        each = (_fault(low, high, at, parameters) for at in sides(parameters, name))
        faults += dict.fromkeys(f"ranges.{name}: {fault}" for fault in each if fault)
    return faults


def _fault(low: float, high: float, at: int, parameters: Parameters) -> str:
    """What is wrong with the range of the parameter at a position; empty where nothing is."""
    if _are_angles(parameters)[at] and not low <= 0.0 <= high:
        return "an angle goes from 0 or less to 0 or more"
    least, most = parameters.low[at], parameters.high[at]
    if not (least <= low <= most and least <= high <= most):
        return f"must lie in the range of the parameter, {least:g} to {most:g}"
    return ""
