"""Textures of accessories as a head keeps them: PNG or JPEG of at most 1024 pixels, without fringes."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.base.pictures import decoded
from surface.base.texels import has_clear
from surface.fit.source.textures import LARGEST, MOST_PIXELS
from surface.readers.meshdata import Material

QUALITY = 90  # of a JPEG
CLEAR = 0.5  # opacity below which a texel's colour is not to be trusted: painters leave anything there
INSTALL = "pip install 'omote[view]'"
PLAIN = ("image/png", "image/jpeg")


class Reduced(NamedTuple):
    """A texture as a PNG or JPEG file, empty where it cannot be read; whether its material leaves some of it clear; and
    why it is lost, "" where it is not."""

    data: bytes
    clear: bool
    lost: str = ""


def reduced_picture(material: Material) -> Reduced:
    """The texture of a material as a head keeps it.

    One that has nothing clear and is small enough stays as it is. Without Pillow, PNG and JPEG stay as they are, and
    others are left out.
    """
    data = material.texture or b""
    try:
        image = decoded(data, MOST_PIXELS)
    except ImportError:
        if material.mime in PLAIN:
            return Reduced(data, True)
        return Reduced(b"", True, f"a picture of this kind needs Pillow: {INSTALL}")
    except ValueError as error:
        return Reduced(b"", True, f"its picture cannot be read: {error}")
    clear = material.alpha != "OPAQUE" and has_clear(image)
    if not clear and material.mime in PLAIN and max(image.size) <= LARGEST:
        return Reduced(data, clear)
    return Reduced(_reduced(image, clear=clear), clear)


def _reduced(image: Any, *, clear: bool) -> bytes:
    from PIL import Image  # optional: the extra view

    small = image.convert("RGBA" if clear else "RGB")
    small.thumbnail((LARGEST, LARGEST))  # weights colours by opacity; what is left clear is filled afterwards
    if clear:
        small = Image.fromarray(bled(np.asarray(small)))
    return _encoded(small, "PNG" if clear else "JPEG")


def encoded(pixels: NDArray[np.uint8]) -> bytes:
    """A picture (h, w, 3) as a JPEG file, in blocks of 8 x 8 pixels: no colour spreads from one to the next."""
    from PIL import Image  # optional: the extra view

    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "JPEG", quality=QUALITY, subsampling=0)
    return out.getvalue()


def _encoded(image: Any, kind: str) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **({"quality": QUALITY} if kind == "JPEG" else {"optimize": True}))
    return out.getvalue()


def bled(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w, 4) a picture whose clear texels have the colour of the opaque ones nearby.

    Filtered textures mix the colour of clear texels into edges: white there would be a white fringe. Colours are
    averaged in ever larger blocks, weighted by opacity, and taken from the finest that has any.
    """
    weight = np.where(pixels[..., 3] >= CLEAR * 255.0, pixels[..., 3] / 255.0, 0.0)
    around = _filled(pixels[..., :3].astype(float) * weight[..., None], weight)
    out = pixels.copy()
    keep = (pixels[..., 3:] / 255.0 / CLEAR).clip(0.0, 1.0) ** 2
    out[..., :3] = np.rint(keep * pixels[..., :3] + (1.0 - keep) * around).astype(np.uint8)
    return out


def _filled(colour: Floats, weight: Floats) -> Floats:
    """(h, w, 3) mean colours of a picture of colours times weights (h, w); from coarser ones where a place has none."""
    height, width = weight.shape
    own = colour / np.maximum(weight, 1e-6)[..., None]
    if max(height, width) == 1 or (weight > 0.0).all():
        return own
    h, w = height + height % 2, width + width % 2
    padded = np.zeros((h, w, 4))
    padded[:height, :width, :3], padded[:height, :width, 3] = colour, weight
    half = padded.reshape(h // 2, 2, w // 2, 2, 4).sum(axis=(1, 3)) / 4.0
    coarse = _filled(half[..., :3], half[..., 3])
    spread = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)[:height, :width]
    return np.where(weight[..., None] > 1e-4, own, spread)
