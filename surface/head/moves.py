"""Displacements of a part's groups, kept sparse: a pose touches only the groups that act and the points they move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.head.data import PartData
from surface.head.kernels import add_moves

Floats = NDArray[np.float64]


class Moves:
    """What the groups of one part do to its control points.

    Parameters
    ----------
    part : its groups; those that are not among ``names`` are left out.

    Attributes
    ----------
    used : (g,) int64, indices into ``names`` of the groups that are kept.
    """

    def __init__(self, part: PartData, names: tuple[str, ...]) -> None:
        place = {name: i for i, name in enumerate(names)}
        groups = [g for g in part.groups if g.name in place]
        self.used = np.array([place[g.name] for g in groups], np.int64)
        self._n = len(part.points)
        self._start = np.cumsum([0, *(len(g.ids) for g in groups)])
        self._ids = np.concatenate([np.zeros(0, np.int32), *(np.asarray(g.ids, np.int32) for g in groups)])
        rows = [np.zeros((0, 3), np.float32), *(np.asarray(g.moves, np.float32) for g in groups)]
        self._rows = np.concatenate(rows)

    def add(self, amounts: Floats, points: Floats) -> None:
        """Add the displacements by ``amounts (g,)`` of the groups to ``points (n, 3)``."""
        add_moves(amounts, self._start, self._ids, self._rows, points)

    def at(self, ids: NDArray[np.int64]) -> NDArray[np.float32]:
        """(g, k, 3) displacements of the points ``ids (k,)``."""
        dense = np.zeros((len(self.used), self._n, 3), np.float32)
        dense[np.repeat(np.arange(len(self.used)), np.diff(self._start)), self._ids] = self._rows
        return dense[:, ids]
