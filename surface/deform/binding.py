"""One update in one short call: the addresses of all work arrays in a table.

A compiled function looks at every array it is given, which takes longer than a small update. So they are given as a
table of addresses, made anew whenever one of them is replaced.
"""

# mypy: allow-untyped-defs, disable-error-code="import-untyped, call-arg, attr-defined"
from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import carray
from numba.core import types
from numba.extending import intrinsic

from surface.base.jit import inlined, kernel

from .updates import place

NAMES = (
    "changed_ids", "delta", "hits", "touched", "anew", "ranges", "back_start", "back_count", "back_cell", "back_row",
    "points", "origin", "cell_start", "tile_start", "rows", "room", "at", "ids_at", "ids", "value", "slope", "below",
    "bend", "numerators", "kept", "vertices", "normals", "local", "spare",
)  # fmt: skip


def address_table(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """(2 * 29,) int64: address and length of every array of ``NAMES``; the arrays must outlive the table."""
    table = np.zeros(2 * len(NAMES), dtype=np.int64)
    for k, name in enumerate(NAMES):
        if not arrays[name].flags.c_contiguous:
            raise ValueError(f"{name}: must be contiguous")
        table[2 * k], table[2 * k + 1] = arrays[name].ctypes.data, len(arrays[name])
    return table


@intrinsic
def _pointer(typingctx, address):
    """An address as a pointer."""

    def generate(context, builder, signature, args):
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@inlined
def _int64(table, k):
    return carray(_pointer(table[2 * k]), (table[2 * k + 1],), np.int64)


@inlined
def _int32(table, k):
    return carray(_pointer(table[2 * k]), (table[2 * k + 1],), np.int32)


@inlined
def _float32(table, k):
    return carray(_pointer(table[2 * k]), (table[2 * k + 1],), np.float32)


@inlined
def _float64_3(table, k):
    return carray(_pointer(table[2 * k]), (table[2 * k + 1], 3), np.float64)


@kernel
def place_bound(table, ids, rows, relative, most, limit, bias, gap, sign):
    """:func:`surface.deform.updates.place` for the arrays of a table."""
    found = carray(_pointer(table[10]), (table[11], 2), np.int64)
    local = carray(_pointer(table[54]), (table[55], 3), np.float32)
    return place(
        ids, rows, relative, _int64(table, 0), _float64_3(table, 1), _int64(table, 2), _int32(table, 3),
        _int32(table, 4), found, most, limit, bias, gap, _int64(table, 6), _int64(table, 7), _int32(table, 8),
        _int32(table, 9), _float64_3(table, 10), _float64_3(table, 11), _int64(table, 12), _int64(table, 13),
        _int64(table, 14), _int64(table, 15), _int64(table, 16), _int64(table, 17), _int32(table, 18),
        _float32(table, 19), _float32(table, 20), _float32(table, 21), _float32(table, 22), _float32(table, 23),
        _int64(table, 24), sign, _float32(table, 25), _float32(table, 26), local, _float32(table, 28),
    )  # fmt: skip
