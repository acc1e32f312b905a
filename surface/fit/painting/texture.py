"""The texture of a head: pictures of its skin and of its eyes beside each other in one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.fit.eyes.colours import skin_colour
from surface.fit.eyes.search import Eyes
from surface.fit.painting.eyes import eye_pictures
from surface.fit.painting.skin import SIDES, SkinIslands, Square, skin_squares
from surface.fit.source.mesh import FitMesh
from surface.fit.source.pictures import encoded
from surface.head.model.texture import HeadTexture
from surface.readers.meshdata import srgb

MOST = 4096  # texels of a side of the whole
STRIP = 16  # rows of texels above the others that have the skin's own colour
EYES = "eye_left", "eye_right"
PLAIN = 0.5, 0.5, 0.5  # linear RGB of skin of which nothing is known


def head_texture(mesh: FitMesh, eyes: Eyes, parts: Sequence[SkinIslands]) -> tuple[HeadTexture | None, list[str]]:
    """The texture of a head, None where its mesh has none that can be read, as without Pillow; and notes on what it
    shows.

    parts : of its skin, the face first.
    """
    if not any(m is not None and m.texture for m in mesh.materials):
        return None, []
    found = skin_colour(mesh, eyes.skin)
    tone = np.array(PLAIN) if found is None else found
    fronts = {name: [_front(p)] for name, p in zip(EYES, eye_pictures(mesh, eyes), strict=True) if p is not None}
    for largest in SIDES:
        skin = skin_squares(mesh, parts, tone, largest) if found is not None else {}
        squares = skin | fronts
        every = [square for own in squares.values() for square in own]
        if not every or _places([len(square.colour) for square in every])[1] <= MOST:
            break
    else:
        return None, [f"textures not drawn: skin in {len(every)} pieces is too much for one of {MOST} pixels"]
    if not every:
        return None, []
    what = " and ".join(["skin"] * bool(skin) + ["eyes"] * bool(fronts))
    return joined(squares, tone), [f"{what} drawn with the mesh's own texture"]


def _front(picture: Floats) -> Square:
    """An eye's picture, whose (u, v) run from its left and top to its right and bottom."""
    return Square(picture, float(len(picture)), np.zeros(2))


def joined(squares: Mapping[str, Sequence[Square]], tone: Floats) -> HeadTexture:
    """The texture of squares by part. tone : (3,) linear RGB of a texel that leaves the skin as it is painted."""
    picture, rectangles = _laid_out([square for own in squares.values() for square in own], tone)
    ends = np.cumsum([0, *map(len, squares.values())])
    tiles = {name: rectangles[a:b] for name, a, b in zip(squares, ends, ends[1:], strict=False)}
    red, green, blue = np.asarray(tone, float).tolist()
    return HeadTexture(encoded(np.rint(255.0 * srgb(picture)).astype(np.uint8)), (red, green, blue), tiles)


def _laid_out(squares: Sequence[Square], tone: Floats) -> tuple[Floats, Floats32]:
    """A picture (h, w, 3) of all squares, in columns below a strip of ``tone``; and the rectangle (k, 4) of the
    tile of each."""
    places, width, height = _places([len(square.colour) for square in squares])
    picture = np.tile(np.clip(tone, 0.0, 1.0), (height, width, 1))
    rectangles = np.zeros((len(squares), 4), np.float32)
    for k, ((x, y), square) in enumerate(zip(places, squares, strict=True)):
        side = len(square.colour)
        picture[y : y + side, x : x + side] = square.colour
        first = square.origin + np.array([x, y])
        rectangles[k] = np.concatenate([first, first + square.scale]) / [width, height, width, height]
    return np.clip(picture, 0.0, 1.0), rectangles


def _places(sides: Sequence[int]) -> tuple[list[tuple[int, int]], int, int]:
    """Left and top of each square, by its side, and the width and height of the picture that holds them, which are
    equal, so that no other program finds its texture coordinates stretched."""
    height = max(sides)
    places, x, y, wide = list[tuple[int, int]](), 0, 0, 0
    for side in sides:
        if y + side > height or side > wide > 0:
            x, y, wide = x + wide, 0, 0
        places.append((x, STRIP + y))
        y, wide = y + side, max(wide, side)
    whole = max(x + wide, STRIP + height)
    return places, whole, whole
