"""A small head with a texture: a patch of skin and an eye that show it, and a patch that does not."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from small_head import part, small_head

from surface.head import Head, save_data
from surface.head.model.texture import HeadTexture, write_texture

TONE = (0.5, 0.25, 0.125)
SKIN, EYE = np.array([[0.0, 0.5, 1.0, 1.0]], np.float32), np.array([[0.25, 0.0, 0.75, 0.5]], np.float32)


def ramp() -> bytes:
    """64 x 64: red runs to the right, green down, blue is 77."""
    run = np.linspace(0, 255, 64)
    pixels = np.stack([np.tile(run, (64, 1)), np.tile(run[:, None], (1, 64)), np.full((64, 64), 77.0)], axis=-1)
    out = io.BytesIO()
    Image.fromarray(np.rint(pixels).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def textured(folder: Path, picture: bytes | None = None) -> Head:
    """Patch "a" and an eye have a texture, "b" has none."""
    eye = replace(part("eye_left", 10, "left_eye"), material="eye")
    save_data(folder, small_head(parts=[part("a", -40), part("b", 0.5), eye], seams=[]))
    write_texture(folder, HeadTexture(picture or ramp(), TONE, {"a": SKIN, "eye_left": EYE}))
    return Head.load(folder)
