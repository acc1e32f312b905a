"""surface.base.texels: what is clear in a picture is found, and keeps its colour in smaller ones."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base.texels import has_clear, reduced

Image = pytest.importorskip("PIL.Image")


def test_clear_texels_are_found_by_alpha_palette_and_clear_colour() -> None:
    plain = Image.new("RGB", (4, 4), (200, 20, 20))
    assert not has_clear(plain) and not has_clear(plain.convert("RGBA")) and not has_clear(plain.convert("P"))
    assert has_clear(Image.new("RGBA", (4, 4), (0, 0, 0, 254)))
    for mode in ("P", "RGB"):
        one = plain.convert(mode)
        one.info["transparency"] = 0 if mode == "P" else (200, 20, 20)
        one.putpixel((0, 0), 0 if mode == "P" else (200, 20, 20))
        assert has_clear(one), mode


def test_a_smaller_picture_keeps_the_colour_of_clear_texels() -> None:
    image = Image.new("RGBA", (64, 32), (200, 20, 20, 0))
    image.paste((200, 20, 20, 255), (0, 0, 32, 32))
    small = reduced(image, 16, clear=True)
    pixels = np.asarray(small)
    assert small.mode == "RGBA" and pixels.shape == (8, 16, 4)
    assert (pixels[..., :3] == (200, 20, 20)).all()
    assert pixels[0, 0, 3] == 255 and pixels[0, 15, 3] == 0


def test_a_picture_without_clear_texels_is_rgb_and_never_larger() -> None:
    image = Image.new("RGBA", (6, 4), (200, 20, 20, 0))
    small = reduced(image, 16, clear=False)
    assert (small.mode, small.size, small.getpixel((0, 0))) == ("RGB", (6, 4), (200, 20, 20))
