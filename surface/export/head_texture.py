"""The texture of a head, as exported parts have it: skin shows places of the whole, an eye its own rectangle."""

from __future__ import annotations

import io
from typing import NamedTuple

import numpy as np

from surface.base.arrays import Floats32
from surface.base.pictures import decoded
from surface.head import Head
from surface.head.posing.part import HeadPart
from surface.readers.meshdata import kind_of_picture


class ShownTexture(NamedTuple):
    """What a part shows of its head's texture.

    picture : a whole PNG or JPEG file. uv : (m, 2) places in it, v up. tone : linear RGB of a texel that leaves the
    skin as it is painted; None for an eye, whose colours are all in the picture.
    """

    picture: bytes
    uv: Floats32
    tone: tuple[float, float, float] | None

    @property
    def mime(self) -> str:
        """The picture's kind, as ``image/png``."""
        return kind_of_picture(self.picture)


def texture_of(head: Head, part: HeadPart) -> ShownTexture | None:
    """Return what a part shows of its head's texture; None where it has none of its own, or, of an eye, where Pillow is
    missing or the picture cannot be read."""
    texture = head.texture
    if texture is None:
        return None
    if part.material == "eye":
        shown = part.attributes.get("texture_rectangle")
        return _eye(texture.picture, part) if shown is not None and shown.any() else None
    at = part.attributes.get("texture_uv")
    if at is None or part.name not in texture.tiles:
        return None
    return ShownTexture(texture.picture, (at * [1, -1] + [0, 1]).astype(np.float32), texture.colour)


def _eye(picture: bytes, part: HeadPart) -> ShownTexture | None:
    """The rectangle of an eye, and its vertices as they lie in it, at rest and seen from the front."""
    try:
        image = decoded(picture).convert("RGB")
    except (ImportError, ValueError):
        return None
    rectangle = np.asarray(part.attributes["texture_rectangle"][0], float) * (*image.size, *image.size)
    left, top, right, bottom = np.rint(rectangle).astype(int).tolist()
    out = io.BytesIO()
    image.crop((left, top, right, bottom)).save(out, "PNG", optimize=True)
    rest = part.mesh.vertices
    local = (rest - 0.5 * (rest.min(axis=0) + rest.max(axis=0)))[:, :2]
    across = np.abs(local).max()
    return ShownTexture(out.getvalue(), (0.5 + 0.5 * local / across).astype(np.float32), None)


def tinted(albedo: Floats32, shown: ShownTexture | None) -> Floats32:
    """Return colours (m, 3) by which a part's texture is multiplied, so that what is drawn is as ``albedo`` says."""
    if shown is None or shown.tone is None:
        return albedo
    ratio: Floats32 = (albedo / np.array(shown.tone)).astype(np.float32)
    return ratio
