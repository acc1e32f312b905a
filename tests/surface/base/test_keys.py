"""Hashed keys agree with numpy's sorted ones."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from surface.base import keys

NUMBERS = st.integers(-(2**62), 2**62) | st.integers(-3, 60)


@settings(max_examples=60, deadline=None)
@given(arrays(np.int64, st.tuples(st.integers(0, 80), st.integers(1, 3)), elements=NUMBERS))
def test_unique_is_numpys(table: np.ndarray) -> None:
    for mine, theirs in zip(keys.unique(table), np.unique(table, return_index=True, return_inverse=True), strict=True):
        assert np.array_equal(mine.ravel(), theirs.ravel())


def test_many_keys_grow_the_table() -> None:
    rng = np.random.default_rng(1)
    table = rng.integers(0, 9_000, (40_000, 2)) * 4096
    values, first, back = keys.unique(table)
    assert np.array_equal(values, np.unique(table))
    assert np.array_equal(table.ravel()[first], values)
    assert np.array_equal(values[back], table)


def test_numbers_count_in_order_of_appearance() -> None:
    first, back = keys.number(np.array([[7, 7, 3], [9, 3, 7]]))
    assert first.tolist() == [0, 2, 3]
    assert back.tolist() == [[0, 0, 1], [2, 1, 0]]


@settings(max_examples=60, deadline=None)
@given(st.lists(NUMBERS, unique=True, max_size=40), st.lists(NUMBERS, max_size=40))
def test_find_gives_the_place_or_minus_one(held: list[int], wanted: list[int]) -> None:
    found = keys.find(np.array(held, dtype=np.int64), np.array(wanted, dtype=np.int64))
    assert found.tolist() == [held.index(x) if x in held else -1 for x in wanted]
