"""Fixed-point numbers of 24 bits: from -2^15 to 2^15, in steps of 1/256, times a power of two that is kept elsewhere.

They take three quarters of the memory of float32 numbers. Of numbers that are about as large they are as exact, and so
are sums of numbers that differ, as a vertex's weights do. Two eights lie together in 48 bytes, see
:func:`surface.spline.lanes.load_fixed`; the last one may be alone in as many.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats32
from surface.base.jit import inlined
from surface.spline.lanes import LANES

MOST = (1 << 23) - 1  # steps of the greatest number


def room(eights: int) -> int:
    """How many bytes so many eights take."""
    return 6 * LANES * -(-eights // 2)


@inlined
def power_of(most):
    """Return the exponent of the power of two times which ``most``, not below 0, is at most 2^15."""
    return math.frexp(most)[1] - 15


@inlined
def place_of(k, lane):
    """Return where the lower byte of the whole part of a number lies, in the k-th eight, and where its last byte."""
    pair, second = 6 * LANES * (k // 2), k % 2
    return pair + 2 * (LANES * second + lane), pair + 4 * LANES + LANES * second + lane


@inlined
def put(table, k, lane, number):
    """Write ``number`` to ``lane`` of the k-th eight of ``table``, uint8, rounded to a step; the greatest there is if
    it is greater."""
    steps, (whole, rest) = np.int64(min(np.rint(256.0 * number), MOST)), place_of(k, lane)
    table[whole] = (steps >> 8) & 255
    table[whole + 1] = (steps >> 16) & 255
    table[rest] = steps & 255


@inlined
def take(table, k, lane):
    """Return the number in ``lane`` of the k-th eight, as :func:`put` wrote it."""
    whole, rest = place_of(k, lane)
    upper = np.int64(table[whole]) + 256 * np.int64(table[whole + 1])
    return upper - 65536 * (upper >> 15) + table[rest] / 256.0


def take_all(table: NDArray[np.uint8], start: int, stop: int) -> Floats32:
    """Return the numbers (stop - start, 8) of the eights ``start`` to ``stop`` of a table; float32 holds them
    exactly."""
    pairs = table.reshape(-1, 6 * LANES)[start // 2 : -(-stop // 2)]
    upper = np.ascontiguousarray(pairs[:, : 4 * LANES]).view("<i2").reshape(-1, LANES)
    found: Floats32 = upper + pairs[:, 4 * LANES :].reshape(-1, LANES).astype(np.float32) / np.float32(256.0)
    return found[start % 2 :][: stop - start]
