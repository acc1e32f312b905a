"""Displacements of control points by groups, laid out so that a pose reads few bytes of them and in one pass.

A group moves some control points of a part. Each displacement is needed once a pose, so time goes to reading them:
eight points make a tile, and of every group only the tiles that it moves are kept, one after the other. Points are put
into tiles in the order of the reflected Gray code of the groups that move them, by which neighbours differ in few
groups (Lemire and Kaser 2011, "Reordering columns for smaller indexes"); in the file's order, where the left and the
right half of a face alternate, nearly every third number would be a zero.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.deform.lists import LANES
from surface.head.model.data import Group, PartData
from surface.head.posing.kernels import add_moves


class Moves:
    """Displacements of one part's groups; ``used (g,)`` are the indices into ``names`` of the groups that it has."""

    def __init__(self, part: PartData, names: tuple[str, ...]) -> None:
        place = {name: i for i, name in enumerate(names)}
        groups = [g for g in part.groups if g.name in place]
        self.used = np.array([place[g.name] for g in groups], np.int64)
        self._n = len(part.points)
        moved = np.zeros((len(groups), self._n), np.bool_)
        for row, group in zip(moved, groups, strict=True):
            row[group.ids] = True
        self._order = gray_order(moved)
        self._tiles = -(-self._n // LANES)
        at = np.empty(self._n, np.int64)
        at[self._order] = np.arange(self._n)
        found = [self._tiles_of(group, at) for group in groups]
        self._start = np.cumsum([0, *(len(tiles) for tiles, _ in found)])
        self._tile = np.concatenate([np.zeros(0, np.int32), *(tiles for tiles, _ in found)])
        self._rows = np.concatenate([np.zeros(0, np.float32), *(rows.ravel() for _, rows in found)])
        self._sums = np.zeros(3 * LANES * self._tiles, np.float32)
        self._dense: Floats | None = None  # made when first used

    @property
    def nbytes(self) -> int:
        """Bytes that a pose reads where every group moves."""
        return self._rows.nbytes + self._tile.nbytes

    def add(self, amounts: Floats, rest: Floats, points: Floats) -> None:
        """Write ``rest (n, 3)`` and the displacements by ``amounts (g,)`` of the groups to ``points (n, 3)``, both
        contiguous; displacements are summed in 32-bit numbers."""
        add_moves(amounts, self._start, self._tile, self._rows, self._order, self._sums, rest, points)

    def add_all(self, amounts: Floats, points: Floats) -> Floats:
        """Return (h, n, 3): ``points (n, 3)`` with displacements by each of ``amounts (h, g)``: one product of
        matrices, which reads the displacements once for all."""
        if self._dense is None:
            self._dense = self._table().astype(np.float64)
        moved: Floats = (amounts @ self._dense).reshape(len(amounts), self._n, 3)
        moved += points
        return moved

    def at(self, ids: Ints) -> Floats32:
        """Return (g, k, 3): displacements of the points ``ids (k,)``."""
        return self._table().reshape(len(self.used), self._n, 3)[:, ids]

    def _tiles_of(self, group: Group, place: Ints) -> tuple[np.ndarray, Floats32]:
        """Which tiles a group moves, rising, and by how much their points, (k, LANES, 3); ``place (n,)`` : of each
        point in the order."""
        rows = np.zeros((self._tiles * LANES, 3), np.float32)
        np.add.at(rows, place[group.ids], np.asarray(group.moves, np.float32))
        touched = np.zeros(self._tiles, np.bool_)
        touched[place[group.ids] // LANES] = True  # a set of numbers so small is found faster than by sorting
        tiles = np.flatnonzero(touched)
        return tiles.astype(np.int32), rows.reshape(-1, LANES, 3)[tiles]

    def _table(self) -> Floats32:
        """Return (g, 3 n): displacements of all points."""
        tiles = np.zeros((len(self.used), self._tiles, 3 * LANES), np.float32)
        group = np.repeat(np.arange(len(self.used)), np.diff(self._start))
        tiles[group, self._tile] = self._rows.reshape(-1, 3 * LANES)
        table = np.zeros((len(self.used), self._n, 3), np.float32)
        table[:, self._order] = tiles.reshape(len(self.used), self._tiles * LANES, 3)[:, : self._n]
        return table.reshape(len(self.used), 3 * self._n)


def gray_order(moved: Bools) -> Ints:
    """Return (n,): an order of points in which neighbours are moved by nearly the same groups, from ``moved (g, n)``.

    It is that of the reflected Gray code of a point's column. Groups that move about half of the points come first:
    they cut the others into the fewest pieces.
    """
    groups, n = moved.shape
    if not groups:
        return np.arange(n)
    first = np.argsort(np.abs(moved.sum(axis=1) - n / 2), kind="stable")
    ranks = np.cumsum(moved[first], axis=0) % 2  # a digit is reflected where an odd number of ones stands before it
    order: Ints = np.lexsort(ranks[::-1])
    return order
