"""Eight lanes at once against one number at a time."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from surface.spline import lanes


@njit
def combined(a, b, number, out):
    """Every operation once."""
    x, y = lanes.load(a, 1), lanes.load(b, 0)
    lanes.prefetch(a, 10_000)
    lanes.store(out, 0, lanes.add(x, y))
    lanes.store(out, 8, lanes.sub(x, y))
    lanes.store(out, 16, lanes.mul(x, y))
    lanes.store(out, 24, lanes.div(x, y))
    lanes.store(out, 32, lanes.fma(x, number, y))
    lanes.store(out, 40, lanes.root(y))
    lanes.store(out, 48, lanes.splat(number))
    lanes.store(out, 56, lanes.zero())
    lanes.store3(out, 64, x, y, lanes.splat(number))


def test_every_operation() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=9).astype("f4"), rng.uniform(1, 2, 8).astype("f4")
    number, out = np.float32(1.25), np.full(88, np.nan, dtype=np.float32)
    combined(a, b, number, out)
    x = a[1:]
    wanted = [x + b, x - b, x * b, x / b, x * number + b, np.sqrt(b), np.full(8, number), np.zeros(8)]
    assert np.allclose(out[:64].reshape(8, 8), wanted, rtol=3e-7, atol=3e-7)
    assert np.array_equal(out[64:].reshape(8, 3), np.stack([x, b, np.full(8, number)], axis=1))


def test_short_numbers_are_loaded_as_they_are() -> None:
    @njit
    def loaded(shorts, out):
        lanes.store(out, 0, lanes.load(shorts, 3))

    shorts, out = np.array([7, 7, 7, -32768, -1, 0, 1, 32767, 2, 3, 4, 9], np.int16), np.empty(8, np.float32)
    loaded(shorts, out)
    assert out.tolist() == shorts[3:11].tolist()


def test_fixed_point_numbers_are_whole_parts_and_256ths() -> None:
    """Of two pairs of eights, each is loaded alone, and the second pair at once."""

    @njit
    def loaded(octets, out):
        for k in range(4):
            lanes.store(out, 8 * k, lanes.load_fixed(octets, k))
        both = lanes.load_fixed_pair(octets, 2)
        lanes.store(out, 32, lanes.first_of(both))
        lanes.store(out, 40, lanes.second_of(both))

    ends = [0.0, 1.0, -1.0, 32767 + 255 / 256, -32768.0, 1 / 256, -1 / 256, 300.5]
    numbers = np.array([ends, ends[::-1], np.arange(8.0), ends]).reshape(2, 16)
    whole = np.floor(numbers)
    upper = np.frombuffer(whole.astype("<i2").tobytes(), np.uint8).reshape(2, 32)
    octets = np.concatenate([upper, 256 * (numbers - whole)], axis=1).astype(np.uint8).ravel()
    out = np.empty(48, np.float32)
    loaded(octets, out)
    assert out.tolist() == [*numbers.ravel().tolist(), *numbers[1].tolist()]


def test_pairs_take_two_numbers_of_a_table() -> None:
    @njit
    def summed(shorts, table, out):
        both = lanes.fma_pair(lanes.load_pair(shorts, 1), table, 2, 0, lanes.zero_pair())
        both = lanes.add_pairs(both, lanes.load_pair(shorts, 0))
        lanes.store(out, 0, lanes.first_of(both))
        lanes.store(out, 8, lanes.second_of(both))

    shorts, out = np.arange(-3, 14, dtype=np.int16) * 100, np.empty(16, np.float32)
    summed(shorts, np.array([0.5, 99.0, -2.0], np.float32), out)
    assert out.tolist() == (shorts[1:] * np.repeat([-2.0, 0.5], 8) + shorts[:-1]).tolist()


def test_the_greatest_of_three_and_whether_any_lane_reaches_a_number() -> None:
    @njit
    def largest(a, b, c, out):
        lanes.store(out, 0, lanes.most_of(lanes.load(a, 0), lanes.load(b, 0), lanes.load(c, 0)))

    @njit
    def any_reaches(a, number):
        return lanes.reaches(lanes.load(a, 0), number)

    rng, out = np.random.default_rng(1), np.zeros(8, "f4")
    a, b, c = rng.normal(size=(3, 8)).astype("f4")
    a[2] = b[2] = c[2] = 0.0
    largest(a, b, c, out)
    assert np.array_equal(out, np.maximum(np.abs([a, b, c]).max(axis=0), np.float32(1e-37)))
    assert any_reaches(out, out.max()) and not any_reaches(out, np.float32(1.001) * out.max())
    for k in range(8):
        a[:] = 1.0
        a[k] = np.nan
        assert any_reaches(a, np.float32(2.0))


@pytest.mark.parametrize("fast", sorted({False, lanes.PICKS_FAST}))
def test_lanes_are_picked_with_and_without_an_instruction_for_it(fast: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lanes, "PICKS_FAST", fast)

    @njit
    def picked(values, picks, out):
        lanes.store(out, 0, lanes.pick(values, 2, picks, 1))

    values, picks = np.arange(12, dtype="f4") ** 2, np.array([9, 0, 7, 3, 3, 5, 1, 2, 6], np.int32)
    out = np.zeros(8, "f4")
    picked(values, picks, out)
    assert np.array_equal(out, values[2 + picks[1:]])


def test_a_processor_chosen_for_numba_has_what_its_features_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lanes.config, "CPU_NAME", "generic")
    monkeypatch.setattr(lanes.config, "CPU_FEATURES", None)
    assert lanes._has("avx2") is False
    monkeypatch.setattr(lanes.config, "CPU_FEATURES", "+avx,+avx2")
    assert lanes._has("avx2") is True


@njit
def separated(rows, points, origin, out, local):
    """Eight vectors by coordinate, and rows of points relative to origins."""
    lanes.store(out, 0, lanes.load_x(rows, 3))
    lanes.store(out, 8, lanes.load_y(rows, 3))
    lanes.store(out, 16, lanes.load_z(rows, 3))
    lanes.store_difference(local, 4, points, 6, origin, 3)


def test_coordinates_are_separated_and_points_placed_relative_to_origins() -> None:
    rng = np.random.default_rng(1)
    rows, points, origin = rng.normal(size=(9, 3)).astype("f4"), rng.normal(size=(4, 3)), rng.normal(size=(3, 3))
    out, local = np.zeros(24, "f4"), np.zeros((3, 4), "f4")
    separated(rows.ravel(), points, origin, out, local)
    assert np.array_equal(out.reshape(3, 8), rows[1:].T)
    assert np.array_equal(local[1, :3], (points[2] - origin[1]).astype("f4")) and not local[[0, 2]].any()
