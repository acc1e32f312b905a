"""surface.view.draw.textures: skin and eyes drawn with the texture of the mesh that a head was made from."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from ball_head import EYES, BallHead, values
from PIL import Image

from surface.base.errors import ViewError
from surface.head.model.texture import HeadTexture
from surface.view import Offscreen
from surface.view.draw.textures import decoded_texture

SIZE = (160, 160)
TONE = (0.5, 0.25, 0.2)
SRGB = tuple(round(255 * (1.055 * c ** (1 / 2.4) - 0.055)) for c in TONE)
HALF = np.array([[0.0, 0.5, 1.0, 1.0]], np.float32)


def encoded(*bands: tuple[int, int, int]) -> bytes:
    """A picture of bands, the first at the top."""
    image = Image.new("RGB", (32, 32 * len(bands)))
    for k, colour in enumerate(bands):
        image.paste(colour, (0, 32 * k, 32, 32 * (k + 1)))
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def drawn(data: bytes | None, *, eye: bool = False, hurry: bool = False, **given: Any) -> np.ndarray:
    """A ball whose left half, or whose eyes, have a texture."""
    head: Any = BallHead()
    for part in head.parts:
        if part.material == "eye":
            if eye and data is not None:
                part.attributes["texture_rectangle"] = np.tile(HALF, (len(part.vertices), 1))
            continue
        if part.material == "skin":
            part.attributes["albedo"] = np.tile(np.array(TONE, np.float32), (len(part.vertices), 1))
        at = np.zeros((len(part.vertices), 2), np.float32)
        at[part.rest[:, 0] > 0] = 0.0 if eye else 0.75
        part.attributes |= {"texture_uv": at} if data is not None else {}
    if data is not None:
        head.texture = HeadTexture(data, TONE, {})
    with Offscreen(head, SIZE, **given) as screen:
        if hurry:
            screen.renderer.hurry()
        return screen.render(values()).astype(int)


def cheek(picture: np.ndarray, side: int) -> np.ndarray:
    """Mean colour below an eye; the face's own left, ``side`` 1, is at the right of the picture."""
    x = SIZE[0] // 2 + side * 22
    return picture[80:90, x - 4 : x + 4, :3].mean(axis=(0, 1))


@pytest.mark.parametrize("hurry", [False, True])
@pytest.mark.parametrize("quality", ["full", "fast"])
def test_skin_is_as_much_darker_as_the_texture_is_than_its_tone(gl: None, quality: str, hurry: bool) -> None:
    plain = drawn(None, quality=quality, hurry=hurry)
    half = drawn(encoded(SRGB, (10, 10, 200)), quality=quality, hurry=hurry)
    np.testing.assert_allclose(cheek(half, -1), cheek(plain, -1), atol=2.5, err_msg="where it has the skin's own tone")
    red, green, blue = cheek(half, 1)
    assert blue > 2 * red and blue > 2 * green and cheek(plain, 1)[0] > cheek(plain, 1)[2]


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_an_eye_shows_its_own_picture(gl: None, quality: str) -> None:
    def eye(picture: np.ndarray) -> np.ndarray:
        return picture[40:75, 90:120, :3].reshape(-1, 3)

    plain, own = drawn(None, quality=quality), drawn(encoded(SRGB, (0, 220, 0)), eye=True, quality=quality)

    def greens(pixels: np.ndarray) -> int:
        return int(((pixels[:, 1] > 60) & (pixels[:, 1] > 1.5 * pixels[:, 0])).sum())

    assert greens(eye(own)) > 40 and greens(eye(plain)) == 0 and EYES["left_eye"][0] > 0


def test_a_mask_has_its_own_colours(gl: None) -> None:
    np.testing.assert_array_equal(drawn(encoded(SRGB, (0, 0, 255)), theme="mask"), drawn(None, theme="mask"))
    np.testing.assert_array_equal(drawn(encoded(SRGB, (0, 0, 255)), theme="robot"), drawn(None, theme="robot"))


def test_a_damaged_texture_is_not_drawn_and_a_warning_says_so(gl: None, caplog: pytest.LogCaptureFixture) -> None:
    np.testing.assert_array_equal(drawn(b"\x89PNG damaged"), drawn(None))
    (record,) = caplog.records
    assert "texture cannot be read" in record.getMessage() and "omote fit" in record.getMessage()


def test_one_that_is_too_large_for_the_driver_is_refused() -> None:
    own = HeadTexture(encoded(SRGB, SRGB), TONE, {})
    assert decoded_texture(own, 64)[0] == (32, 64)
    with pytest.raises(ViewError, match="64 pixels in a side, 63 are the most"):
        decoded_texture(own, 63)
