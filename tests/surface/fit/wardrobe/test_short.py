"""surface.fit.wardrobe.short: sheets all round from the crown, close to the skin."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe.short import CROWN, LAYERS, short
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import Style
from tests.surface.fit.wardrobe.invariants import check_patches, heights, outward_share, points_of


@pytest.fixture(scope="module")
def style(skin: Skin) -> Style:
    return short(skin)


def test_there_is_a_sheet_of_each_layer_and_none_below_the_skin(style: Style, skin: Skin) -> None:
    check_patches(style.patches)
    assert len(style.patches) == len(LAYERS) and style.hanging == ()
    over = heights(skin, points_of(style.patches))
    assert over.min() > -1.5 and over.max() < 40.0
    assert outward_share(style.patches, CENTRE) > 0.97


def test_strands_go_from_the_crown_to_the_line(style: Style) -> None:
    for patch in style.patches:
        points = patch.points[0]
        root, tip = points[:, 0], points[:, -1]
        assert np.linalg.norm(root - CROWN, axis=1).max() < 35.0
        assert (np.linalg.norm(tip - CROWN, axis=1) > 45.0).all()
        assert style.hairline.inside(tip).max() < 30.0  # they end near the line, or beyond it
        np.testing.assert_allclose(points[0], points[-1], atol=6.0)  # closed behind, but for locks


def test_the_same_head_gets_the_same_hair(style: Style, skin: Skin) -> None:
    again = short(skin)
    for one, other in zip(style.patches, again.patches, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.strands, other.strands)
