"""How the picture looks, as configuration says it: theme, light, background, camera, who evaluates, kiosk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator

from controller.base.config import Settings
from controller.base.errors import ParameterError

if TYPE_CHECKING:
    from surface.view.scene.camera import Camera  # start-up: the body reads stages and draws nothing
    from surface.view.scene.theme import Colour, Light, Theme  # start-up: the body reads stages and draws nothing

HexColour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Share = Annotated[float, Field(ge=0, le=4)]
CameraName = Literal["front", "three_quarter", "three_quarter_right", "profile", "profile_right"]
_WARM = 0.35  # how much a warmth of 1 adds to red and takes from blue


class LightSettings(Settings):
    """The key light, and how strong each light is beside the theme's own."""

    yaw_deg: Annotated[float | None, Field(ge=-180, le=180)] = None
    pitch_deg: Annotated[float | None, Field(ge=-90, le=90)] = None
    key: Share = 1.0
    fill: Share = 1.0
    rim: Share = 1.0
    ambient: Share = 1.0
    warmth: Annotated[float, Field(ge=-1, le=1)] = 0.0
    follows_camera: Annotated[float | None, Field(ge=0, le=1)] = None


class PictureSettings(Settings):
    """How the picture looks. ``background`` is one colour, or the upper and the lower one of a gradient."""

    quality: Literal["full", "fast"] = "full"
    camera: CameraName = "front"
    theme: Literal["skin", "mask"] = "skin"
    background: HexColour | tuple[HexColour, HexColour] | None = None
    light: LightSettings = LightSettings()
    evaluator: Literal["auto", "cpu", "gpu"] = "auto"
    kiosk: bool = False
    monitor: Annotated[int, Field(ge=0, le=63)] = 0

    @field_validator("camera", mode="before")
    @classmethod
    def _hyphens(cls, name: object) -> object:
        """``three-quarter`` is ``three_quarter``."""
        return name.replace("-", "_") if isinstance(name, str) else name

    def make_theme(self) -> Theme:
        """The theme with this background and these lights."""
        from surface.view.scene.theme import THEMES  # start-up: the body reads stages and draws nothing

        theme, light = THEMES[self.theme], self.light
        lit = replace(
            theme,
            key=_scaled(_aimed(theme.key, light), light.key, light.warmth),
            fill=_scaled(theme.fill, light.fill, 0.0),
            rim=_scaled(theme.rim, light.rim, 0.0),
            sky=_times(theme.sky, light.ambient),
            ground=_times(theme.ground, light.ambient),
            lights_follow=theme.lights_follow if light.follows_camera is None else light.follows_camera,
        )
        if self.background is None:
            return lit
        top, bottom = (self.background, self.background) if isinstance(self.background, str) else self.background
        return replace(lit, background_top=_colour(top), background_bottom=_colour(bottom))

    def make_camera(self) -> Camera:
        """The camera of that name."""
        from surface.view.scene.camera import PRESETS  # start-up: the body reads stages and draws nothing

        return PRESETS[self.camera.replace("_", "-")]()


def checked(settings: PictureSettings, wanted: Mapping[str, object]) -> Any:
    """``settings`` with the values of command-line options; those that are None were not given.

    Raises
    ------
    ParameterError
        naming the option whose value is wrong.
    """
    given = {key: value for key, value in wanted.items() if value is not None}
    try:
        return type(settings).model_validate(settings.model_dump() | given)
    except ValidationError as error:
        fault = error.errors()[0]
        option, said = str(fault["loc"][0]), fault["msg"].removeprefix("Input should be ")
        if option == "background":
            said = "#rrggbb, or #rrggbb,#rrggbb from top to bottom"
        raise ParameterError(f"--{option} {_said(given.get(option))}: must be {said}") from error


def parse_background(words: str | None) -> str | tuple[str, ...] | None:
    """``#rrggbb`` or ``#rrggbb,#rrggbb`` as the key ``background`` wants it."""
    if words is None or "," not in words:
        return words
    return tuple(word.strip() for word in words.split(","))


def _said(value: object) -> str:
    """A value as it stood on the command line."""
    return ",".join(value) if isinstance(value, tuple) else str(value)


def _aimed(light: Light, settings: LightSettings) -> Light:
    yaw = light.yaw_deg if settings.yaw_deg is None else settings.yaw_deg
    return replace(light, yaw_deg=yaw, pitch_deg=light.pitch_deg if settings.pitch_deg is None else settings.pitch_deg)


def _scaled(light: Light, strength: float, warmth: float) -> Light:
    red, green, blue = light.colour
    warm = red * (1 + _WARM * warmth), green, blue * (1 - _WARM * warmth)
    return replace(light, colour=_times(warm, strength))


def _times(colour: Colour, factor: float) -> Colour:
    return colour[0] * factor, colour[1] * factor, colour[2] * factor


def _colour(text: str) -> Colour:
    """``#rrggbb`` as sRGB 0..1."""
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
