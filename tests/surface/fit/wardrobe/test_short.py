"""surface.fit.wardrobe.short: sheets all round from the crown, close to the skin."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.short import CROWN, FRINGED, SWEPT, short, swept, thin
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import Style
from tests.surface.fit.wardrobe.invariants import check_patches, heights, outward_share, points_of, share_below

CUTS = {short: FRINGED, swept: SWEPT, thin: SWEPT}


@pytest.fixture(scope="module", params=CUTS, ids=lambda make: make.__name__)
def make(request: pytest.FixtureRequest) -> Callable[[Skin], Style]:
    return request.param


@pytest.fixture(scope="module")
def style(make: Callable[[Skin], Style], skin: Skin) -> Style:
    return make(skin)


def test_there_is_a_sheet_of_each_layer_and_none_below_the_skin(
    style: Style, make: Callable[[Skin], Style], skin: Skin
) -> None:
    check_patches(style.patches)
    assert len(style.patches) == len(CUTS[make]) and style.hanging == ()
    over = heights(skin, points_of(style.patches))
    assert over.min() > -2.0 and over.max() < 40.0
    assert outward_share(style.patches, CENTRE) > 0.97


def test_inner_sheets_do_not_come_through_outer_ones(style: Style) -> None:
    """Where each had bulges of its own, a fifth of a sheet lay below the next one, with hard edges between the two."""
    assert max(share_below(*pair, CENTRE) for pair in pairwise(style.patches)) < 0.03


def test_strands_go_from_the_crown_to_the_line(style: Style) -> None:
    for patch in style.patches:
        points = patch.points[0]
        root, tip = points[:, 0], points[:, -1]
        assert np.linalg.norm(root - CROWN, axis=1).max() < 35.0
        assert (np.linalg.norm(tip - CROWN, axis=1) > 45.0).all()
        assert style.hairline.inside(tip).max() < 30.0  # they end near the line, or beyond it
        np.testing.assert_allclose(points[0], points[-1], atol=6.0)  # closed behind, but for locks


def test_swept_hair_grows_dense_slowly_at_the_nape(skin: Skin) -> None:
    """The innermost sheet ended in a line, in tufts."""
    made = swept(skin)
    patch = made.patches[-1]
    at = surface_at(patch.points[0], patch.degrees, [np.linspace(0.0, 1.0, n) for n in patch.grid])
    inside, cover = made.hairline.inside(at.reshape(-1, 3)).reshape(patch.grid), patch.strands[0, ..., 2]
    nape = (at[..., 2] < -45.0) & (inside > 0.0) & (inside < 0.75 * SWEPT[-1].edge_mm)
    assert nape.sum() > 20 and cover[nape].max() < 1.0
    wanted = (inside[nape] + 1.0) / SWEPT[-1].edge_mm  # hair is cut so far outside the line
    assert np.median(np.abs(cover[nape] - wanted)) < 0.1 and (cover[nape] - wanted).max() < 0.2


def test_the_same_head_gets_the_same_hair(style: Style, make: Callable[[Skin], Style], skin: Skin) -> None:
    again = make(skin)
    for one, other in zip(style.patches, again.patches, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.strands, other.strands)


def test_sheets_are_closed_at_the_crown_and_end_evenly_round_the_line(style: Style) -> None:
    """A hole at the crown shows the hollow head; where tips are far apart a sheet leaves the skin between them."""
    for patch in style.patches:
        crown, tips = patch.points[0, :, 0], patch.points[0, :, -1]
        np.testing.assert_allclose(crown, crown[:1].repeat(len(crown), axis=0), atol=1e-6)
        apart = np.linalg.norm(np.diff(tips, axis=0), axis=1)[1:-1]
        assert apart.max() < 3.0 * np.median(apart)
