"""surface.base.pictures"""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from surface.base.pictures import decoded, eight_bits


def packed(pixels: np.ndarray, kind: str = "PNG") -> bytes:
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, kind)
    return out.getvalue()


NOISE = np.random.default_rng(1).integers(0, 256, (64, 64, 3), np.uint8)


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "WEBP"])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5])
def test_what_is_damaged_is_said_in_words(kind: str, share: float) -> None:
    data = packed(NOISE, kind)
    assert decoded(data).size == (64, 64)
    with pytest.raises(ValueError, match=r"\w") as caught:
        decoded(data[: int(share * len(data))])
    assert "object at" not in str(caught.value) and type(caught.value) is ValueError


def test_large_pictures_are_not_decoded() -> None:
    with pytest.raises(ValueError, match="64 x 64 pixels are too many, 4095 are the most"):
        decoded(packed(NOISE), most=4095)
    assert decoded(packed(NOISE), most=4096).size == (64, 64)


def test_greys_of_16_bits_keep_their_tone() -> None:
    greys = np.array([[0, 257 * 100, 65535]], np.uint16)
    image = decoded(packed(greys))
    assert np.asarray(image.convert("RGB"))[0, :, 0].tolist() == [0, 100, 255]
    assert np.asarray(eight_bits(Image.fromarray(greys.astype(np.int32))).convert("L"))[0].tolist() == [0, 100, 255]
