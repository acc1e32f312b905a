"""Blinks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.layers.idle.blinks import Blink, Blinks
from controller.layers.idle.draws import generator
from controller.layers.idle.settings import BlinkSettings, IdleSettings


@pytest.fixture
def blink(settings: IdleSettings) -> BlinkSettings:
    return settings.blink


def all_of(blink: BlinkSettings, seconds: float = 3600.0, *, seed: int = 1, rate: float = 1.0) -> list[Blink]:
    """Every blink of some time: in steps from one to the next."""
    blinks, found = Blinks(blink, generator(seed, "blinks")), []
    blinks.begin(0.0, rate)
    while blinks.next_s < seconds:
        blinks.advance(blinks.next_s, rate)
        found += blinks.blinks
        blinks.blinks = []
    return found


def test_intervals_have_the_mean_of_the_file_and_long_tails(blink: BlinkSettings) -> None:
    single = blink.model_copy(update={"double_share": 0.0})
    starts = np.array([each.lids[0].start_s for each in all_of(single, 7200.0)])
    pauses = np.diff(starts) - 0.28
    assert np.mean(pauses) == pytest.approx(4.5, abs=0.25) and np.std(pauses) == pytest.approx(2.8, abs=0.3)
    assert np.median(pauses) < np.mean(pauses) and pauses.min() > 0.75
    assert len(all_of(single, 3600.0, rate=2.0)) > 1.7 * len(all_of(single, 3600.0))


def test_partial_blinks_have_their_share_and_take_as_long_as_complete_ones(blink: BlinkSettings) -> None:
    blinks = all_of(blink, 7200.0)
    partial = [each for each in blinks if max(each.amounts) < 1.0]
    assert len(partial) / len(blinks) == pytest.approx(blink.partial_share, abs=0.04)
    low, high = blink.partial_amount
    assert all(low <= max(each.amounts) <= high for each in partial)
    lengths = [(each.lids[0].onset_s, each.lids[0].offset_s) for each in blinks]
    assert set(lengths) == {(blink.close_s, blink.open_s)} and blink.close_s < 0.6 * blink.open_s  # Evinger 1991


def test_one_lid_is_later_and_closes_less_and_it_is_always_the_same(blink: BlinkSettings) -> None:
    sides = set()
    for seed in range(8):
        blinks = all_of(blink, 600.0, seed=seed)
        lags = np.array([each.lids[1].start_s - each.lids[0].start_s for each in blinks])
        less = np.array([each.amounts[0] - each.amounts[1] for each in blinks])
        side = np.sign(lags[0])
        assert np.all(side * lags >= 0.0) and np.all(side * less >= 0.0)
        assert 0.0 < np.abs(lags).max() <= blink.lag_s
        assert 0.0 < np.abs(less).max() <= blink.uneven_share
        assert all(each.amounts == (1.0, 1.0) for each in blinks if max(each.amounts) == 1.0)
        sides.add(side)
    assert sides == {-1.0, 1.0}


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_double_blink_comes_after_its_gap(blink: BlinkSettings, share: float) -> None:
    figures = {"interval_s": (5.0, 5.0), "double_share": share, "double_gap_s": (0.3, 0.3), "hold_s": (0.05, 0.05)}
    found = all_of(blink.model_copy(update={**figures, "lag_s": 0.0}), 60.0)
    starts, once = np.array([each.lids[0].start_s for each in found]), blink.close_s + 0.05 + blink.open_s
    if share:
        np.testing.assert_allclose(np.diff(starts)[::2], once + 0.3)
        np.testing.assert_allclose(np.diff(starts)[1::2], once + 5.0)
    else:
        np.testing.assert_allclose(np.diff(starts), once + 5.0)


def test_levels_follow_the_lids_and_less_life_has_fewer_blinks_of_the_same_size(blink: BlinkSettings) -> None:
    blinks = Blinks(blink.model_copy(update={"partial_share": 0.0}), generator(3, "x"))
    blinks.begin(0.0)
    blinks.advance(blinks.next_s)
    (one, *_), start = blinks.blinks, blinks.blinks[0].lids[0].start_s
    assert (
        blinks.levels(start + blink.close_s + 0.008, 1.0) == (1.0, 1.0) == blinks.levels(start + 0.084, one.rank + 1e-9)
    )
    assert blinks.levels(start + 0.084, one.rank) == (0.0, 0.0)
    shares = [each.rank for each in all_of(blink)]
    assert np.mean(np.array(shares) < 0.3) == pytest.approx(0.3, abs=0.06)


def test_large_gaze_shifts_often_bring_a_blink(blink: BlinkSettings) -> None:
    def blinked(angle_rad: float, seed: int) -> bool:
        blinks = Blinks(blink, generator(seed, "x"))
        blinks.begin(0.0)
        blinks.shift(angle_rad, 0.01)
        blinks.advance(0.02)
        return bool(blinks.blinks)

    assert np.mean([blinked(0.5, seed) for seed in range(300)]) == pytest.approx(blink.shift_share, abs=0.09)
    sure = blink.model_copy(update={"shift_share": 1.0, "shift_deg": math.degrees(0.3)})
    for angle_rad, soon in ((0.3, True), (-0.3, True), (0.29, False), (-0.29, False)):
        blinks = Blinks(sure, generator(1, "x"))
        blinks.begin(0.0)
        blinks.shift(angle_rad, 0.25)
        assert (blinks.next_s == 0.25) == soon
        blinks.shift(0.4, 0.5)
        assert blinks.next_s == (0.25 if soon else 0.5)  # one that is due before stays so


def test_a_blink_that_goes_on_is_not_begun_again(blink: BlinkSettings) -> None:
    blinks = Blinks(blink.model_copy(update={"double_share": 0.0}), generator(1, "x"))
    blinks.begin(0.0)
    first = blinks.next_s
    blinks.advance(first)
    due = blinks.next_s
    blinks.request(first + 0.1)
    assert blinks.next_s == due
    blinks.request(blinks.blinks[-1].end_s + 0.31)
    assert blinks.next_s < due
