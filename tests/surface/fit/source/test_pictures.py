"""surface.fit.source.pictures"""

from __future__ import annotations

import io

import numpy as np
import pytest
from cards import RED, picture
from PIL import Image

from surface.fit.source.pictures import bled, reduced_picture
from surface.readers.meshdata import Material


def material(texture: bytes, alpha: str = "OPAQUE") -> Material:
    kind = {b"\x89": "image/png", b"\xff": "image/jpeg", b"R": "image/webp"}
    mime = next(mime for start, mime in kind.items() if texture.startswith(start))
    return Material("m", texture=texture, mime=mime, alpha=alpha)


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)))


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_a_small_one_without_anything_clear_stays_byte_for_byte(kind):
    own = picture(RED[:3], kind=kind)
    assert reduced_picture(material(own)) == (own, False, "")
    assert reduced_picture(material(own, "BLEND")) == (own, False, "")


def test_a_large_one_becomes_a_jpeg_and_a_webp_too():
    for own in (picture(RED[:3], (3000, 30)), picture(RED[:3], kind="WEBP")):
        found, clear, _ = reduced_picture(material(own))
        assert found.startswith(b"\xff\xd8") and not clear and max(pixels(found).shape) <= 1024


def test_clear_texels_get_the_colour_of_the_opaque_ones_beside_them():
    found, clear, _ = reduced_picture(material(picture(RED, (2048, 64), hole=True), "MASK"))
    seen = pixels(found)
    assert clear and found.startswith(b"\x89PNG") and seen.shape == (32, 1024, 4)
    assert seen[:, :500, 3].min() == 255 and seen[:, 520:, 3].max() == 0
    assert np.abs(seen[..., :3].astype(int) - RED[:3]).max() < 6  # nothing of the white that was there


def test_opaque_materials_do_not_mind_what_is_clear():
    found, clear, _ = reduced_picture(material(picture(RED, (2048, 64), hole=True)))
    assert not clear and pixels(found).shape == (32, 1024, 3)


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
def test_what_cannot_be_read_is_left_out_and_it_is_said_why(kind):
    for own in (b"\x89PNG broken", picture(RED[:3], (300, 300), kind)[:-200]):
        data, _, lost = reduced_picture(material(own))
        assert data == b"" and lost.startswith("its picture cannot be read: ") and "object at" not in lost


def test_greys_of_16_bits_keep_their_tone():
    out = io.BytesIO()
    Image.fromarray(np.full((4, 2000), 257 * 100, np.uint16)).save(out, "PNG")
    assert np.abs(pixels(reduced_picture(material(out.getvalue())).data).astype(int) - 100).max() < 3


def test_faint_texels_keep_some_of_their_colour_and_a_picture_of_nothing_stays():
    faint = np.zeros((4, 4, 4), np.uint8)
    faint[..., 1] = 200
    np.testing.assert_array_equal(bled(faint)[..., 3], 0)
    faint[:, :2] = (90, 0, 0, 255)
    faint[:, 2] = (0, 0, 90, 200)
    out = bled(faint)
    assert out[0, 2].tolist() == [0, 0, 90, 200] and out[0, 0].tolist() == [90, 0, 0, 255]
    assert out[0, 3, 1] < 10  # not the green that was hidden there


def test_without_pillow_png_and_jpeg_stay(monkeypatch):
    import builtins

    real = builtins.__import__
    monkeypatch.setattr(
        builtins, "__import__", lambda name, *a, **k: (_ for _ in ()).throw(ImportError(name)) if name == "PIL" else
        real(name, *a, **k),
    )  # fmt: skip
    own = picture.__globals__["RED"], b"\x89PNG"
    assert reduced_picture(material(own[1]))[0] == own[1]
    data, _, lost = reduced_picture(material(b"RIFF"))
    assert data == b"" and "pip install 'omote[view]'" in lost
