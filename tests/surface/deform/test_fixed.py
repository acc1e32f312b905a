"""Fixed-point numbers come back as they were put, to half a step."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from surface.deform import fixed


@njit
def put_all(table, numbers):
    for k in range(numbers.shape[0]):
        for lane in range(8):
            fixed.put(table, k, lane, numbers[k, lane])


@njit
def taken(table, count):
    out = np.zeros((count, 8))
    for k in range(count):
        for lane in range(8):
            out[k, lane] = fixed.take(table, k, lane)
    return out


@njit
def power(most):
    return fixed.power_of(most)


def test_numbers_are_rounded_to_256ths() -> None:
    numbers = np.random.default_rng(2).uniform(-32768.0, 32767.9, (50, 8))
    numbers[0, :4] = 0.0, -32768.0, 32768.0, 1.0 / 256.0
    table = np.zeros(fixed.room(50), np.uint8)
    put_all(table, numbers)
    found = taken(table, 50)
    assert found[0, 2] == fixed.MOST / 256.0  # the greatest number there is
    found[0, 2] = 32768.0
    assert np.array_equal(found, np.rint(256.0 * numbers) / 256.0)
    kept = fixed.take_all(table, 0, 50)
    assert kept.dtype == np.float32 and np.array_equal(kept, taken(table, 50))


@pytest.mark.parametrize(("start", "stop"), [(0, 7), (1, 2), (2, 3), (1, 7), (3, 3)])
def test_eights_are_taken_wherever_they_start(start: int, stop: int) -> None:
    numbers = np.arange(56.0).reshape(7, 8)
    table = np.zeros(fixed.room(7), np.uint8)
    assert len(table) == 8 * 24
    put_all(table, numbers)
    assert np.array_equal(fixed.take_all(table, start, stop), numbers[start:stop])


@pytest.mark.parametrize("most", [1.0, 0.999, 0.5, 3e-30, 7e20])
def test_the_power_is_the_least_that_the_greatest_number_allows(most: float) -> None:
    found = most * 2.0 ** -power(most)
    assert 2.0**14 <= found <= 2.0**15


def test_the_power_of_nothing_is_finite() -> None:
    assert abs(power(0.0)) < 100
