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
    """A file of ranges: the new lower and upper end of each parameter's range."""

    ranges: Annotated[dict[str, tuple[Number, Number]], Field(min_length=1)]


def load_ranges(path: Path, parameters: Parameters) -> tuple[Floats, Floats]:
    """Return the lower and upper ends (P,); a parameter that the file does not name keeps its range.

    Raises ConfigError: the file cannot be read or is invalid; it lists every fault with its key.
    """
    file = load(path, RangesFile, lambda given: _faults(given, parameters))
    low, high = parameters.low.copy(), parameters.high.copy()
    for name, (new_low, new_high) in file.ranges.items():
        indices = sides(parameters, name)
        low[indices], high[indices] = new_low, new_high
    return low, high


def retarget(values: Floats, low: Floats, high: Floats, parameters: Parameters) -> Floats:
    """Map values (n, P) linearly to other ranges (P,); for angles, each side separately, so that 0 stays 0."""
    old_low, old_high = parameters.low, parameters.high
    is_angle = _are_angles(parameters)
    linear = low + (values - old_low) / (old_high - old_low) * (high - low)
    below = values / np.where(is_angle, old_low, 1.0) * low
    above = values / np.where(is_angle, old_high, 1.0) * high
    found: Floats = np.where(is_angle, np.where(values < 0.0, below, above), linear)
    return np.clip(found, old_low, old_high)


def _are_angles(parameters: Parameters) -> Flags:
    """Return a mask (P,) of the parameters whose range has both signs."""
    found: Flags = (parameters.low < 0.0) & (parameters.high > 0.0)
    return found


def _faults(file: RangesFile, parameters: Parameters) -> list[str]:
    faults = unknown_names(parameters, "ranges", file.ranges)
    for name, (low, high) in file.ranges.items():
        each = (_fault(low, high, index, parameters) for index in sides(parameters, name))
        faults += dict.fromkeys(f"ranges.{name}: {fault}" for fault in each if fault)
    return faults


def _fault(low: float, high: float, index: int, parameters: Parameters) -> str:
    """Return the fault of a new range for a parameter; empty if it is valid."""
    if _are_angles(parameters)[index] and not low <= 0.0 <= high:
        return "an angle goes from 0 or less to 0 or more"
    least, most = parameters.low[index], parameters.high[index]
    if not (least <= low <= most and least <= high <= most):
        return f"must lie in the range of the parameter, {least:g} to {most:g}"
    return ""
