"""Apply a person's appearance (look) to the parts of a head: colours of skin, lips, eyes and brows at every vertex."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.head.model.look import OWN_MELANIN, Colour, Look, skin_albedo, skin_tone
from surface.head.model.parameters import smoothstep
from surface.head.posing.part import HeadPart

LIPS_GLOSS = (0.48, 0.74)  # gloss in the painted layers at the rim of the lips, and on them
LIP_FADE = 0.22  # fraction by which lips darken less than skin, on a logarithmic scale
LIP_OPACITY = 0.75  # of a lip colour


def apply_look(parts: Iterable[HeadPart], look: Look, eyes: Floats) -> None:
    """Modify the colours of freshly loaded parts; applying twice differs from applying once.

    eyes : (2, 3) centres of the eyeballs, mm, relative to which freckles are placed.
    """
    for part in parts:
        if part.material == "skin":
            _colour_skin(part, look)
            if look.freckles > 0.0:
                part.attributes["freckles"] = look.freckles * _freckle_density(part, eyes)
        elif part.material == "eye" and look.iris is not None:
            part.attributes["iris"] = _fill_colour(part, look.iris)
        elif part.material == "brow":
            if look.brow is not None:
                part.attributes["albedo"] = _fill_colour(part, look.brow)
            part.attributes["strength"] = np.full((len(part.vertices), 1), look.brow_strength, np.float32)


def _fill_colour(part: HeadPart, colour: Colour) -> Floats32:
    """Return one colour for all vertices, (m, 3)."""
    return np.tile(np.asarray(colour, np.float32), (len(part.vertices), 1))


def _colour_skin(part: HeadPart, look: Look) -> None:
    """Give the skin another tone; the darker it is, the less light passes through where it is thin."""
    given = part.attributes.get("albedo")
    if given is None:
        return
    lips = _lip_coverage(part)
    albedo = np.asarray(given, np.float64)
    if look.melanin is not None:
        redness = look.redness + (1.0 - look.redness) * lips  # lips have their own colour
        toned = skin_albedo(albedo, look.melanin, look.blood, redness)
        lip_ratio = np.exp(LIP_FADE * np.log(albedo / toned))  # lips have less melanin
        albedo = toned * (1.0 + lips * (lip_ratio - 1.0))
        if "thin" in part.attributes:
            translucency = float(skin_tone(look.melanin)[0] / skin_tone(OWN_MELANIN)[0])
            part.attributes["thin"] = part.attributes["thin"] * np.float32(min(translucency, 1.0))
    if look.lips is not None:
        albedo = albedo + LIP_OPACITY * lips * (np.asarray(look.lips) - albedo)
    part.attributes["albedo"] = albedo.astype(np.float32)


def _lip_coverage(part: HeadPart) -> Floats:
    """Return the fraction (m, 1) of each vertex that is lip: as painted, else where the paint is glossy."""
    painted = part.attributes.get("lips")
    if painted is not None:
        return np.asarray(painted[:, :1], np.float64)
    gloss = part.attributes.get("gloss")
    if gloss is None:
        return np.zeros((len(part.vertices), 1))
    return smoothstep(np.asarray(gloss[:, :1], np.float64), *LIPS_GLOSS)


def _freckle_density(part: HeadPart, eyes: Floats) -> Floats32:
    """Return the density (m, 1) of freckles, 0..1: highest on nose and cheeks, lower on the forehead."""
    middle, apart = eyes.mean(axis=0), float(np.linalg.norm(eyes[0] - eyes[1]))
    x, y, z = ((np.asarray(part.vertices, np.float64) - middle) / apart).T
    front = smoothstep(z, -0.55, 0.1)
    cheeks = np.exp(-(((np.abs(x) - 0.35) / 0.55) ** 4) - ((y + 0.42) / 0.42) ** 2)
    forehead = 0.35 * np.exp(-((x / 0.9) ** 2) - ((y - 0.7) / 0.45) ** 2)
    return np.asarray((front * np.maximum(cheeks, forehead))[:, None], np.float32)
