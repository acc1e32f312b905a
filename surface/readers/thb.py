"""Truncated hierarchical B-splines (THB-splines) as control points with local knots, exactly.

A hierarchy is a sequence of nested tensor-product spline spaces with nested regions: region l holds the places of level
l or finer. A function of level l is active where its support lies in region l but not in region l + 1 (Vuong,
Giannelli, Jüttler and Simeon 2011). A truncated function (Giannelli, Jüttler and Speleers 2012) is its sum of finer
B-splines without those that lie in the finer region, level after level. Every such sum is finite with positive
coefficients a_k, so a control point (c, 1) over a truncated function is the control points (c, a_k) over plain
B-splines, and these are DCPs. The truncated functions sum to 1, so Eq. (1)'s division changes nothing. Pieces over
equal knots are joined at their weighted mean; functions that no finer region cuts stay whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from surface.base.arrays import Floats, Ints

Pieces = dict[tuple[int, int], Floats]
"""By function (i, j): its weight, and its position times that weight; (4,) each."""


@dataclass(frozen=True)
class Level:
    """One tensor-product basis: degrees of u and v, and knots (nu + pu + 1,), (nv + pv + 1,) float64."""

    degrees: tuple[int, int]
    knots: tuple[Floats, Floats]

    @property
    def shape(self) -> tuple[int, int]:
        """How many functions along u and v."""
        nu, nv = (len(t) - p - 1 for t, p in zip(self.knots, self.degrees, strict=True))
        return nu, nv

    def local_knots(self, axis: int, index: int) -> Floats:
        """Return the degree + 2 knots of a function."""
        return self.knots[axis][index : index + self.degrees[axis] + 2]


def dyadic_refinement(level: Level) -> Level:
    """Return the next level of a dyadic hierarchy: one more knot in the middle of every span."""
    u, v = (np.sort(np.append(t, (np.unique(t)[1:] + np.unique(t)[:-1]) / 2)) for t in level.knots)
    return Level(level.degrees, (u, v))


def knot_insertion(coarse: Floats, fine: Floats, degree: int) -> Floats:
    """Return coefficients of coarse B-splines in finer ones.

    coarse, fine : knots; the fine ones hold all coarse ones

    Returns (nc, nf) float64: B_i = sum over j of a_ij b_j, all a_ij >= 0 (Cohen, Lyche and Riesenfeld 1980, "Oslo").
    """
    nf = len(fine) - degree - 1
    here = fine[:nf]
    a = ((coarse[:-1, None] <= here) & (here < coarse[1:, None])).astype(np.float64)
    for k in range(1, degree + 1):
        x = fine[k : k + nf]
        rise = _ratio(x - coarse[: -k - 1, None], (coarse[k:-1] - coarse[: -k - 1])[:, None])
        fall = _ratio(coarse[k + 1 :, None] - x, (coarse[k + 1 :] - coarse[1:-k])[:, None])
        a = rise * a[:-1] + fall * a[1:]
    return a


def _ratio(part: Floats, whole: Floats) -> Floats:
    """Return part / whole, 0 where whole is 0."""
    return np.where(whole > 0, part / np.where(whole > 0, whole, 1.0), 0.0)


class Hierarchy:
    """Nested levels, and the level of each place.

    Parameters
    ----------
    levels : coarse to fine
    depth : (a, b) int, the level of every cell of the finest level's knot lines

    Attributes
    ----------
    active : (n, 3) int64: level, i and j of all active functions; coarse levels first, i runs fastest
    """

    def __init__(self, levels: list[Level], depth: Ints) -> None:
        self.levels, self.depth = levels, depth
        self._lines = [np.unique(t) for t in levels[-1].knots]
        self._insertions = [
            [knot_insertion(c, f, p) for c, f, p in zip(a.knots, b.knots, a.degrees, strict=True)]
            for a, b in pairwise(levels)
        ]
        self._truncated: dict[tuple[int, int, int], bool] = {}
        active = [
            (number, i, j)
            for number, level in enumerate(levels)
            for j in range(level.shape[1])
            for i in range(level.shape[0])
            if self._coarsest(number, i, j) == number
        ]
        self.active = np.array(active, dtype=np.int64).reshape(-1, 3)

    def _support(self, number: int, i: int, j: int) -> Ints:
        """Return levels of the cells in the support of a function."""
        slices = []
        for axis, index in enumerate((i, j)):
            knots = self.levels[number].local_knots(axis, index)
            slices.append(slice(*np.searchsorted(self._lines[axis], knots[[0, -1]])))
        return self.depth[slices[0], slices[1]]

    def _coarsest(self, number: int, i: int, j: int) -> int:
        """Return the least level in the support of a function; -1 for an empty support."""
        cells = self._support(number, i, j)
        return int(cells.min()) if cells.size else -1

    def to_truncated(self, coefficients: Floats) -> Floats:
        """Return coefficients for the truncated basis that give what ``coefficients (n, 3)`` give for the plain one.

        They are those of the sum so far in each level's own basis (Giannelli, Jüttler and Speleers 2014,
        preservation of coefficients).
        """
        out = np.empty_like(coefficients)
        total = np.zeros((*self.levels[0].shape, 3))
        for number in range(len(self.levels)):
            if number:
                u, v = self._insertions[number - 1]
                total = np.einsum("ia,ijk,jb->abk", u, total, v)
            mine = self.active[:, 0] == number
            i, j = self.active[mine, 1], self.active[mine, 2]
            total[i, j] += coefficients[mine]
            out[mine] = total[i, j]
        return out

    def control_points(self, coefficients: Floats) -> tuple[Floats, Floats, list[Floats], list[Floats]]:
        """Return DCPs of the surface with ``coefficients (n, 3)`` over the truncated basis.

        Returns points (m, 3), weights (m,), and m knot vectors for u and for v.
        """
        pieces: Pieces = {}
        rows: list[Floats] = []
        knots: tuple[list[Floats], list[Floats]] = ([], [])
        for number, level in enumerate(self.levels):
            mine = self.active[:, 0] == number
            for (i, j), c in zip(self.active[mine, 1:].tolist(), coefficients[mine], strict=True):
                pieces[i, j] = pieces.get((i, j), 0.0) + np.append(1.0, c)
            finer: Pieces = {}
            for (i, j), value in pieces.items():
                if self._is_truncated(number, i, j):
                    self._split(number, i, j, value, finer)
                    continue
                rows.append(value)
                for axis, index in enumerate((i, j)):
                    knots[axis].append(level.local_knots(axis, index))
            pieces = finer
        table = np.array(rows)
        return table[:, 1:] / table[:, :1], table[:, 0], knots[0], knots[1]

    def _split(self, number: int, i: int, j: int, value: Floats, finer: Pieces) -> None:
        """Add those of a function's finer B-splines that no active function of the next level replaces to ``finer``."""
        u, v = self._insertions[number]
        for a, b in self._children(number, i, j):
            if self._coarsest(number + 1, a, b) <= number:
                finer[a, b] = finer.get((a, b), 0.0) + u[i, a] * v[j, b] * value

    def _is_truncated(self, number: int, i: int, j: int) -> bool:
        """Whether a finer region takes something from a function, at the next level or at any after it."""
        key = number, i, j
        if key not in self._truncated:
            inside = number + 1 < len(self.levels) and self._support(number, i, j).max() > number
            children = self._children(number, i, j) if inside else []
            self._truncated[key] = any(self._coarsest(number + 1, *child) > number for child in children) or any(
                self._is_truncated(number + 1, *child) for child in children
            )
        return self._truncated[key]

    def _children(self, number: int, i: int, j: int) -> list[tuple[int, int]]:
        """Return the next level's functions that a function is a sum of."""
        u, v = self._insertions[number]
        return list(product(u[i].nonzero()[0].tolist(), v[j].nonzero()[0].tolist()))
