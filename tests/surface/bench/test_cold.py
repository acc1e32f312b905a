"""Cold rows: complete, in turn, with intervals; no figure is judged here."""

from __future__ import annotations

from time import sleep

import numpy as np
import pytest

from surface.bench import cold
from surface.bench.bench import Measure
from surface.deform.lists import build_lists


def test_calls_take_turns_until_time_is_up() -> None:
    calls: list[str] = []
    times = cold.cold_times([lambda: calls.append("a"), lambda: (calls.append("b"), sleep(0.001))], 0.0, 64)
    assert calls == ["a", "b"] * (1 + cold.MIN_ROUNDS)
    assert times.shape == (cold.MIN_ROUNDS, 2)
    assert (times[:, 1] >= 1.0).all() and (times[:, 0] < times[:, 1]).all()  # milliseconds


def test_rounds_go_on_only_while_a_ratio_is_unsteady(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter(np.cumsum(np.random.default_rng(0).exponential(size=10_000)).tolist())
    monkeypatch.setattr(cold.time, "perf_counter", lambda: next(times))
    steady = cold.cold_times([lambda: None], 1e9, 8)
    assert len(steady) == cold.MIN_ROUNDS
    unsteady = cold.cold_times([lambda: None, lambda: None], 500.0, 8, [(0, 1)])
    assert len(unsteady) > cold.MIN_ROUNDS


def test_other_memory_is_written_between_calls() -> None:
    """Without that the call would find its array in the cache, and the row would be as flattering as a warm one."""
    array = np.ones(200_000)
    warm = np.median(cold.cold_times([array.sum], 0.0, 8))
    flushed = np.median(cold.cold_times([array.sum], 0.0, 1 << 26))
    assert flushed > warm


def test_intervals_hold_the_median() -> None:
    median, low, high = cold.median_interval(np.arange(101.0)[::-1])
    assert (median, low, high) == (50.0, 40.0, 61.0)  # ranks 50.5 -+ 0.98 sqrt(101)
    assert cold.median_interval(np.array([2.0, 1.0])) == (1.5, 1.0, 2.0)


def test_noise_cannot_pass_a_bound() -> None:
    assert Measure("a", 1.0, 1.8, "b", "<= 2.0", (1.7, 1.9)).kept is True
    assert Measure("a", 1.0, 1.8, "b", "<= 2.0", (1.7, 2.1)).kept is False
    assert Measure("a", 1.0, 6.0, "b", ">= 5", (4.9, 7.0)).kept is False
    assert Measure("a", 1.0, 1.0, "b", "0.9 to 1.1", (0.95, 1.2)).kept is False


def test_surfaces_of_other_kinds() -> None:
    levels, mesh = cold.hierarchical(1_000)
    spacing = np.unique([np.round(np.diff(k[:5]).max(), 6) for k in levels.arrays()[0]])
    assert spacing.tolist() == pytest.approx([1 / 64, 1 / 32, 1 / 16], rel=1e-4)
    assert np.isfinite(mesh.vertices).all() and len(mesh.vertices) == 33**2
    scattered, mesh = cold.scattered(200, 1_000)
    assert np.isfinite(mesh.vertices).all() and len(mesh.vertices) == 33**2
    assert len(np.unique(scattered.arrays()[0][:, 0])) == scattered.n


def test_rows_of_a_surface() -> None:
    reported: list[str] = []
    case = cold.scattered(100, 500)
    rows = cold.cold_rows("some", [case, case], 0.0, "<= 1.0", 64, reported.append)
    assert reported == ["some"] and [row.name.partition(": ")[2] for row in rows] == [
        cold.READ, "all positions", "all positions and normals", "scipy CSR @ dense", "stencil table, row by row",
        "memory of weights and lists", "weights that are zero",
    ]  # fmt: skip
    for row in rows[1:5]:
        assert row.ratio is not None and row.interval is not None
        assert row.interval[0] <= row.ratio <= row.interval[1] and row.milliseconds > 0
    assert [row.reach for row in rows] == ["", "<= 1.0", "", ">= 5", ">= 2", "", "<= 0.2"]
    weights = build_lists(*case, False).value
    deformation = case[0].deformation(case[1], normals=False)
    assert rows[5].ratio == pytest.approx(deformation.nbytes / (4 * np.count_nonzero(weights)))
    assert rows[6].ratio == cold.zero_fraction([deformation])


def test_the_share_of_zeros_is_that_of_all_weights_that_are_not_factors() -> None:
    case = cold.scattered(100, 500)
    weights, deformation = build_lists(*case, False).value, case[0].deformation(case[1], normals=False)
    assert not (deformation.storage.factors.rows_at >= 0).any()
    kept = len(deformation.storage.packed.packed) // 3 + deformation.lists.used
    fraction = 1.0 - np.count_nonzero(weights) / kept
    assert fraction <= cold.zero_fraction([deformation]) < fraction + 0.02  # some are less than half a step
    assert 0.0 < cold.zero_fraction([deformation]) < 1.0 - np.count_nonzero(weights) / len(weights)
    assert cold.zero_fraction([]) == 0.0


@pytest.mark.parametrize("size", [0.001, 1.0, 1000.0])
@pytest.mark.parametrize(("width", "steady"), [(0.059, True), (0.061, False)])
def test_a_ratio_is_steady_where_its_interval_is_6_per_cent_wide_at_most(
    size: float, width: float, steady: bool
) -> None:
    ratios = size * np.array([1.0 - 0.5 * width, 1.0 + 0.5 * width])  # of two values the interval spans both
    times = np.column_stack([3.0 * ratios, [3.0, 3.0], [5.0, 5.0]])
    assert cold._are_steady(times, [(0, 1)]) == steady
    assert cold._are_steady(times, [(1, 2), (0, 1)]) == cold._are_steady(times, [(0, 1), (1, 2)]) == steady
    assert cold._are_steady(times, [(1, 2)]) and cold._are_steady(times, [])


def test_surfaces_have_the_points_of_their_levels_on_a_bumpy_square() -> None:
    assert cold._hill(0.3, 0.7) == pytest.approx((60.0, 140.0, 20 * np.sin(3.0) * np.cos(5.6)))
    levels, _ = cold.hierarchical(64)
    counts = [19**2 - 5**2, 13**2 - 5**2, 13**2]  # each without what lies in the next one's region
    assert levels.n == sum(counts)
    rows = levels.arrays()[0][:, :5]
    spacing = np.diff(rows, axis=1).max(axis=1)
    assert [int(np.isclose(spacing, 1 / n).sum()) for n in (16, 32, 64)] == counts
    np.testing.assert_allclose(levels.points[:, 0] / 200, rows[:, 1:4].mean(axis=1))
    scattered, _ = cold.scattered(100, 64)
    assert scattered.n == 144 and len(cold.scattered(1, 64)[0].points) == 36
    assert len(cold._tessellate(levels, 1000).vertices) == 33**2 and len(cold._tessellate(levels, 2).vertices) == 9
