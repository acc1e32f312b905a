"""Groups of control points that a user adds to a head, each moved by a parameter of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.head.model.parameters import NAMES


@dataclass(frozen=True, eq=False)
class OwnGroup:
    """Control points of one part that a parameter moves.

    name : of the parameter. part : the part. ids : (k,) control points. moves : (k, 3) mm at the value 1.
    times : parameters by whose values, 0 to 1, the amount is multiplied: a corrective of the faces in which all are 1.
    """

    name: str
    part: str
    ids: NDArray[np.integer]
    moves: Floats
    times: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class OwnMoves:
    """What one own group moves of one part: its place among the own groups, (k,) control points, (k, 3) mm."""

    index: int
    ids: NDArray[np.integer]
    moves: Floats


class OwnAmounts:
    """Amounts of own groups from a face.

    names : parameters of the face: :data:`NAMES`, and the groups' own ones behind them.

    Raises ValueError: a group multiplies with something that is no parameter.
    """

    def __init__(self, groups: Sequence[OwnGroup]) -> None:
        own = tuple(dict.fromkeys(group.name for group in groups))
        self.names = NAMES + own
        self._value = np.array([self.names.index(group.name) for group in groups], np.intp)
        self._none = np.zeros(0)
        self._times = [(i, self._at(group, name)) for i, group in enumerate(groups) for name in group.times]

    def _at(self, group: OwnGroup, name: str) -> int:
        if name not in self.names:
            raise ValueError(f"{group.name}: {name!r} is no parameter of the head")
        return self.names.index(name)

    def __call__(self, values: Floats) -> Floats:
        """Return (g,): amounts for values (P,) in the order of ``names``. Raises ValueError: one of them is not a
        number."""
        if not len(self._value):
            return self._none
        amounts: Floats = values[self._value]
        if np.isnan(amounts).any():
            raise ValueError(f"values: {self.names[self._value[int(np.argmax(np.isnan(amounts)))]]} is not a number")
        amounts = np.clip(amounts, -1.0, 1.0)
        for i, factor in self._times:
            amounts[i] *= min(max(float(values[factor]), 0.0), 1.0)
        return amounts
