"""surface.view.draw.placing: a picture is copied pixel by pixel, and nothing beside it changes."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from surface.view.draw.placing import Box, Placing
from surface.view.pictures.offscreen import open_context


def filled(ctx: moderngl.Context, pixels: np.ndarray) -> moderngl.Framebuffer:
    height, width = pixels.shape[:2]
    return ctx.framebuffer([ctx.texture((width, height), 4, pixels.tobytes())])


@pytest.mark.parametrize("box", [(0, 0, 8, 6), (3, 2, 8, 6), (12, 10, 8, 6)])
def test_a_picture_is_copied_to_its_box_and_nowhere_else(gl: None, box: Box) -> None:
    rng = np.random.default_rng(1)
    picture = rng.integers(0, 256, (6, 8, 4), np.uint8)
    before = rng.integers(0, 256, (16, 20, 4), np.uint8)
    picture[..., 3] = before[..., 3] = 255
    ctx = open_context()
    try:
        screen = filled(ctx, before)
        placing = Placing(ctx)
        placing.copy(screen, filled(ctx, picture), box)
        placing.release()
        found = np.frombuffer(screen.read(viewport=(0, 0, 20, 16), components=4), np.uint8).reshape(16, 20, 4)
    finally:
        ctx.release()
    wanted = before.copy()
    left, bottom, width, height = box
    wanted[bottom : bottom + height, left : left + width] = picture
    assert (found == wanted).all()
