"""Colours and lights of the picture: data, one :class:`Theme` per look."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Light:
    """A directional light.

    Parameters
    ----------
    yaw_deg, pitch_deg : where it comes from, seen from the face; yaw + = subject's left, pitch + = above.
    colour : (3,) linear RGB times intensity.
    """

    yaw_deg: float
    pitch_deg: float
    colour: Colour


@dataclass(frozen=True)
class Theme:
    """One look. Colours are linear RGB unless said otherwise.

    Parameters
    ----------
    albedo : skin where the head paints none.
    use_painted : whether the head's own albedo is used.
    wrap : how far light bends round the terminator per channel, 0..1; red far, blue little, for skin.
    gloss : scale of the skin's highlights.
    iris, sclera, brow, lash : colours.
    key, fill, rim : the three lights.
    sky, ground : the ambient light's upper and lower colour.
    background_top, background_bottom : sRGB colours of the gradient behind the head.
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
    lights_follow: float = 0.5


THEMES: dict[str, Theme] = {
    "skin": Theme(),
    "mask": Theme(
        albedo=(0.50, 0.51, 0.53),
        use_painted=False,
        wrap=(0.12, 0.12, 0.12),
        gloss=1.8,
        detail=0.0,
        iris=(0.025, 0.16, 0.22),
        sclera=(0.50, 0.52, 0.55),
        brow=(0.050, 0.055, 0.065),
        lash=(0.030, 0.032, 0.038),
        background_top=(0.10, 0.12, 0.15),
        background_bottom=(0.27, 0.30, 0.34),
    ),
}
