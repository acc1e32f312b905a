"""Finds the parameters that a name in a vocabulary means: a name without a side means left and right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from controller.base.parameters import Floats, Parameters, did_you_mean


def sides(parameters: Parameters, name: str) -> list[int]:
    """Positions that ``name`` means: itself, or its left and right; empty when unknown."""
    itself = parameters.find(name)
    if itself is not None:
        return [itself]
    each = (parameters.find(f"{name}{side}") for side in ("Left", "Right"))
    return [position for position in each if position is not None]


def unknown_names(parameters: Parameters, where: str, names: Iterable[str]) -> list[str]:
    """A fault for each of the ``names`` in the table ``where`` that means no parameter."""
    return [
        f"{where}.{name}: unknown parameter{did_you_mean(name, parameters.names)}"
        for name in names
        if not sides(parameters, name)
    ]


def spread(parameters: Parameters, table: Mapping[str, float], rest: float = 0.0) -> Floats:
    """(P,) values of a table of names, ``rest`` elsewhere; names that mean no parameter are left out."""
    values = np.full(len(parameters), rest)
    for name, value in table.items():
        values[sides(parameters, name)] = value
    return values
