"""surface.fit.wardrobe.shade: what keeps light from skin and cloth."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe import shade as module
from surface.fit.wardrobe.clothes import NECKS, garment
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.long import long
from surface.fit.wardrobe.patches import Patches, greville
from surface.fit.wardrobe.shade import blocked, shade, surface_at, worn_shade
from surface.fit.wardrobe.skin import ANCHORS, Skin
from surface.fit.wardrobe.styles import Style
from surface.fit.wardrobe.write import hair_fields

UP = np.array([[0.0, 1.0, 0.0]])


def plate(height: float, half: float = 60.0) -> np.ndarray:
    """(n, 3) places 3 mm apart on a level plate over the origin."""
    at = np.arange(-half, half + 1.0, 3.0)
    x, z = np.meshgrid(at, at)
    return np.column_stack([x.ravel(), np.full(x.size, height), z.ravel()])


def test_less_light_gets_below_a_plate_the_nearer_it_is() -> None:
    dark = [float(blocked(np.zeros((1, 3)), UP, plate(height, 18.0))[0]) for height in (6.0, 46.0, 55.0)]
    assert dark[0] > 0.95 > dark[1] > dark[2] == 0.0
    assert blocked(np.zeros((1, 3)), UP, plate(-6.0))[0] == 0.0  # what lies below takes nothing
    beside = blocked(np.array([[21.0, 0.0, 0.0]]), UP, plate(6.0, 18.0))[0]
    assert 0.0 < beside < 0.5 * dark[0]
    assert blocked(np.array([[300.0, 0.0, 0.0]]), UP, plate(6.0))[0] == 0.0


@pytest.fixture(scope="module")
def style(skin: Skin) -> Style:
    return long(skin)


def test_hair_that_hangs_shades_cheek_and_neck_and_not_the_nose(skin: Skin, style: Style) -> None:
    dark = shade(skin, style.hanging)
    x, y, z = skin.points.T
    neck = (np.abs(x) > 45.0) & (np.abs(y + 85.0) < 15.0) & (np.abs(z + 10.0) < 25.0)
    nose = (np.abs(x) < 15.0) & (np.abs(y) < 20.0) & (z > 95.0)
    assert neck.sum() > 20 and nose.sum() > 5
    assert np.median(dark[neck]) > 0.25 and dark[nose].max() < 0.1 and dark.max() <= 1.0


def test_the_picture_of_shade_is_written_beside_the_others(skin: Skin, style: Style) -> None:
    fields = hair_fields(skin, Hairline(skin), patches=style.hanging)
    assert {f"shadow/{name}" for name in ANCHORS} < set(fields)
    dark = fields["shadow/face"]
    assert dark.max() > 0.2 and (dark * (fields["cover/face"] > 0.999)).max() < 1e-3  # hair's own skin is dark as it is


def test_bare_hair_keeps_no_light_out(style: Style) -> None:
    patch = style.hanging[0]
    bare = Patches(patch.points, patch.degrees, patch.grid, patch.fast, patch.strands * (1.0, 1.0, 0.0, 1.0),
                   patch.tint, patch.shade, patch.sway)  # fmt: skip
    assert len(module._solid(patch)) > 1000 and len(module._solid(bare)) == 0


def test_a_surface_of_points_on_a_plane_is_that_plane() -> None:
    x, y = np.meshgrid(50.0 * greville(8, 3), 30.0 * greville(6, 2), indexing="ij")
    found = surface_at(np.stack([x, y, x - y], axis=-1), (3, 2), [np.linspace(0, 1, 5), np.linspace(0, 1, 4)])
    wanted = np.stack(np.meshgrid(np.linspace(0, 50, 5), np.linspace(0, 30, 4), indexing="ij"), axis=-1)
    np.testing.assert_allclose(found[..., :2], wanted, atol=1e-9)
    np.testing.assert_allclose(found[..., 2], wanted[..., 0] - wanted[..., 1], atol=1e-9)


def test_cloth_lies_in_the_shade_of_what_is_over_it(skin: Skin) -> None:
    (cloth,) = garment(skin, NECKS["clothes-crew"])
    open_sky = worn_shade(cloth, plate(400.0))
    covered = worn_shade(cloth, plate(-95.0, 150.0))
    assert not open_sky.any() and covered.max() > 0.3 and covered.shape == cloth.shade.shape


def test_a_collar_and_the_chin_darken_the_shirt_below_them(skin: Skin) -> None:
    collar, trunk = garment(skin, NECKS["clothes-shirt"])
    at = surface_at(trunk.points[0], trunk.degrees, [np.linspace(0.0, 1.0, n) for n in trunk.grid])
    chest = (np.abs(at[..., 0]) < 60.0) & (at[..., 2] > 0.0) & (at[..., 1] < -190.0)
    under = (np.abs(at[..., 0]) < 60.0) & (at[..., 2] > 0.0) & (at[..., 1] > -125.0)
    openness = trunk.strands[0, ..., 3]
    assert chest.sum() > 10 and under.sum() > 10
    assert np.median(openness[under]) < 0.7 * np.median(openness[chest]) and openness[chest].max() > 0.9
    assert collar.strands[0, :, -1, 3].mean() > np.median(openness[under])
