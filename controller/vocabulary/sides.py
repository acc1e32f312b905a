"""Finds the parameters that a name in a vocabulary means; a name without a side means both left and right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from controller.base.parameters import Floats, Parameters, did_you_mean


def sides(parameters: Parameters, name: str) -> list[int]:
    """Return the indices of the parameters that ``name`` means: one, or its left and right; empty if unknown."""
    index = parameters.find(name)
    if index is not None:
        return [index]
    both = (parameters.find(f"{name}{side}") for side in ("Left", "Right"))
    return [index for index in both if index is not None]


def unknown_names(parameters: Parameters, where: str, names: Iterable[str]) -> list[str]:
    """Return a fault for each of the ``names`` in the table ``where`` that means no parameter."""
    return [
        f"{where}.{name}: unknown parameter{did_you_mean(name, parameters.names)}"
        for name in names
        if not sides(parameters, name)
    ]


def spread(parameters: Parameters, table: Mapping[str, float], rest: float = 0.0) -> Floats:
    """Return (P,) values from a table of names, ``rest`` elsewhere; unknown names are ignored."""
    values = np.full(len(parameters), rest)
    for name, value in table.items():
        values[sides(parameters, name)] = value
    return values
