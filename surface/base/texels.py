"""Pictures whose texels may be clear, by Pillow: whether any is, and smaller ones in which they keep their colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL import Image  # optional: the extra view


def has_clear(image: Image.Image) -> bool:
    """Whether any texel is not opaque, by its alpha or, in a picture with a palette or one clear colour, by that."""
    alpha = image.convert("RGBA").getchannel("A")
    return any(alpha.histogram()[:255])


def reduced(image: Image.Image, side: int, *, clear: bool) -> Image.Image:
    """A picture of at most ``side`` pixels to each side, RGBA where it is ``clear`` in places, else RGB.

    Colour and opacity are reduced apart: together, Pillow weights colours by opacity, which turns clear texels black,
    and filtered textures mix the colour of clear texels into edges.
    """
    whole = image.convert("RGBA")
    colour, alpha = whole.convert("RGB"), whole.getchannel("A")
    colour.thumbnail((side, side))
    alpha.thumbnail((side, side))
    if clear:
        colour.putalpha(alpha)
    return colour
