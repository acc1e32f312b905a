"""surface.fit.painting.texture: skin and eyes in one picture, each in a rectangle of its own."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, joined, pair, shell

from surface.fit.eyes.search import Eyes
from surface.fit.painting import texture as module
from surface.fit.painting.skin import SkinIslands, Square
from surface.fit.painting.texture import MOST, STRIP, head_texture
from surface.fit.source.islands import Island, find_islands
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import linear
from surface.head.model.texture import HeadTexture
from surface.readers.meshdata import Material

Image = pytest.importorskip("PIL.Image")
SKIN, BROWN, GREEN = (200, 150, 120), (120, 70, 40), (20, 200, 20)


def material(colour: tuple[int, int, int]) -> Material:
    out = io.BytesIO()
    Image.new("RGB", (16, 16), colour).save(out, "PNG")
    return Material(texture=out.getvalue())


def made(*materials: Material | None) -> tuple[HeadTexture | None, list[str], FitMesh, list[Island]]:
    """The texture of a face with two eyes; materials of face, left and right eye."""
    mesh = replace(joined([("Head", face()), *pair(shell)]), materials=materials)
    drawn = mesh.piece > 0
    islands = find_islands(mesh, np.flatnonzero(~drawn))
    texture, notes = head_texture(mesh, Eyes(CENTRES, RADIUS, drawn, drawn, ~drawn),
                                  [SkinIslands("face", islands[:1], True)])  # fmt: skip
    return texture, notes, mesh, islands


def picture(texture: HeadTexture) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(texture.picture)), float)


def at(texture: HeadTexture, place: Any) -> np.ndarray:
    pixels = picture(texture)
    x, y = (np.asarray(place) * pixels.shape[1::-1]).astype(int)
    return pixels[y, x]


def test_skin_and_each_eye_have_their_own_rectangle_and_the_first_texel_is_the_tone() -> None:
    texture, notes, _, _ = made(material(SKIN), material(BROWN), material(GREEN))
    assert texture is not None and notes == ["skin and eyes drawn with the mesh's own texture"]
    assert set(texture.tiles) == {"face", "eye_left", "eye_right"}
    np.testing.assert_allclose(texture.colour, linear(np.array(SKIN) / 255.0), atol=0.01)
    for place in texture.places("face", np.array([[0.01, 0.01], [0.5, 0.5], [0.79, 0.6]])):
        np.testing.assert_allclose(at(texture, place), SKIN, atol=4)
    for name, colour in (("eye_left", BROWN), ("eye_right", GREEN)):
        left, top, right, bottom = texture.tiles[name][0]
        middle, inside = 0.5 * (left + right), 1e-3
        for place in ((left + inside, top + inside), (right - inside, bottom - inside), (middle, top + inside)):
            np.testing.assert_allclose(at(texture, place), colour, atol=4)
    pixels = picture(texture)
    assert pixels.shape[0] == pixels.shape[1], "square, so that texture coordinates in it are not stretched"
    np.testing.assert_allclose(pixels[: STRIP - 8, :64], np.broadcast_to(SKIN, (STRIP - 8, 64, 3)), atol=4)


def test_rectangles_do_not_overlap_and_lie_inside() -> None:
    texture, *_ = made(material(SKIN), material(BROWN), material(GREEN))
    assert texture is not None
    rows = np.concatenate(list(texture.tiles.values()))
    for k, (left, top, right, bottom) in enumerate(rows):
        assert 0.0 <= left < right <= 1.0 and 0.0 < top < bottom <= 1.0
        for a, b, c, d in rows[:k]:
            assert right <= a or c <= left or bottom <= b or d <= top


def test_a_square_of_a_tiles_corner_has_a_rectangle_as_if_the_tile_were_whole() -> None:
    """So (u, v) of the part, which end at the corner's, lie in its square, also those beside the tile."""
    ramp = np.repeat(np.linspace(0.0, 1.0, 64)[None, :, None], 64, axis=0) * np.ones(3)
    grey = np.full((256, 256, 3), 0.3)
    ear = Square(ramp, 256.0, np.array([8.0, 8.0]))
    texture = module.joined({"face": [Square(grey, 256.0, np.zeros(2))], "ear": [ear]}, grey[0, 0])
    for u in (-0.02, 0.05, 0.125, 0.2):
        (place,) = texture.places("ear", np.array([[u, 0.1]]))
        np.testing.assert_allclose(linear(at(texture, place) / 255.0), (256.0 * u + 8.0) / 64.0, atol=0.03)


def test_the_first_texel_has_the_tone_whatever_is_painted_below() -> None:
    texture = module.joined({"face": [Square(np.full((64, 64, 3), 0.8), 64.0, np.zeros(2))]}, np.full(3, 0.1))
    np.testing.assert_allclose(linear(picture(texture)[: STRIP // 2, : STRIP // 2] / 255.0), 0.1, atol=0.01)


def test_what_has_no_texture_is_left_to_paint_and_the_note_says_what_has_one() -> None:
    texture, notes, *_ = made(Material(colour=(0.5, 0.3, 0.2, 1.0)), material(BROWN), material(GREEN))
    assert texture is not None and set(texture.tiles) == {"eye_left", "eye_right"}
    assert notes == ["eyes drawn with the mesh's own texture"]
    texture, notes, *_ = made(material(SKIN), None, None)
    assert (
        texture is not None and set(texture.tiles) == {"face"} and notes == ["skin drawn with the mesh's own texture"]
    )
    assert made(None, None, None)[:2] == (None, [])
    assert made(Material(), Material(texture=b"damaged"), None)[:2] == (None, [])


@pytest.mark.slow
def test_a_picture_that_would_become_too_large_is_made_smaller_or_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    large = Material(texture=_large(), mime="image/jpeg")
    texture, *_ = made(large, material(BROWN), None)
    assert texture is not None and picture(texture).shape[0] > 2048
    monkeypatch.setattr(module, "MOST", 1600)
    texture, *_ = made(large, material(BROWN), None)
    assert texture is not None and 1024 < picture(texture).shape[0] <= 1600
    monkeypatch.setattr(module, "MOST", 300)
    texture, notes, *_ = made(large, material(BROWN), None)
    assert texture is None and "too much for one of 300 pixels" in notes[0]
    assert MOST == 4096


def _large() -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (3000, 3000), SKIN).save(out, "JPEG")
    return out.getvalue()
