"""The rational weights of a surface as a sparse matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .basis import Floats, Ints

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from .dcp import DCPSurface

CHUNK = 8192  # samples per pass: bounds the scratch memory


def basis_matrix(surface: DCPSurface, uv: ArrayLike, derivative: tuple[int, int], side: ArrayLike | None) -> csr_matrix:
    """See :meth:`surface.DCPSurface.basis_matrix`."""
    from scipy.sparse import csr_matrix

    if tuple(derivative) not in ((0, 0), (1, 0), (0, 1)):
        raise ValueError(f"derivative: must be (0, 0), (1, 0) or (0, 1), not {derivative!r}")
    samples, sides, _ = surface.sample(uv, side)
    data, columns, start = _rows(surface, samples, sides)
    columns %= surface.n  # shifted copies are the same point
    rows = np.repeat(np.arange(len(samples)), np.diff(start))
    total = np.stack([np.bincount(rows, data[:, k], len(samples)) for k in range(3)], axis=1)
    ratio = data[:, 0] / total[rows, 0]
    if tuple(derivative) != (0, 0):
        k = 1 if derivative[0] else 2
        ratio = (data[:, k] - ratio * total[rows, k]) / total[rows, 0]
    matrix = csr_matrix((ratio, columns, start), shape=(len(samples), surface.n))
    matrix.sum_duplicates()
    return matrix


def _rows(surface: DCPSurface, samples: Floats, sides: np.ndarray) -> tuple[Floats, np.ndarray, Ints]:
    """b w and its derivatives (k, 3), columns (k,) and row starts (m + 1,), a chunk at a time."""
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
