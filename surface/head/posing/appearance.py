"""Apply a person's appearance (look) to the parts of a head: colours of skin, lips, eyes and brows at every vertex."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.head.model.look import OWN_MELANIN, Colour, Look, skin_albedo, skin_tone
from surface.head.model.parameters import smoothstep
from surface.head.model.texture import HeadTexture
from surface.head.posing.part import HeadPart

Region = tuple[tuple[float, float], tuple[float, float], float]
LIPS_GLOSS = (0.48, 0.74)  # gloss in the painted layers at the rim of the lips, and on them
LIP_FADE = 0.22  # fraction by which lips darken less than skin, on a logarithmic scale
LIP_OPACITY = 0.75  # of a lip colour
PLAIN_GLOSS = 0.3  # of skin that nothing is painted on
#: Where skin shines more or less than elsewhere: centre and reach (x to both sides, y, in distances of the eyes from
#: each other, from the middle between them), and the gloss that is added there. Sebum makes forehead, nose and chin
#: shine; the sides of the face, the jaw and the sockets of the eyes are dry.
SHINE = (
    ((0.0, 0.72), (0.55, 0.30), 0.10),
    ((0.0, -0.20), (0.13, 0.40), 0.16),
    ((0.0, -0.62), (0.26, 0.16), 0.22),
    ((0.60, -0.38), (0.26, 0.20), 0.09),
    ((0.0, -1.62), (0.24, 0.18), 0.08),
    ((0.48, -0.05), (0.30, 0.16), -0.10),
    ((1.05, -0.60), (0.40, 1.10), -0.16),
    ((0.62, -1.30), (0.32, 0.40), -0.12),
)
#: Where skin with much melanin is darker (above 0) or lighter than its tone, as above, in density at a melanin of 1:
#: round eyes and mouth and towards the outline it is darker, where it is stretched over bone lighter.
UNEVEN = (
    ((0.0, 0.74), (0.42, 0.26), -0.07),
    ((0.55, -0.40), (0.28, 0.22), -0.12),
    ((0.0, -0.30), (0.14, 0.40), -0.06),
    ((0.45, -0.02), (0.26, 0.17), 0.16),
    ((0.0, -1.12), (0.48, 0.26), 0.14),
    ((0.95, 0.55), (0.35, 0.55), 0.16),
    ((0.95, -0.90), (0.38, 0.60), 0.12),
)
#: Patches of skin: directions and wave numbers (cycles in the distance of the eyes), whose waves add up.
PATCHES = np.array(((1.9, 1.1, 0.6), (-1.3, 2.3, 0.9), (2.9, -0.7, 1.7), (0.8, 3.3, -1.9), (-3.7, 1.9, 1.2)))
MATT = 0.34  # of its gloss, what skin at a melanin of 1 lacks: beside dark skin the same highlight looks like oil
PATCHY_SHINE, PATCHY_TONE = 0.12, 0.05  # of the gloss, and in density at a melanin of 1


def apply_look(parts: Iterable[HeadPart], look: Look, eyes: Floats) -> None:
    """Modify the colours of freshly loaded parts; applying twice differs from applying once.

    eyes : (2, 3) centres of the eyeballs, mm, relative to which freckles are placed.
    """
    for part in parts:
        if part.material == "skin":
            _colour_skin(part, look)
            _spread_gloss(part, eyes, MATT * (look.melanin or 0.0) ** 2)
            _mottle(part, look, eyes)
            if "fold" in part.attributes:
                part.attributes["fold"] = part.attributes["fold"] * np.array(look.fold, np.float32)
            if look.freckles > 0.0:
                part.attributes["freckles"] = look.freckles * _freckle_density(part, eyes)
        elif part.material == "eye" and look.iris is not None:
            part.attributes["iris"] = _fill_colour(part, look.iris)
            if "texture_rectangle" in part.attributes:
                part.attributes["texture_rectangle"] = np.zeros((len(part.vertices), 4), np.float32)
        elif part.material == "brow":
            if look.brow is not None:
                part.attributes["albedo"] = _fill_colour(part, look.brow)
            part.attributes["strength"] = np.full((len(part.vertices), 1), look.brow_strength, np.float32)


def apply_texture(parts: Iterable[HeadPart], texture: HeadTexture) -> None:
    """Set the places in the texture, ``texture_uv`` (m, 2), of all parts: those that it does not draw lie where it
    leaves the skin as it is. An eye has the rectangle of its front instead, ``texture_rectangle`` (m, 4), alike for all
    of it; without an area where the texture does not draw it."""
    for part in parts:
        if part.material == "eye":
            rows = texture.tiles.get(part.name, np.zeros((1, 4), np.float32))
            part.attributes["texture_rectangle"] = np.tile(rows[0], (len(part.vertices), 1))
            continue
        part.attributes["texture_uv"] = texture.places(part.name, part.uv)


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


def _spread_gloss(part: HeadPart, eyes: Floats, less: float) -> None:
    """Let skin shine by region, in patches, ``less`` by a share; lips and lid rims keep what is painted on them."""
    if "albedo" not in part.attributes:
        return
    given = np.asarray(part.attributes.get("gloss", np.full((len(part.vertices), 1), PLAIN_GLOSS)), np.float64)
    places = _places(part, eyes)
    own = np.clip(PLAIN_GLOSS + _regions(places, SHINE), 0.08, None) * (1.0 + PATCHY_SHINE * _patches(places))
    own *= 1.0 - less
    painted = np.clip((given - PLAIN_GLOSS) / (LIPS_GLOSS[1] - PLAIN_GLOSS), 0.0, 1.0)
    part.attributes["gloss"] = (own[:, None] + painted * (given - own[:, None])).astype(np.float32)


def _mottle(part: HeadPart, look: Look, eyes: Floats) -> None:
    """Make skin uneven by its melanin, which is denser in some regions and patches than in others."""
    if look.melanin is None or "albedo" not in part.attributes:
        return
    places = _places(part, eyes)
    density = look.melanin**2 * (_regions(places, UNEVEN) + PATCHY_TONE * _patches(places[:, ::-1]))[:, None]
    skin = 1.0 - _lip_coverage(part)
    part.attributes["albedo"] = (part.attributes["albedo"] * np.exp(-skin * density)).astype(np.float32)


def _places(part: HeadPart, eyes: Floats) -> Floats:
    """Return vertices (m, 3) in distances of the eyes from each other, from the middle between them."""
    places: Floats = (np.asarray(part.vertices, np.float64) - eyes.mean(axis=0)) / np.linalg.norm(eyes[0] - eyes[1])
    return places


def _regions(places: Floats, regions: Iterable[Region]) -> Floats:
    """Return (m,): the sum of what is added in each of the ``regions`` of a face, on its front."""
    x, y, z = places.T
    front = smoothstep(z, -1.5, -0.3)
    spots = (
        amount * np.exp(-(((np.abs(x) - cx) / wide) ** 2) - ((y - cy) / high) ** 2)
        for (cx, cy), (wide, high), amount in regions
    )
    return np.asarray(front * sum(spots))


def _patches(places: Floats) -> Floats:
    """Return (m,): smooth patches, about -1..1, as large as a few centimetres and less."""
    waves = np.sin(2.0 * np.pi * places @ PATCHES.T + np.arange(len(PATCHES)))
    return np.asarray(waves.sum(axis=1) / np.sqrt(len(PATCHES)))


def _freckle_density(part: HeadPart, eyes: Floats) -> Floats32:
    """Return the density (m, 1) of freckles, 0..1: highest on nose and cheeks, lower on the forehead."""
    x, y, z = _places(part, eyes).T
    front = smoothstep(z, -0.55, 0.1)
    cheeks = np.exp(-(((np.abs(x) - 0.35) / 0.55) ** 4) - ((y + 0.42) / 0.42) ** 2)
    forehead = 0.35 * np.exp(-((x / 0.9) ** 2) - ((y - 0.7) / 0.45) ** 2)
    return np.asarray((front * np.maximum(cheeks, forehead))[:, None], np.float32)
