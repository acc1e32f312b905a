"""Accessories small enough for tests: a square card with a small picture."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from PIL import Image

from surface.head.model.accessories import Accessory

RED, CLEAR_WHITE = (200, 20, 20, 255), (255, 255, 255, 0)


def picture(colour: tuple[int, ...], size: tuple[int, int] = (8, 8), kind: str = "PNG", hole: bool = False) -> bytes:
    """A picture of one colour, RGB or RGBA; its right half is clear and white with a ``hole``."""
    mode = "RGBA" if len(colour) == 4 else "RGB"
    image = Image.new(mode, size, colour)
    if hole:
        image.paste(CLEAR_WHITE, (size[0] // 2, 0, *size))
    out = io.BytesIO()
    image.save(out, kind)
    return out.getvalue()


def card(
    low: tuple[float, float] = (-20.0, -20.0), high: tuple[float, float] = (20.0, 20.0), z: float = 60.0, **given: Any
) -> Accessory:
    """A square that looks ahead, from ``low`` to ``high`` in x and y, mm, with a red picture."""
    (x0, y0), (x1, y1) = low, high
    fields = {"name": "Card", "kind": "hat", "texture": picture(RED)} | given
    return Accessory(
        vertices=np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], np.float32),
        normals=np.tile(np.array([[0, 0, 1]], np.float32), (4, 1)),
        uv=np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32), shade=np.ones(4, np.float32), **fields,
    )  # fmt: skip
