"""Decode pictures with Pillow, which belongs to the extra ``view``."""

from __future__ import annotations

import io
import struct
import zlib
from typing import Any

import numpy as np

MAX_PIXELS = 4096 * 4096  # of a texture that is decoded; each takes 4 bytes
DECODING_ERRORS = (OSError, ValueError, SyntaxError, LookupError, EOFError, ArithmeticError, struct.error, zlib.error)
"""What Pillow raises for damaged pictures."""


def decoded(data: bytes, most: int = MAX_PIXELS) -> Any:
    """Return a whole picture as a Pillow image with 8 bits a channel.

    Raises ValueError, which says what is wrong: it is damaged, or has more than ``most`` pixels. ImportError: Pillow
    is not installed.
    """
    from PIL import Image, UnidentifiedImageError  # optional: the extra view

    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > most:
                raise ValueError(f"{image.width} x {image.height} pixels are too many, {most} are the most")
            image.load()
            return eight_bits(image)
    except UnidentifiedImageError as error:
        raise ValueError("no picture of a kind that can be read") from error  # Pillow's words name an object in memory
    except (*DECODING_ERRORS, Image.DecompressionBombError) as error:
        raise ValueError(str(error) or type(error).__name__) from error


def eight_bits(image: Any) -> Any:
    """Return an image of 16-bit greys with 8 bits, others as they are: Pillow's own conversion makes most of it
    white."""
    if not image.mode.startswith("I"):
        return image
    from PIL import Image  # optional: the extra view

    greys = np.asarray(image, np.float64) / 257.0  # 65535 becomes 255
    return Image.fromarray(np.rint(greys.clip(0.0, 255.0)).astype(np.uint8))
