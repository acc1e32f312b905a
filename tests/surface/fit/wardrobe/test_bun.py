"""surface.fit.wardrobe.bun: hair on the skull, and a ball of it behind."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe import bun as module
from surface.fit.wardrobe.bun import BUN, BUN_LAYERS, LAYERS, bun
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import Style
from surface.fit.wardrobe.write import HIDDEN_MM
from tests.surface.fit.wardrobe.invariants import check_patches, heights, outward_share, points_of


@pytest.fixture(scope="module")
def style(skin: Skin) -> Style:
    return bun(skin)


def test_the_coil_comes_before_the_sheets_on_the_skull(style: Style, skin: Skin) -> None:
    check_patches(style.patches)
    assert len(style.patches) == len(BUN_LAYERS) + len(LAYERS) and style.hanging == ()
    coil, skull = style.patches[: len(BUN_LAYERS)], style.patches[len(BUN_LAYERS) :]
    assert np.linalg.norm(points_of(coil) - BUN, axis=1).max() < 40.0
    assert heights(skin, points_of(skull)).min() > -2.5
    assert outward_share(coil, BUN) > 0.99
    assert outward_share(skull, CENTRE) > 0.9


def test_places_on_the_bun_are_those_of_an_ellipsoid_in_its_own_axes() -> None:
    frame = module._frame()
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0) and frame[2] @ [0.0, 0.0, -1.0] > 0.5  # it points backwards
    polar, round_it = np.meshgrid(np.linspace(0.1, 3.0, 9), np.linspace(0, 6, 11), indexing="ij")
    for grown in (1.0, 1.5):
        own = (module._surface(polar, round_it, grown) - BUN) @ frame.T
        np.testing.assert_allclose(((own / module._RADII) ** 2).sum(axis=-1), grown**2)
    np.testing.assert_allclose(module._surface(np.zeros(1), np.zeros(1), 1.0)[0], BUN + module._RADII[2] * frame[2])


def test_strands_of_the_skull_go_from_skin_that_is_drawn_to_below_the_bun(style: Style) -> None:
    coil = np.linalg.norm(style.patches[1].points[0, :, 0] - BUN + 14.0 * module._OUT, axis=1).min()
    for patch in style.patches[len(BUN_LAYERS) :]:
        roots, tips = patch.points[0, :, 0], patch.points[0, :, -1]
        assert style.hairline.inside(roots).max() < HIDDEN_MM - 3.0  # else one looks through the head below them
        tips = np.linalg.norm(tips - BUN + 14.0 * module._OUT, axis=1)
        assert np.quantile(tips, 0.9) < coil - 2.0  # else one looks through the head between them and the bun


def test_the_inner_coil_is_closed_up_to_its_tip(style: Style) -> None:
    """Over 1 it is closed; between vertices cover is interpolated, and the last ones have none."""
    before, last = style.patches[1].strands[0, :, -2, 2], style.patches[1].strands[0, :, -1, 2]
    open_share = (1.0 - last) / (before - last)
    step_mm = np.linalg.norm(np.diff(style.patches[1].points[0], axis=1), axis=2).sum(axis=1).max() / 12
    assert (open_share * step_mm).max() < 3.0


def test_the_inner_coil_is_smaller_and_closed(style: Style) -> None:
    outer, inner = (np.linalg.norm(patch.points[0] - BUN, axis=2) for patch in style.patches[:2])
    assert (inner < outer).all()
    assert style.patches[1].strands[0, :, 1:-2, 2].mean() > 1.0 > style.patches[0].strands[0, :, 1:-2, 2].mean()
