"""surface.fit.wardrobe.long: a cap, and sheets that hang on both sides of a parting."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe import long as module
from surface.fit.wardrobe.long import ALONG_PART, BEGINS_MM, FANNED, LAYERS, PART_X, TIPS_Y, long
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import Style
from tests.surface.fit.wardrobe.invariants import check_patches, heights, points_of


@pytest.fixture(scope="module")
def style(skin: Skin) -> Style:
    return long(skin)


def test_there_is_a_cap_and_a_sheet_of_each_layer_on_either_side(style: Style, skin: Skin) -> None:
    check_patches([*style.patches, *style.hanging])
    assert len(style.patches) == 1 and len(style.hanging) == 2 * len(LAYERS)
    assert heights(skin, points_of(style.patches)).min() > 0.0
    over = heights(skin, points_of(style.hanging))
    assert over.min() > -2.5


def test_sheets_fall_from_the_parting_to_the_shoulders(style: Style) -> None:
    for patch in style.hanging:
        roots, tips = patch.points[0, :, 0], patch.points[0, :, -1]
        np.testing.assert_allclose(roots[:, 0], PART_X, atol=12.0)
        assert roots[:, 1].min() > 60.0 and np.median(tips[:, 1]) < TIPS_Y + 60.0
        assert (patch.sway[0, :, -1] > 0.5).all() and not patch.sway[0, :, 0].any()


def test_sheets_of_both_sides_lie_on_their_sides_the_outermost_first(style: Style) -> None:
    middle = [float(patch.points[0, :, 6:, 0].mean()) for patch in style.hanging]
    assert all(a > PART_X > b for a, b in zip(middle[::2], middle[1::2], strict=True))
    wide = [np.abs(patch.points[0, :, 4:8, 0] - PART_X).mean() for patch in style.hanging]
    assert wide[0] > wide[4] and wide[1] > wide[5]


def test_the_parting_goes_from_the_line_backwards_and_fans_out_at_its_end(skin: Skin, style: Style) -> None:
    roots = module._parting(skin, style.hairline)
    assert roots.shape == (ALONG_PART + FANNED, 3)
    assert (np.diff(roots[:ALONG_PART, 2]) < 0.0).all() and style.hairline.inside(roots).min() > 1.0
    assert BEGINS_MM <= style.hairline.inside(roots[:1])[0] < BEGINS_MM + 2.0  # the under-cap stood out before it
    np.testing.assert_array_equal(roots[ALONG_PART:], np.tile(roots[ALONG_PART - 1], (FANNED, 1)))
    assert np.abs(heights(skin, roots)).max() < 2.5


def test_the_parting_wanders_a_little(skin: Skin, style: Style) -> None:
    """One drawn with a ruler is no person's."""
    x, y, _ = module._parting(skin, style.hairline)[:ALONG_PART].T
    aside = x / (y - CENTRE[1])  # as seen from the skull's middle: a straight one has the same everywhere
    aside = aside / aside.mean() * PART_X - PART_X
    assert 0.8 < np.ptp(aside) < 4.0
    assert (np.diff(np.sign(aside)) != 0).sum() >= 3


def test_hair_over_an_ear_stands_off_there_alone() -> None:
    at = np.array([[80.0, 14.0, -4.0], [-80.0, 14.0, -4.0], [40.0, 14.0, 80.0], [80.0, 110.0, -4.0]])
    over = module._at_ear(at)
    assert over[0] == over[1] > 0.5 and over[2] == 0.0 and module._at_ear(at * [0.5, 1, 1]).max() == 0.0


def test_pairs_of_sheets_are_sorted_outermost_first() -> None:
    sheets = list("abcABC")
    assert module._inner_last(sheets) == list("aAbBcC")  # type: ignore[arg-type,comparison-overlap]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_hair_hangs_straight_over_hollows_and_over_ears_without_a_bulge(side: float) -> None:
    """Guides alike, from the parting to the side and down, with a hollow above what stands out as an ear does."""
    t = np.linspace(0.0, 1.0, 24)
    y = np.interp(t, [0.0, 0.3, 1.0], [120.0, 90.0, -120.0])
    x = np.interp(t, [0.0, 0.3, 1.0], [14.0, 80.0, 80.0]) + 15.0 * np.exp(-(((y - 20.0) / 12.0) ** 2))
    paths = np.tile(np.stack([side * x, y, 0.0 * y], axis=-1), (20, 1, 1))
    hung = module._hung(paths, side)
    np.testing.assert_allclose(hung[:, y > 96.0], paths[:, y > 96.0])  # on the skull they lie as they did
    back, front = (0, -1) if side > 0.0 else (-1, 0)
    np.testing.assert_allclose(hung[back], paths[back])  # where both sides meet there is no gap
    falls = y < 55.0
    own, before = side * hung[front, falls, 0], side * paths[front, falls, 0]
    assert np.diff(own, 2).max() < 0.5 and np.diff(before, 2).max() > 5.0  # no hollow
    assert own.max() > before.max() - 4.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_hair_that_hangs_waves_and_its_ends_turn_in(side: float) -> None:
    """Guides alike, straight down from the crown to the shoulders."""
    y = np.linspace(120.0, TIPS_Y, 60)
    paths = np.tile(np.stack([side * 80.0 + 0.0 * y, y, 0.0 * y], axis=-1), (20, 1, 1))
    waved = module._waved(paths, side)
    np.testing.assert_array_equal(waved[:, y > 40.0], paths[:, y > 40.0])
    out, inner = side * (waved - paths)[..., 0], y > TIPS_Y + module._TURNS_IN_MM[0]
    assert (np.abs(out[:, inner]) <= module._WAVE_DEEP_MM).all()
    hangs = out[:, inner & (y < -35.0)]
    free = slice(int(module._MEET), None) if side > 0.0 else slice(None, -int(module._MEET))
    assert (np.ptp(hangs[free], axis=1) > 4.0).all()  # a wave, out and in
    meet = 0 if side > 0.0 else -1
    assert np.abs(hangs[meet]).max() < 1e-9  # where both sides meet behind, none of them goes another way
    assert np.ptp(hangs, axis=0).max() > 5.0  # of locks that are out of step
    assert (out[:, -1] < module._WAVE_DEEP_MM - module._TURNS_IN_MM[1]).all()
