"""Settings of the picture: theme, lights, background, camera, evaluator of the vertices, full screen (kiosk)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator

from controller.base.config import Settings
from controller.base.errors import ParameterError
from controller.stage.persons import HexColour, PersonName

if TYPE_CHECKING:
    from surface.view.scene.camera import Camera  # imported lazily: the body draws nothing
    from surface.view.scene.theme import Colour, Theme  # imported lazily: the body draws nothing

Strength = Annotated[float, Field(ge=0, le=4)]
CameraName = Literal["front", "three-quarter", "three-quarter-right", "profile", "profile-right"]
_WARMTH_FACTOR = 0.35  # relative change of red and blue by a warmth of 1


class LightSettings(Settings):
    """The direction of the key light, and the strength of each light relative to the theme's."""

    yaw_deg: Annotated[float | None, Field(ge=-180, le=180)] = None
    pitch_deg: Annotated[float | None, Field(ge=-90, le=90)] = None
    key: Strength = 1.0
    fill: Strength = 1.0
    rim: Strength = 1.0
    ambient: Strength = 1.0
    warmth: Annotated[float, Field(ge=-1, le=1)] = 0.0
    follows_camera: Annotated[float | None, Field(ge=0, le=1)] = None


class PictureSettings(Settings):
    """Settings of the picture.

    background : one colour, or the upper and the lower one of a gradient. person : a name, or several with weights.
    """

    quality: Literal["full", "fast", "auto"] = "full"
    camera: CameraName = "front"
    theme: Literal["skin", "mask", "robot"] = "skin"
    person: PersonName = ""
    background: HexColour | tuple[HexColour, HexColour] | None = None
    light: LightSettings = LightSettings()
    evaluator: Literal["auto", "cpu", "gpu"] = "auto"
    kiosk: bool = False
    monitor: Annotated[int, Field(ge=0, le=63)] = 0

    @field_validator("camera", mode="before")
    @classmethod
    def _replace_underscores(cls, name: object) -> object:
        """Accept ``three_quarter`` for ``three-quarter``."""
        return name.replace("_", "-") if isinstance(name, str) else name

    def make_theme(self) -> Theme:
        """Return the theme with this background and these lights."""
        from surface.view.scene.theme import THEMES  # imported lazily: the body draws nothing

        theme, light = THEMES[self.theme], self.light
        red, green, blue = theme.key.colour
        warmth = _WARMTH_FACTOR * light.warmth
        key_colour = red * (1 + warmth), green, blue * (1 - warmth)
        angles = {"yaw_deg": light.yaw_deg, "pitch_deg": light.pitch_deg}
        direction = {key: value for key, value in angles.items() if value is not None}
        theme = replace(
            theme,
            key=replace(theme.key, colour=_scale(key_colour, light.key), **direction),
            fill=replace(theme.fill, colour=_scale(theme.fill.colour, light.fill)),
            rim=replace(theme.rim, colour=_scale(theme.rim.colour, light.rim)),
            sky=_scale(theme.sky, light.ambient),
            ground=_scale(theme.ground, light.ambient),
            lights_follow=theme.lights_follow if light.follows_camera is None else light.follows_camera,
        )
        if self.background is None:
            return theme
        top, bottom = (self.background, self.background) if isinstance(self.background, str) else self.background
        return replace(theme, background_top=_parse_colour(top), background_bottom=_parse_colour(bottom))

    @property
    def dressed(self) -> bool:
        """Whether a person wears hair and clothes, which only the theme skin shows."""
        return self.theme == "skin"

    @property
    def still_quality(self) -> str:
        """The quality of a still picture, for which "auto" means "full"."""
        return "full" if self.quality == "auto" else self.quality

    def make_camera(self) -> Camera:
        """Return the camera called ``camera``."""
        from surface.view.scene.camera import PRESETS  # imported lazily: the body draws nothing

        return PRESETS[self.camera]()


def with_options(settings: PictureSettings, wanted: Mapping[str, object]) -> Any:
    """Return ``settings`` with the values of command-line options that are not None.

    Raises ParameterError: the value of an option is wrong; names the option.
    """
    given = {key: value for key, value in wanted.items() if value is not None}
    try:
        return type(settings).model_validate(settings.model_dump() | given)
    except ValidationError as error:
        fault = error.errors()[0]
        option, expected = str(fault["loc"][0]), fault["msg"].removeprefix("Input should be ")
        value = given.get(option)
        if option == "background":
            expected = "#rrggbb, or #rrggbb,#rrggbb from top to bottom"
            value = ",".join(value) if isinstance(value, tuple) else value
        raise ParameterError(f"--{option} {value}: must be {expected}") from error


def parse_background(text: str | None) -> str | tuple[str, ...] | None:
    """Convert ``#rrggbb`` or ``#rrggbb,#rrggbb`` to a value of the key ``background``."""
    if text is None or "," not in text:
        return text
    return tuple(word.strip() for word in text.split(","))


def _scale(colour: Colour, factor: float) -> Colour:
    return colour[0] * factor, colour[1] * factor, colour[2] * factor


def _parse_colour(text: str) -> Colour:
    """Convert ``#rrggbb`` to sRGB 0..1."""
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
