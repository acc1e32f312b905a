"""Add displacements of a part's groups to its control points, stored as runs of consecutive points: a pose touches only
the groups that act and the points they move."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.head.model.data import Group, PartData
from surface.head.posing.kernels import add_moves

GAP = 16  # so many points that a group does not move may lie between two of one run


class Moves:
    """Displacements of one part's groups; ``used (g,)`` are the indices into ``names`` of those that are among them."""

    def __init__(self, part: PartData, names: tuple[str, ...]) -> None:
        place = {name: i for i, name in enumerate(names)}
        groups = [g for g in part.groups if g.name in place]
        self.used = np.array([place[g.name] for g in groups], np.int64)
        self._n = len(part.points)
        runs = [run for g, group in enumerate(groups) for run in _runs(g, group)]
        self._group, self._first = (np.array([run[i] for run in runs], np.int64) for i in (0, 1))
        self._start = np.cumsum([0, *(run[2].size for run in runs)])
        self._rows = np.concatenate([np.zeros(0, np.float32), *(run[2].ravel() for run in runs)])

    def add(self, amounts: Floats, points: Floats) -> None:
        """Add the displacements by ``amounts (g,)`` of the groups to ``points (n, 3)``, contiguous."""
        add_moves(amounts, self._group, self._first, self._start, self._rows, points.reshape(-1))

    def at(self, ids: Ints) -> Floats32:
        """(g, k, 3) displacements of the points ``ids (k,)``."""
        dense = np.zeros((len(self.used), 3 * self._n), np.float32)
        for group, first, start, stop in zip(self._group, self._first, self._start, self._start[1:], strict=False):
            dense[group, first : first + stop - start] = self._rows[start:stop]
        return dense.reshape(len(self.used), self._n, 3)[:, ids]


def _runs(index: int, group: Group) -> list[tuple[int, int, Floats32]]:
    """A group's displacements as runs of points: its index, the first coordinate of a run, and its rows (k, 3)."""
    order = np.argsort(group.ids, kind="stable")
    ids, moves = np.asarray(group.ids, np.int64)[order], np.asarray(group.moves, np.float32)[order]
    cuts = np.flatnonzero(np.diff(ids) > GAP) + 1
    found = []
    for own, rows in zip(np.split(ids, cuts), np.split(moves, cuts), strict=True):
        if len(own):
            run = np.zeros((own[-1] - own[0] + 1, 3), np.float32)
            np.add.at(run, own - own[0], rows)
            found.append((index, 3 * int(own[0]), run))
    return found
