"""Themes: colours and lights of the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from surface.base.errors import ViewError

Colour = tuple[float, float, float]
_LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear RGB, ITU-R BT.709
_OWN_LIGHT = 1.4042  # luminance of the theme "skin" at the eyes, its key and fill and half of sky and ground
_ROOM = 30.0  # cd/m^2 of that light: a lit room
_WIDEST = 1.77  # two thirds of the iris


@dataclass(frozen=True)
class Light:
    """A directional light.

    yaw_deg, pitch_deg : where it comes from, seen from the face; yaw + = subject's left, pitch + = above.
    colour : (3,) linear RGB times intensity.
    """

    yaw_deg: float
    pitch_deg: float
    colour: Colour


@dataclass(frozen=True)
class Theme:
    """Colours and lights of a picture; linear RGB unless stated otherwise.

    albedo : skin of heads without a painted albedo.
    use_painted : whether the head's own albedo is used.
    wrap : how far light bends around the terminator per channel, 0..1; red far, blue little, for skin.
    gloss : scale of the skin's highlights.
    iris, sclera, brow, lash : colours.
    key, fill, rim : the three lights.
    sky, ground : the ambient light's upper and lower colour.
    background_top, background_bottom : sRGB colours of the gradient behind the head.
    through : colour of light that comes through thin skin, times its strength.
    glow : emitted light of the iris, times its colour.
    hair : opacity of lashes and brows, 0..1.
    lips : how much darker a mask's lips are, 0..1.
    seams : whether the shell shows the gaps between its plates.
    lamps : light of a robot's lips, brows and display in the mouth; (0, 0, 0) for a face without lamps, whose shell has
        one colour.
    lights_follow : 0 keeps the lights with the world, 1 turns them with the camera.
    """

    albedo: Colour = (0.60, 0.37, 0.28)
    use_painted: bool = True
    wrap: Colour = (0.42, 0.20, 0.14)
    gloss: float = 1.0
    detail: float = 1.0
    iris: Colour = (0.080, 0.125, 0.150)
    sclera: Colour = (0.68, 0.63, 0.59)
    brow: Colour = (0.085, 0.052, 0.034)
    lash: Colour = (0.022, 0.015, 0.012)
    key: Light = Light(-34.0, 32.0, (1.18, 1.06, 0.92))
    fill: Light = Light(48.0, 6.0, (0.16, 0.18, 0.215))
    rim: Light = Light(152.0, 28.0, (0.80, 0.84, 0.94))
    sky: Colour = (0.20, 0.21, 0.235)
    ground: Colour = (0.115, 0.085, 0.072)
    background_top: Colour = (0.20, 0.23, 0.27)
    background_bottom: Colour = (0.42, 0.44, 0.46)
    through: Colour = (0.52, 0.085, 0.035)
    glow: float = 0.0
    hair: float = 1.0
    lips: float = 0.0
    seams: bool = False
    lamps: Colour = (0.0, 0.0, 0.0)
    lights_follow: float = 0.5

    @property
    def lit(self) -> bool:
        """Whether the face has lamps."""
        return any(self.lamps)

    @property
    def dressed(self) -> bool:
        """Whether accessories of a head are drawn: not on a mask or a robot, which show the face alone."""
        return self.use_painted

    @property
    def pupil(self) -> float:
        """How wide pupils are in this light, in those of the theme "skin", for which a room's luminance is assumed; a
        mask's stay as they are. Moon and Spencer, "On the Stiles-Crawford effect", J. Opt. Soc. Am. 34 (1944)."""
        if not self.use_painted:
            return 1.0
        colours = np.array([self.key.colour, self.fill.colour, self.sky, self.ground]) * [[1.0], [1.0], [0.5], [0.5]]
        light = float((colours @ _LUMINANCE).sum()) / _OWN_LIGHT
        return min(_diameter_mm(_ROOM * max(light, 1e-6)) / _diameter_mm(_ROOM), _WIDEST)


def _diameter_mm(luminance: float) -> float:
    """Of a pupil at a luminance, cd/m^2."""
    return 4.9 - 3.0 * math.tanh(0.4 * math.log10(luminance))


THEMES: dict[str, Theme] = {
    "skin": Theme(),
    "mask": Theme(
        albedo=(0.62, 0.625, 0.64),
        use_painted=False,
        wrap=(0.10, 0.10, 0.10),
        gloss=1.5,
        detail=0.0,
        iris=(0.05, 0.55, 0.75),
        sclera=(0.012, 0.014, 0.018),
        brow=(0.030, 0.034, 0.042),
        lash=(0.020, 0.022, 0.026),
        key=Light(-38.0, 34.0, (1.02, 1.02, 1.04)),
        fill=Light(52.0, 4.0, (0.10, 0.14, 0.19)),
        rim=Light(150.0, 24.0, (0.75, 0.95, 1.10)),
        sky=(0.15, 0.17, 0.20),
        ground=(0.06, 0.07, 0.085),
        through=(0.0, 0.0, 0.0),
        glow=2.4,
        hair=0.0,
        lips=0.45,
        seams=True,
        background_top=(0.08, 0.10, 0.13),
        background_bottom=(0.20, 0.23, 0.27),
    ),
    "robot": Theme(
        albedo=(0.66, 0.67, 0.68),
        use_painted=False,
        wrap=(0.06, 0.06, 0.06),
        gloss=2.2,
        detail=0.0,
        iris=(0.16, 0.80, 0.62),
        sclera=(0.004, 0.005, 0.006),
        brow=(0.16, 0.80, 0.62),
        key=Light(-38.0, 36.0, (1.00, 0.98, 0.95)),
        fill=Light(52.0, 4.0, (0.10, 0.13, 0.16)),
        rim=Light(150.0, 24.0, (0.70, 1.00, 0.95)),
        sky=(0.16, 0.17, 0.19),
        ground=(0.06, 0.065, 0.075),
        through=(0.0, 0.0, 0.0),
        glow=4.0,
        hair=0.0,
        lamps=(0.42, 2.1, 1.65),
        background_top=(0.055, 0.065, 0.075),
        background_bottom=(0.15, 0.17, 0.185),
    ),
}


def find_theme(theme: str | Theme) -> Theme:
    """The theme of that name, or `theme` itself; ViewError for an unknown name."""
    if isinstance(theme, Theme):
        return theme
    if theme not in THEMES:
        raise ViewError(f"there is no theme {theme!r}", hint=f"themes: {', '.join(sorted(THEMES))}")
    return THEMES[theme]
