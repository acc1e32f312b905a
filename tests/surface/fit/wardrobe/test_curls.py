"""surface.fit.wardrobe.curls: closed shells one over the other, close to the skull or far from it."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe.curls import afro, crop
from surface.fit.wardrobe.shade import surface_at
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import Style
from tests.surface.fit.wardrobe.invariants import asymmetry, check_patches, heights, outward_share, points_of


@pytest.fixture(scope="module", params=[crop, afro], ids=["crop", "afro"])
def style(request: pytest.FixtureRequest, skin: Skin) -> Style:
    made: Style = request.param(skin)
    return made


def test_shells_are_whole_arrays_outside_of_the_skin(style: Style, skin: Skin) -> None:
    check_patches(style.patches)
    assert len(style.patches) == 3 and style.hanging == ()
    assert heights(skin, points_of(style.patches)).min() > -1.0
    assert outward_share(style.patches, CENTRE) > 0.99


def test_each_shell_lies_under_the_one_before_it_and_is_denser(style: Style) -> None:
    far = [np.linalg.norm(patch.points[0] - CENTRE, axis=2) for patch in style.patches]
    dense = [patch.strands[0, :, :-2, 2].mean() for patch in style.patches]
    for k in (1, 2):
        assert (far[k] <= far[k - 1] + 1e-9).all() and far[k].mean() < far[k - 1].mean() - 0.3
        assert dense[k] > dense[k - 1]
    assert dense[-1] > 1.0  # the innermost is closed


def test_curls_are_the_same_on_both_sides_of_a_head_that_is(style: Style) -> None:
    """The skin's samples lie a little differently on both sides."""
    assert asymmetry(points_of(style.patches)) < 4.0


def test_a_shell_is_closed_behind_with_whole_tiles_and_thins_out_at_its_edge(style: Style) -> None:
    for patch in style.patches:
        strands = patch.strands[0]
        tiles = strands[-1, 0, 0] - strands[0, 0, 0]
        assert tiles == pytest.approx(round(tiles)) and tiles > 4.0
        np.testing.assert_allclose(strands[-1, :, 2:], strands[0, :, 2:])
        assert (strands[:, -1, 2] < 0.3 * strands[:, 0, 2]).all()
        np.testing.assert_allclose(patch.points[0, 0], patch.points[0, -1], atol=1e-6)


def test_the_innermost_shell_grows_dense_slowly_and_nowhere_in_bites(style: Style) -> None:
    patch = style.patches[-1]
    at = surface_at(patch.points[0], patch.degrees, [np.linspace(0.0, 1.0, n) for n in patch.grid])
    inside, cover = style.hairline.inside(at.reshape(-1, 3)).reshape(patch.grid), patch.strands[0, ..., 2]
    border = (inside > 2.0) & (inside < 12.0)
    border[:, -1] = False
    assert border.sum() > 40 and cover[border].max() < 0.95 and cover[inside < 6.0].max() < 0.5
    level = cover[border] - np.polyval(np.polyfit(inside[border], cover[border], 1), inside[border])
    assert level.std() < 0.06


def test_a_cloud_is_larger_than_a_crop(skin: Skin) -> None:
    close, full = (np.linalg.norm(make(skin).patches[0].points[0] - CENTRE, axis=2) for make in (crop, afro))
    assert (full[:, :4] - close[:, :4]).min() > 8.0  # over the crown


def test_a_cloud_lies_on_the_skin_where_it_thins_out_and_rises_from_there_at_once(skin: Skin) -> None:
    """Hair that begins far from the skin is a cap with a brim, and one that thins out off the skin is seen through."""
    points = afro(skin).patches[0].points[0]
    assert heights(skin, points[:, -1]).max() < 2.0
    assert np.median(heights(skin, points[:, -2])) < 1.5
    assert np.median(heights(skin, points[:, -4])) > 6.0


def test_a_crop_lies_close(skin: Skin) -> None:
    assert heights(skin, points_of(crop(skin).patches)).max() < 12.0
