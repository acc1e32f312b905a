"""Names of parameters in vocabularies: one that has sides may be written without them and then means both."""

from __future__ import annotations

from typing import Any

import numpy as np

from controller.base.errors import ParameterError
from controller.base.parameters import Floats, Parameters, did_you_mean


def sides(parameters: Parameters, name: str) -> list[int]:
    """Positions that ``name`` means: itself, or its left and right; empty when unknown."""
    found = []
    for spelling in (name, f"{name}Left", f"{name}Right"):
        try:
            found.append(parameters.index(spelling))
        except ParameterError:
            continue
        if spelling == name:
            break
    return found


def spread(parameters: Parameters, where: str, table: dict[str, Any], rest: float, faults: list[str]) -> Floats:
    """(P,) values of a table of names, ``rest`` elsewhere; a name without a side means both. Faults are noted."""
    values = np.full(len(parameters), rest)
    for key, value in table.items():
        positions = sides(parameters, key)
        if not positions:
            faults.append(f"{where}.{key}: unknown parameter{did_you_mean(key, parameters.names)}")
        elif isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
            faults.append(f"{where}.{key}: must be a number from 0 to 1 (is {value!r})")
        else:
            values[positions] = value
    return values
