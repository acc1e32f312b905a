"""A spatial hash of points: they are sorted into cubes, so that those near a place are found quickly.

Only cubes that hold points take memory, however far apart the points lie.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.base.jit import kernel
from surface.check.components import root_of

MAX_CUBE = float(1 << 60)  # cubes on either side of the origin; what lies further away shares the last one
CORNER = 0.57  # edge of a cube relative to its diagonal, just below 1 / sqrt(3)


@dataclass(frozen=True)
class Cells:
    """Points (m, 3) by cubes.

    keys : (c, 3) whole numbers of the cubes that hold points, sorted by x, then y, then z.
    start, order : the points of cube k are ``order (m,)`` from ``start[k]`` to ``start[k + 1]``, ascending.
    own : (m,) the cube of each point.
    """

    keys: Ints
    start: Ints
    order: Ints
    own: Ints

    def columns(self) -> tuple[Ints, Ints]:
        """Return (c, 9): each: the points in the 27 cubes around cube k are those of ``order`` from ``first[k, i]`` to
        ``last[k, i]``, for i from 0 to 8."""
        return self.columns_at(self.keys)

    def columns_at(self, keys: Ints) -> tuple[Ints, Ints]:
        """Do the same as :meth:`columns` for any cubes ``keys (k, 3)``."""
        first, last = np.zeros((len(keys), 9), np.int64), np.zeros((len(keys), 9), np.int64)
        _fill_columns(keys, self.keys, self.start, first, last)
        return first, last


def cubes(points: Floats, size: float) -> Ints:
    """Return (m, 3): the cube of each of points (m, 3), with edges of ``size``; one has a corner at the origin."""
    return np.clip(np.floor(points / size), -MAX_CUBE, MAX_CUBE).astype(np.int64)


def sort_into_cells(points: Floats, size: float) -> Cells:
    """Return points (m, 3), at least one, by cubes with edges of ``size``."""
    at = cubes(points, size)
    order = np.lexsort(at.T[::-1])
    rises = np.append(True, (at[order[1:]] != at[order[:-1]]).any(axis=1))
    start = np.append(np.flatnonzero(rises), len(order))
    own = np.zeros(len(order), np.int64)
    own[order] = np.cumsum(rises) - 1
    return Cells(at[order[start[:-1]]], start, order, own)


@kernel
def first_from(keys: Any, x: Any, y: Any, z: Any) -> Any:
    """Return the number of the first of the sorted ``keys (c, 3)`` that does not come before (x, y, z)."""
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) // 2
        a, b, c = keys[middle, 0], keys[middle, 1], keys[middle, 2]
        if a < x or (a == x and (b < y or (b == y and c < z))):
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _fill_columns(wanted: Any, keys: Any, start: Any, first: Any, last: Any) -> None:
    """See :meth:`Cells.columns_at`."""
    for k in range(len(wanted)):
        x, y, z = wanted[k]
        for i in range(9):
            across, up = x + i // 3 - 1, y + i % 3 - 1
            first[k, i] = start[first_from(keys, across, up, z - 1)]
            last[k, i] = start[first_from(keys, across, up, z + 2)]


def any_nearer(points: Floats, others: Floats, least: float) -> Bools:
    """Return (k,): whether any of others (r, 3) is nearer than ``least`` to each of points (k, 3)."""
    near = np.zeros(len(points), np.bool_)
    if len(others):
        cells = sort_into_cells(others, least)
        _any_nearer(points, others, *cells.columns_at(cubes(points, least)), cells.order, least, near)
    return near


@kernel
def _any_nearer(points: Any, others: Any, first: Any, last: Any, order: Any, least: float, near: Any) -> None:
    """See :func:`any_nearer`."""
    for k in range(len(points)):
        for i in range(9):
            for e in range(first[k, i], last[k, i]):
                near[k] |= _square(points[k], others[order[e]]) < least * least
                if near[k]:
                    break
            if near[k]:
                break


@kernel
def _square(p: Any, q: Any) -> Any:
    """Return the square of the distance of two places (3,)."""
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2


def joined_nearer(points: Floats, known: Ints, reach: float) -> Ints:
    """Return (m,): the same number for those of points (m, 3) that chains of points nearer than ``reach`` to the next
    connect, or that have the same number ``known (m,)``, from 0 to below m, already."""
    root = np.arange(len(points))
    if len(points):
        _, first = np.unique(known, return_index=True)
        place = np.zeros(int(known.max()) + 1, np.int64)
        place[known[first]] = first
        root = place[known]
        cells = sort_into_cells(points, CORNER * reach)
        _join_near(points, cells.keys, cells.start, cells.order, reach, root)
    return root


@kernel
def _join_cells(points: Any, one: Any, other: Any, reach: float, root: Any) -> None:
    """Join two cubes, whose points ``one (a,)`` and ``other (b,)`` each are one already, if any two are near."""
    if root_of(root, one[0]) == root_of(root, other[0]):
        return
    for i in one:
        for j in other:
            if _square(points[i], points[j]) < reach * reach:
                root[root_of(root, i)] = root_of(root, j)
                return


@kernel
def _join_near(points: Any, keys: Any, start: Any, order: Any, reach: float, root: Any) -> None:
    """See :func:`joined_nearer`; ``root (m,)`` leads every point to the first one of its kind.

    All points of a cube are near each other, and those nearer than ``reach`` to them are at most two cubes away.
    """
    for k in range(len(keys)):
        for e in range(start[k] + 1, start[k + 1]):
            root[root_of(root, order[e])] = root_of(root, order[start[k]])
    for k in range(len(keys)):
        x, y, z = keys[k]
        for i in range(25):
            across, up = x + i // 5 - 2, y + i % 5 - 2
            for c in range(first_from(keys, across, up, z - 2), first_from(keys, across, up, z + 3)):
                if c > k:
                    _join_cells(points, order[start[k] : start[k + 1]], order[start[c] : start[c + 1]], reach, root)
    for k in range(len(root)):
        root[k] = root_of(root, k)
