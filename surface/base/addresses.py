"""Pass compiled kernels one table of addresses instead of many arrays.

A compiled function inspects every array that Python passes to it, which takes longer than a small update. So the
arrays are passed as a table of their addresses. Compiled functions pass that table to each other, too: to pass on so
many arrays takes longer than a small update.
"""

# mypy: allow-untyped-defs, disable-error-code="import-untyped, call-arg, attr-defined"
from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from llvmlite import ir
from numba import carray
from numba.core import types
from numba.extending import intrinsic

from surface.base.jit import inlined


def make_table(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return (2 k,) int64: address and length of k arrays, in their order; they must outlive the table.

    Raises ValueError: an array is not contiguous (names it).
    """
    table = []
    for name, array in arrays.items():
        if not array.flags.c_contiguous:
            raise ValueError(f"{name}: must be contiguous")
        table += [array.ctypes.data, len(array)]
    return np.array(table, dtype=np.int64)


@intrinsic
def _pointer(typingctx, address):
    """Return an address as a pointer."""

    def generate(context, builder, signature, args):
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@inlined
def flat(table, k, dtype):
    """Return array k of a table, of one dimension."""
    return carray(_pointer(table[2 * k]), (table[2 * k + 1],), dtype)


@inlined
def wide(table, k, width, dtype):
    """Return array k of a table, whose rows have ``width`` numbers."""
    return carray(_pointer(table[2 * k]), (table[2 * k + 1], width), dtype)


@inlined
def shaped(table, k, shape, dtype):
    """Return array k of a table, of a ``shape`` that the caller knows."""
    return carray(_pointer(table[2 * k]), shape, dtype)
