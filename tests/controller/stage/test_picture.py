"""What ``[face]`` and command lines say of the picture's look."""

from __future__ import annotations

from typing import get_args

import pytest
from pydantic import ValidationError

from controller.base.errors import ParameterError
from controller.stage.picture import CameraName, LightSettings, PictureSettings, parse_background, with_options
from surface.view.scene.camera import PRESETS
from surface.view.scene.theme import THEMES


@pytest.mark.parametrize("theme", THEMES)
def test_without_words_a_theme_is_as_it_is(theme: str) -> None:
    assert with_options(PictureSettings(), {"theme": theme}).make_theme() == THEMES[theme]


def test_background_and_lights() -> None:
    settings = PictureSettings(
        background="#ff0080",
        light=LightSettings(yaw_deg=50, key=2.0, fill=0.0, warmth=1.0, ambient=0.5, follows_camera=1.0),
    )
    theme, own = settings.make_theme(), THEMES["skin"]
    assert theme.background_top == theme.background_bottom == pytest.approx((1.0, 0.0, 128 / 255))
    assert (theme.key.yaw_deg, theme.key.pitch_deg, theme.lights_follow) == (50, own.key.pitch_deg, 1.0)
    assert theme.key.colour[0] > 2 * own.key.colour[0]
    assert theme.key.colour[1] == pytest.approx(2 * own.key.colour[1])
    assert theme.key.colour[2] < 2 * own.key.colour[2]
    assert theme.fill.colour == (0, 0, 0)
    assert theme.rim == own.rim
    assert theme.sky == pytest.approx([0.5 * x for x in own.sky])
    gradient = PictureSettings(background=("#000000", "#ffffff")).make_theme()
    assert (gradient.background_top, gradient.background_bottom) == ((0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize("name", PRESETS)
def test_every_camera_can_be_named(name: str) -> None:
    for word in (name, name.replace("-", "_")):
        assert with_options(PictureSettings(), {"camera": word}).make_camera() == PRESETS[name]()


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({"theme": "clown"}, "--theme clown: must be 'skin', 'mask' or 'robot'"),
        ({"camera": "above"}, "--camera above: must be 'front'"),
        ({"background": "red"}, "--background red: must be #rrggbb"),
        ({"background": ("#000000", "x")}, "--background #000000,x: must be"),
        ({"monitor": -1}, "--monitor -1: must be greater than or equal to 0"),
        ({"evaluator": "abacus"}, "--evaluator abacus: must be 'auto', 'cpu' or 'gpu'"),
    ],
)
def test_a_wrong_word_is_told(wanted: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        with_options(PictureSettings(), wanted)
    assert message in str(caught.value)


def test_backgrounds_on_the_command_line() -> None:
    assert parse_background(None) is None
    assert parse_background("#102030") == "#102030"
    assert parse_background("#102030, #405060") == ("#102030", "#405060")


def test_the_usual_picture() -> None:
    settings = PictureSettings()
    assert settings.model_dump() == {
        "quality": "full", "camera": "front", "theme": "skin", "background": None, "evaluator": "auto",
        "kiosk": False, "monitor": 0, "person": "",
        "light": {"yaw_deg": None, "pitch_deg": None, "key": 1.0, "fill": 1.0, "rim": 1.0, "ambient": 1.0,
                  "warmth": 0.0, "follows_camera": None},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("yaw_deg", -180, 180), ("pitch_deg", -90, 90), ("warmth", -1, 1), ("follows_camera", 0, 1)],
)
def test_lights_have_limits(name: str, low: float, high: float) -> None:
    for value in (low, high):
        assert getattr(LightSettings.model_validate({name: value}), name) == value
    for value in (low - 0.01, high + 0.01):
        with pytest.raises(ValidationError):
            LightSettings.model_validate({name: value})


def test_monitors_have_limits() -> None:
    assert [PictureSettings(monitor=number).monitor for number in (0, 63)] == [0, 63]
    for number in (-1, 64):
        with pytest.raises(ValidationError):
            PictureSettings(monitor=number)


def test_warmth_and_strength_are_those_of_the_colours() -> None:
    own = THEMES["skin"]
    red, green, blue = own.key.colour
    for warmth in (1.0, -1.0):
        key = PictureSettings(light=LightSettings(warmth=warmth, key=0.5)).make_theme().key
        assert key.colour == pytest.approx(
            (0.5 * red * (1 + 0.35 * warmth), 0.5 * green, 0.5 * blue * (1 - 0.35 * warmth))
        )
    theme = PictureSettings(light=LightSettings(pitch_deg=12, rim=2.0, ambient=0.25, fill=0.5)).make_theme()
    assert (theme.key.pitch_deg, theme.key.yaw_deg, theme.lights_follow) == (12, own.key.yaw_deg, own.lights_follow)
    assert theme.rim.colour == pytest.approx([2 * x for x in own.rim.colour])
    assert theme.fill.colour == pytest.approx([0.5 * x for x in own.fill.colour])
    assert theme.ground == pytest.approx([0.25 * x for x in own.ground])
    theme = PictureSettings(background=("#336699", "#0a141e")).make_theme()
    assert theme.background_top == pytest.approx((0x33 / 255, 0x66 / 255, 0x99 / 255))
    assert theme.background_bottom == pytest.approx((10 / 255, 20 / 255, 30 / 255))


def test_cameras_are_named_with_hyphens_and_found_with_underscores_too() -> None:
    assert PictureSettings.model_validate({"camera": "three_quarter"}).camera == "three-quarter"
    assert {*get_args(CameraName)} == {*PRESETS}
    with pytest.raises(ValidationError, match="three-quarter-right"):
        PictureSettings.model_validate({"camera": "left"})
