"""The rational weights of a surface at samples: as rows for products, and as sparse matrices (scipy CSR)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_sides, check_uv
from surface.base.extras import require

from .closed import wrap
from .controlpoints import ControlPoints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

CHUNK = 8192  # samples per pass: bounds the scratch memory


@dataclass(frozen=True)
class Rows:
    """Rational weights of ``m`` samples, without scipy: ``rows @ points`` is the surface there.

    share : (k,) weights. column : (k,) the control point of each. row : (k,) the sample of each. count : m.
    """

    share: Floats
    column: Ints
    row: Ints
    count: int

    def __matmul__(self, points: ArrayLike) -> Floats:
        """Return (m, ...) float64: sums for values (n, ...) of the control points."""
        values = np.asarray(points, np.float64)[self.column]
        terms = values.reshape(len(values), math.prod(values.shape[1:])).T * self.share
        sums: Floats = np.stack([np.bincount(self.row, term, self.count) for term in terms], axis=1)
        return sums.reshape(self.count, *values.shape[1:])


def basis_rows(surface: ControlPoints, uv: ArrayLike) -> Rows:
    """Return the weights of :meth:`surface.DCPSurface.basis_matrix`, for products with few columns."""
    (share,), column, start = _ratios(surface, uv, [(0, 0)], None)
    return Rows(share, column, np.repeat(np.arange(len(start) - 1), np.diff(start)), len(start) - 1)


def basis_matrices(
    surface: ControlPoints, uv: ArrayLike, derivatives: Sequence[tuple[int, int]], side: ArrayLike | None = None
) -> list[csr_matrix]:
    """Return several matrices of :meth:`surface.DCPSurface.basis_matrix`, for hardly more than the time of one.

    Raises MissingPackage: scipy is not installed.
    """
    require("a sparse matrix of weights", "scipy")
    from scipy.sparse import csr_matrix  # slow to import

    ratios, columns, start = _ratios(surface, uv, derivatives, side)
    out = []
    for ratio in ratios:
        matrix = csr_matrix((ratio, columns.copy(), start.copy()), shape=(len(start) - 1, surface.n))
        matrix.sum_duplicates()
        out.append(matrix)
    return out


def _ratios(
    surface: ControlPoints, uv: ArrayLike, derivatives: Sequence[tuple[int, int]], side: ArrayLike | None
) -> tuple[list[Floats], Ints, Ints]:
    """Return rational weights (k,) or their derivatives, the control point of each (k,), and row starts (m + 1,)."""
    from .kernels import TINY  # compiled: loaded when first used

    for wanted in derivatives:
        if tuple(wanted) not in ((0, 0), (1, 0), (0, 1)):
            raise ValueError(f"derivative: must be (0, 0), (1, 0) or (0, 1), not {wanted!r}")
    samples = wrap(check_uv(uv), surface.closed)
    data, columns, start = _rows(surface, samples, check_sides(samples, side))
    rows, total = _sums(data, start)
    if not (total[:, 0] > TINY).all():  # nothing covers there, or only the limit from another side
        data, columns, start = _rows(surface, samples, surface.sample(uv, side)[1])
        rows, total = _sums(data, start)
    columns %= surface.n  # shifted copies are the same point
    value = data[:, 0] / total[rows, 0]
    slots = [2 * v + u for u, v in derivatives]
    ratios = [value if k == 0 else (data[:, k] - value * total[rows, k]) / total[rows, 0] for k in slots]
    return ratios, columns, start


def _sums(data: Floats, start: Ints) -> tuple[Ints, Floats]:
    """Return the row of every entry of ``data (k, 3)``, and the sums (m, 3) over each row."""
    rows = np.repeat(np.arange(len(start) - 1), np.diff(start))
    return rows, np.stack([np.bincount(rows, data[:, k], len(start) - 1) for k in range(3)], axis=1)


def _rows(surface: ControlPoints, samples: Floats, sides: np.ndarray) -> tuple[Floats, np.ndarray, Ints]:
    """Return b w and its derivatives (k, 3), columns (k,) and row starts (m + 1,), a chunk at a time."""
    from . import kernels

    data, columns, counts = [np.zeros((0, 3))], [np.zeros(0, dtype=np.int32)], []
    arrays, bins = surface.arrays(), surface.bin_arrays()
    for first in range(0, len(samples), CHUNK):
        part, sub = samples[first : first + CHUNK], sides[first : first + CHUNK]
        capacity = kernels.row_capacity(*bins[:3], part)
        chunk, ids = np.zeros((capacity, 3)), np.zeros(capacity, dtype=np.int32)
        start = np.zeros(len(part) + 1, dtype=np.int64)
        used = kernels.fill_rows(*arrays[:4], arrays[5], *bins, part, sub, chunk, ids, start)
        data.append(chunk[:used].copy())
        columns.append(ids[:used].copy())
        counts.append(np.diff(start))
    starts = np.concatenate([[0], *counts]).cumsum()
    return np.concatenate(data), np.concatenate(columns), starts
