"""surface.view.scene.theme"""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from surface.base.errors import ViewError
from surface.view.scene.theme import THEMES, Light, Theme, find_theme


def test_themes_are_found_by_name_or_taken_as_they_are() -> None:
    for name, theme in THEMES.items():
        assert find_theme(name) is theme
    own = Theme(gloss=2.0)
    assert find_theme(own) is own


def test_an_unknown_name_lists_the_themes() -> None:
    with pytest.raises(ViewError, match="there is no theme 'clown'") as caught:
        find_theme("clown")
    assert caught.value.hint == "themes: mask, robot, skin"


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_values_are_within_their_ranges(theme: Theme) -> None:
    for field in fields(theme):
        value = getattr(theme, field.name)
        if isinstance(value, tuple) and field.name != "lamps":
            assert len(value) == 3 and all(0.0 <= x <= 1.0 for x in value), field.name
        if isinstance(value, Light):
            assert -180.0 <= value.yaw_deg <= 180.0 and -90.0 <= value.pitch_deg <= 90.0
            assert min(value.colour) >= 0.0
    assert 0.0 <= theme.lights_follow <= 1.0 and 0.0 <= theme.hair <= 1.0 and 0.0 <= theme.lips <= 1.0


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_the_key_is_brightest_and_the_rim_comes_from_behind(theme: Theme) -> None:
    assert sum(theme.key.colour) > 3 * sum(theme.fill.colour)
    assert theme.key.yaw_deg < 0.0 < theme.fill.yaw_deg, "key from the subject's right, fill from the left"
    assert abs(theme.rim.yaw_deg) > 90.0 > abs(theme.key.yaw_deg)
    assert min(light.pitch_deg for light in (theme.key, theme.fill, theme.rim)) > 0.0
    assert sum(theme.sky) > sum(theme.ground), "more light from above"
    assert sum(theme.background_bottom) > sum(theme.background_top)


def test_skin_is_warm_and_painted_and_a_mask_is_grey_and_bald() -> None:
    skin, mask = THEMES["skin"], THEMES["mask"]
    assert skin.use_painted and not mask.use_painted
    red, green, blue = skin.albedo
    assert red > green > blue and skin.wrap[0] > skin.wrap[1] > skin.wrap[2] and skin.through[0] > 0.3
    assert max(mask.albedo) - min(mask.albedo) < 0.03 and set(mask.wrap) == {0.1} and mask.through == (0, 0, 0)
    assert (skin.hair, mask.hair) == (1.0, 0.0)
    assert (skin.glow, mask.glow > 1.0) == (0.0, True)
    assert mask.seams and mask.lips > 0.0 and not skin.seams and skin.lips == 0.0
    assert (skin.detail, mask.detail) == (1.0, 0.0)
    assert mask.gloss > skin.gloss == 1.0
    assert skin.lights_follow == 0.5


def test_lights_come_from_where_the_pictures_of_reference_have_them() -> None:
    placed = {
        name: [(light.yaw_deg, light.pitch_deg) for light in (theme.key, theme.fill, theme.rim)]
        for name, theme in THEMES.items()
    }
    assert placed == {
        "skin": [(-34.0, 32.0), (48.0, 6.0), (152.0, 28.0)],
        "mask": [(-38.0, 34.0), (52.0, 4.0), (150.0, 24.0)],
        "robot": [(-38.0, 36.0), (52.0, 4.0), (150.0, 24.0)],
    }
    for theme in THEMES.values():
        for light, least, most in ((theme.key, 0.9, 1.2), (theme.fill, 0.1, 0.22), (theme.rim, 0.7, 1.15)):
            assert least <= min(light.colour) and max(light.colour) <= most
    assert (THEMES["mask"].gloss, THEMES["mask"].glow, THEMES["mask"].lips) == (1.5, 2.4, 0.45)


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_hair_is_dark_and_the_sky_is_blue(theme: Theme) -> None:
    assert (theme.lit or max(theme.brow) < 0.1) and max(theme.lash) < 0.1
    assert max(*theme.sky, *theme.ground, *theme.background_top) < 0.3
    assert theme.sky == tuple(sorted(theme.sky)) and max(theme.background_bottom) < 0.5
    assert theme.background_top == tuple(sorted(theme.background_top))
    if not theme.use_painted:
        assert theme.albedo == tuple(sorted(theme.albedo)) and theme.iris[0] < min(theme.iris[1:])


def test_only_a_robot_has_lamps() -> None:
    assert {name for name, theme in THEMES.items() if theme.lit} == {"robot"}
    robot = THEMES["robot"]
    assert robot.glow > THEMES["mask"].glow and max(robot.lamps) > 1.0, "brighter than what is lit"
    assert not robot.use_painted and robot.hair == 0.0 and robot.through == (0, 0, 0)


def lit(times: float, theme: Theme) -> Theme:
    """The theme with all its lights so many times as bright."""

    def times_colour(colour: tuple[float, float, float]) -> tuple[float, float, float]:
        return colour[0] * times, colour[1] * times, colour[2] * times

    lights = {
        n: replace(getattr(theme, n), colour=times_colour(getattr(theme, n).colour)) for n in ("key", "fill", "rim")
    }
    return replace(theme, sky=times_colour(theme.sky), ground=times_colour(theme.ground), **lights)


def test_pupils_are_wide_in_the_dark_and_small_in_bright_light() -> None:
    skin = THEMES["skin"]
    assert skin.pupil == pytest.approx(1.0, abs=1e-3)
    found = [lit(times, skin).pupil for times in (0.0, 0.01, 0.1, 1.0, 10.0, 100.0)]
    assert found == sorted(found, reverse=True) and found[0] < 1.8 and found[-1] > 0.55
    # Moon and Spencer's diameters at 3 and 30 cd/m^2
    assert found[2] == pytest.approx(4.34 / 3.32, rel=0.01)
    assert lit(0.1, THEMES["mask"]).pupil == 1.0
