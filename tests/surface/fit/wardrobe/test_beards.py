"""surface.fit.wardrobe.beards: where beards grow, and shells over the skin there."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe import beards as module
from surface.fit.wardrobe.beards import BEARDS, field, garment, inside
from surface.fit.wardrobe.patches import BARE, Patches
from surface.fit.wardrobe.skin import Skin
from tests.surface.fit.wardrobe.invariants import asymmetry, check_patches, heights, points_of
from tests.surface.fit.wardrobe.made_skin import lower_face


def test_beards_grow_on_chin_jaw_and_upper_lip_and_not_on_the_lips_or_above() -> None:
    grows = np.array([[0.0, -75, 95], [45, -55, 70], [-45, -55, 70], [0, -19, 105]])
    bare = np.array([[0.0, -33, 100], [0, 20, 110], [30, 60, 90], [0, -110, 60], [0, -40, -80], [55, 10, 75]])
    assert (inside(grows) > 0.0).all() and (inside(bare) < 0.0).all()
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-80, 80, 200), rng.uniform(-110, 40, 200), rng.uniform(25, 110, 200)])
    np.testing.assert_allclose(inside(places), inside(places * [-1.0, 1.0, 1.0]))  # alike on both sides


def test_how_far_inside_grows_by_the_millimetres_from_the_nearest_line() -> None:
    """In front, between the line of the chin and the lips."""
    y = np.linspace(-93.0, -86.0, 15)
    column = np.column_stack([0 * y, y, np.full(15, 90.0)])
    np.testing.assert_allclose(np.diff(inside(column)), np.diff(y))


@pytest.fixture(scope="module")
def face() -> Skin:
    """The lower half of a face, whose samples take less time."""
    return lower_face()


@pytest.fixture(scope="module")
def made(face: Skin) -> dict[str, list[Patches]]:
    """Patches of every beard."""
    return {name: garment(face, beard) for name, beard in BEARDS.items()}


@pytest.fixture(params=BEARDS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_there_are_two_patches_of_each_shell_outside_of_the_skin(
    name: str, face: Skin, made: dict[str, list[Patches]]
) -> None:
    beard, patches = BEARDS[name], made[name]
    check_patches(patches)
    assert len(patches) == 2 * len(beard.shells)
    over = heights(face, points_of(patches))
    # where the ears of this head are, which are left out of its samples, a few lie below them
    assert np.quantile(over, 0.1) > -1.5 and over.max() < 2.0 * (beard.thick + beard.chin) + 6.0
    assert all(patch.follow == 1.0 and not patch.sway.any() for patch in patches)
    assert asymmetry(points_of(patches), 0.8) < 6.0


def test_outer_shells_lie_over_inner_ones(name: str, face: Skin, made: dict[str, list[Patches]]) -> None:
    for outer, inner in zip(made[name][:-2], made[name][2:], strict=True):
        over = [heights(face, patch.points.reshape(-1, 3)).mean() for patch in (outer, inner)]
        assert over[0] > over[1]


def test_the_full_beard_is_thicker_than_the_short_one(face: Skin, made: dict[str, list[Patches]]) -> None:
    full, short = (heights(face, points_of(made[name])).max() for name in ("beard-full", "beard-short"))
    assert full > short + 2.0


def test_skin_between_hairs_has_the_beard_s_colour_where_it_grows(name: str, skin: Skin) -> None:
    cover, beard = field(skin, BEARDS[name]), BEARDS[name]
    assert cover.shape == (len(skin.points),) and not cover[skin.part != 0].any()
    own = skin.part == 0
    deep = inside(skin.points)
    np.testing.assert_allclose(cover[own & (deep > module._FIELD_MM[1])], beard.cover)
    assert not cover[deep < module._FIELD_MM[0]].any() and cover.max() <= beard.cover


def test_values_between_the_places_of_a_grid_are_straight() -> None:
    grid = np.random.default_rng(2).normal(size=(4, 5, 3))
    np.testing.assert_allclose(module._between(grid, np.arange(4.0), np.arange(5.0)), grid)
    found = module._between(grid, np.array([1.25]), np.array([3.5]))[0, 0]
    rows = 0.75 * grid[1] + 0.25 * grid[2]
    np.testing.assert_allclose(found, 0.5 * rows[3] + 0.5 * rows[4])


def test_a_level_ray_leaves_the_skin_where_it_is(skin: Skin) -> None:
    for angle in (-0.8, 0.0, 0.5):
        direction = np.array([np.sin(angle), 0.0, np.cos(angle)])
        found = module._outermost(skin, -70.0, direction)
        assert found[1] == -70.0
        off = found - [0.0, -70.0, 20.0]
        np.testing.assert_allclose(off, (off @ direction) * direction, atol=1e-9)
        assert abs(heights(skin, found[None])[0]) < 4.0


def test_hairs_thin_out_to_nothing_at_every_edge_that_is_seen(made: dict[str, list[Patches]], name: str) -> None:
    """The border of a shell is no edge: the upper one on the cheeks, and all of the one over the lip."""
    for main, lip in zip(made[name][::2], made[name][1::2], strict=True):
        cover = main.strands[0, ..., 2]
        assert (cover[:, 0] < 0.1).all() and cover.max() > 0.3
        over = lip.strands[0, ..., 2]
        assert over[[0, -1]].max() == pytest.approx(-BARE) and over[:, -1].max() < 0.1


def test_a_moustache_grows_in_softly_and_shows_the_hollow_below_the_nose(
    made: dict[str, list[Patches]], name: str
) -> None:
    """Else it is a strip stuck on: its borders take more than one row of vertices, its ends more than one column."""
    for lip in made[name][1::2]:
        cover = lip.strands[0, ..., 2]
        middle, half = len(cover) // 2, cover.max(axis=1)
        assert (cover[:, 0] < cover[:, 1] - 0.05).sum() > 10 and (cover[:, 1] < cover[:, 2] - 0.05)[4:-4].all()
        assert (cover[4:-4, -2] < cover[4:-4, -3] - 0.02).all()
        assert (np.diff(half[:5]) > 0.04).all() and (np.diff(half[-5:]) < -0.04).all()
        assert half[middle] < 0.9 * half[middle - 4 : middle + 5].max()


def test_a_moustache_ends_at_the_upper_lip_and_beside_the_mouth_in_the_beard(
    made: dict[str, list[Patches]], name: str
) -> None:
    for main, lip in zip(made[name][::2], made[name][1::2], strict=True):
        x, y, _ = lip.points[0, :, -1].T
        assert y[len(y) // 2] == pytest.approx(module._LIPS[1] + 8.0, abs=1.5)
        assert (y[np.abs(x) < 20.0] > module._LIPS[1]).all(), "it hangs over the mouth"
        assert (y[np.abs(x) > 34.0] < module._LIPS[1] - 8.0).all() and np.abs(x).max() > 40.0
        assert (np.diff(lip.points[0, :, :, 1]) < 0.0).all()
        beside = np.abs(main.points[0, :, 0, 0]) < 45.0, np.abs(main.points[0, :, 0, 0]) > 30.0
        assert (main.points[0, beside[0] & beside[1], 0, 1] > module._LIPS[1] + 8.0).all(), "there is a gap"


def test_hairs_are_short_where_they_come_out_of_the_skin(made: dict[str, list[Patches]], name: str) -> None:
    along = np.diff(made[name][0].strands[0, 20, :, 1])
    assert along[0] > 3.0 * along[-1] > 0.0
