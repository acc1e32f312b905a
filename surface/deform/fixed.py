"""Fixed-point numbers of 24 bits: from -2^15 to 2^15, in steps of 1/256, times a power of two that is kept elsewhere.

They take three quarters of the memory of float32 numbers. Of numbers that are about as large they are as exact, and so
are sums of numbers that differ, as a vertex's weights do. Eight lie together in 24 bytes, see
:func:`surface.spline.lanes.load_fixed`.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats32
from surface.base.jit import inlined
from surface.spline.lanes import LANES

BYTES = 3 * LANES  # of eight numbers
MOST = (1 << 23) - 1  # steps of the greatest number


@inlined
def power_of(most):
    """Return the exponent of the power of two times which ``most``, not below 0, is at most 2^15."""
    return math.frexp(most)[1] - 15


@inlined
def put(table, k, lane, number):
    """Write ``number`` to ``lane`` of the k-th eight of ``table (24 n,)`` uint8, rounded to a step; the greatest there
    is if it is greater."""
    steps, at = np.int64(min(np.rint(256.0 * number), MOST)), 24 * k
    table[at + 2 * lane] = (steps >> 8) & 255
    table[at + 2 * lane + 1] = (steps >> 16) & 255
    table[at + 16 + lane] = steps & 255


@inlined
def take(table, k, lane):
    """Return the number in ``lane`` of the k-th eight, as :func:`put` wrote it."""
    at = 24 * k
    upper = np.int64(table[at + 2 * lane]) + 256 * np.int64(table[at + 2 * lane + 1])
    return upper - 65536 * (upper >> 15) + table[at + 16 + lane] / 256.0


def take_all(table: NDArray[np.uint8]) -> Floats32:
    """Return the numbers (n, 8) of ``table (24 n,)``; float32 holds them exactly."""
    rows = table.reshape(-1, BYTES)
    upper = np.ascontiguousarray(rows[:, : 2 * LANES]).view("<i2")
    found: Floats32 = upper + rows[:, 2 * LANES :].astype(np.float32) / np.float32(256.0)
    return found
