"""surface.fit.wardrobe.strays: fins of stray hairs that stand on a sheet."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.fit.wardrobe.bun import bun
from surface.fit.wardrobe.long import long
from surface.fit.wardrobe.patches import BARE, Patches
from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.short import short, swept, thin
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.strays import Strays, strays
from tests.surface.fit.wardrobe.invariants import check_patches

RADIUS = 80.0
HOW = Strays(20, 5.0, (0.1, 0.9))


def ball() -> Patches:
    """A sheet over a part of a ball about the origin, whose strands fall from its top."""
    turn, down = np.meshgrid(np.linspace(1.5, -1.5, 24), np.linspace(0.2, 1.8, 16), indexing="ij")
    points = RADIUS * np.stack([np.sin(turn) * np.sin(down), np.cos(down), np.cos(turn) * np.sin(down)], axis=-1)
    flat = np.zeros((1, 24, 16))
    return Patches(points[None], (3, 3), (24, 16), (12, 8), np.zeros((1, 24, 16, 4)), flat, flat + 1.0,
                   np.broadcast_to(np.linspace(0.0, 0.8, 16), (1, 24, 16)))  # fmt: skip


@pytest.fixture(scope="module")
def fins() -> Patches:
    return strays(ball(), HOW, np.zeros(3), seed=3)


def test_fins_stand_on_the_sheet_and_rise_from_it_no_higher_than_they_shall(fins: Patches) -> None:
    check_patches([fins])
    assert len(fins.points) == HOW.count
    low, high = (np.linalg.norm(fins.points[:, k], axis=2) - RADIUS for k in (0, 1))
    assert low.max() < 0.0 and low.min() > -1.5
    assert high.max() < HOW.high_mm and high[:, -1].min() > 0.4 * HOW.high_mm
    assert (high[:, 0] < 0.5).all()  # they begin on it


def test_fins_lie_along_strands_within_their_reach(fins: Patches) -> None:
    down = np.arccos(fins.points[:, 0, :, 1] / np.linalg.norm(fins.points[:, 0], axis=2))
    assert (np.diff(down, axis=1) > 0.0).all()
    share = (down - 0.2) / 1.6
    assert share.min() > 0.08 and share.max() < 0.92
    turn = np.arctan2(fins.points[:, 0, :, 0], fins.points[:, 0, :, 2])
    assert np.ptp(turn, axis=1).max() < 0.02 and np.ptp(turn) > 2.5  # all round


def test_hairs_are_few_far_out_and_none_end_in_an_edge(fins: Patches) -> None:
    cover = fins.strands[..., 2]
    np.testing.assert_allclose(cover[:, :, [0, -1]], -BARE)
    middle = cover[:, :, cover.shape[2] // 2]
    assert (np.diff(middle, axis=1) < -0.1).all() and middle[:, 0].min() > 0.5 and middle[:, -1].max() < 0.2


def test_fins_sway_as_the_sheet_does_below_them(fins: Patches) -> None:
    down = np.arccos(fins.points[:, 0, :, 1] / np.linalg.norm(fins.points[:, 0], axis=2))
    np.testing.assert_allclose(fins.sway[:, 0], 0.8 * (down - 0.2) / 1.6, atol=0.02)
    np.testing.assert_array_equal(fins.sway[:, 0], fins.sway[:, 1])


def test_the_same_seed_gives_the_same_strays_and_another_others() -> None:
    one, again, other = (strays(ball(), HOW, np.zeros(3), seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.points, again.points)
    np.testing.assert_array_equal(one.strands, again.strands)
    assert np.abs(one.points - other.points).max() > 1.0


@pytest.mark.parametrize("make", [short, swept, thin, long, bun], ids=lambda make: make.__name__)
def test_straight_hair_has_strays_that_hold_on_to_it(make, skin: Skin) -> None:  # type: ignore[no-untyped-def]
    style = make(skin)
    check_patches(style.strays)
    every = np.concatenate([
        surface_at(patch.points[0], patch.degrees, [np.linspace(0, 1, 300), np.linspace(0, 1, 120)]).reshape(-1, 3)
        for patch in (*style.patches, *style.hanging)
    ])  # fmt: skip
    for fins in style.strays:
        away, _ = cKDTree(every).query(fins.points[:, 0].reshape(-1, 3))
        assert np.quantile(away, 0.95) < 4.0
