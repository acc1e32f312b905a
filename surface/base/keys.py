"""Unique integers by hashing, several times faster than ``numpy.unique``, which sorts, if keys repeat often."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Ints

from .jit import kernel

FIRST_SIZE = 1 << 10  # of the hash table, which grows from there
HASH_FACTOR = np.uint64(
    0x9E3779B97F4A7C15
)  # 2**64 / golden ratio spreads blocks of eight neighbouring keys (Knuth, 6.4)


def unique(keys: Ints) -> tuple[Ints, Ints, Ints]:
    """Do the same as ``numpy.unique(keys, return_index=True, return_inverse=True)`` for int64 of any shape."""
    first, back = number(keys)
    values = keys.reshape(-1)[first]
    order = np.argsort(values)
    rank = np.zeros(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return values[order], first[order], rank[back]


def number(keys: Ints) -> tuple[Ints, Ints]:
    """Number equal keys alike, in order of appearance: ``first (k,)``, where each appears first, ascending, and
    ``back``, the number of each key, in the shape of ``keys``."""
    flat = np.ascontiguousarray(keys).reshape(-1)
    first, back = np.zeros(len(flat), dtype=np.int64), np.zeros(len(flat), dtype=np.int64)
    count = _number_keys(flat, first, back)
    return first[:count].copy(), back.reshape(keys.shape)


def find(keys: Ints, wanted: Ints) -> Ints:
    """Return (k,) int64: the index of each of ``wanted (k,)`` in ``keys (n,)``, which are all different; -1 if
    missing.
    """
    index = number(np.concatenate([keys, wanted]))[1][len(keys) :]
    return np.where(index < len(keys), index, -1)


@kernel
def _find_slot(key, keys, first, table):
    """Return the key's place in the hash table, whose size is a power of two: taken by it, or free (-1)."""
    block = (np.uint64(key >> 3) * HASH_FACTOR) >> np.uint64(20)
    place = np.int64((block << np.uint64(3) | np.uint64(key & 7)) & np.uint64(table.shape[0] - 1))
    while table[place] >= 0 and keys[first[table[place]]] != key:
        place = (place + 1) & (table.shape[0] - 1)
    return place


@kernel
def _number_keys(keys, first, back):
    """Number different keys in order of appearance; returns how many there are."""
    table, count = np.full(FIRST_SIZE, -1, dtype=np.int32), 0
    for k in range(keys.shape[0]):
        place = _find_slot(keys[k], keys, first, table)
        if table[place] < 0:
            table[place], first[count] = count, k
            count += 1
            back[k] = count - 1
            if 2 * count > table.shape[0]:
                table = np.full(4 * table.shape[0], -1, dtype=np.int32)
                for n in range(count):
                    table[_find_slot(keys[first[n]], keys, first, table)] = n
        else:
            back[k] = table[place]
    return count
