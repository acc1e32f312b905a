"""surface.head.model.texture: a head's texture beside its file, and where in it its parts lie."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import picture
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head, save_data
from surface.head.model.look import Look
from surface.head.model.sidecar import FORMAT
from surface.head.model.texture import COLOUR, FILE, PICTURE, TILE, TILES, HeadTexture, read_texture, write_texture
from tests.fuzz.mutators import mutate

ROWS = np.array([[0.1, 0.2, 0.5, 0.8], [0.6, 0.0, 0.7, 1.5]], np.float32)
TEXTURE = HeadTexture(picture((200, 20, 20), kind="JPEG"), (0.5, 0.25, 0.125), {"a": ROWS, "eye_left": ROWS[:1]})


def test_it_comes_back_and_goes_with_the_head_that_has_none(tmp_path: Path) -> None:
    assert read_texture(tmp_path) is None
    assert write_texture(tmp_path, TEXTURE) == tmp_path / FILE
    found = read_texture(tmp_path / "head.toml")
    assert found is not None and found.picture == TEXTURE.picture and found.colour == TEXTURE.colour
    assert set(found.tiles) == {"a", "eye_left"}
    np.testing.assert_array_equal(found.tiles["a"], ROWS)
    assert write_texture(tmp_path, None) is None and list(tmp_path.iterdir()) == []


def test_places_are_in_the_rectangle_of_the_tile_from_its_top_on() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 1.0], [0.5, 0.25], [TILE, 0.0], [TILE + 1.0, 1.0], [-0.1, 1.2], [1.4, 0.0]])
    wanted = [[0.1, 0.2], [0.5, 0.8], [0.3, 0.35], [0.6, 0.0], [0.7, 1.5], [0.06, 0.92], [0.66, 0.2]]
    np.testing.assert_allclose(TEXTURE.places("a", uv), wanted, atol=1e-6)
    beside = TEXTURE.places("a", np.array([[TILE - 1e-6, 0.0], [TILE + 1.0 + 1e-6, 1.0]], np.float32))
    np.testing.assert_allclose(beside, [[0.6, 0.0], [0.7, 1.5]], atol=1e-5, err_msg="rounded, not in another tile")
    assert TEXTURE.places("a", uv).dtype == np.float32
    np.testing.assert_array_equal(TEXTURE.places("other", uv), np.zeros((7, 2)))


DAMAGE = {
    PICTURE: np.frombuffer(b"GIF89a", np.uint8), COLOUR: np.array([0.5, 0.0, 0.5]), f"{TILES}a": np.full((1, 4), 1e4),
    f"{TILES}eye_left": np.zeros((0, 4)), FORMAT: np.array([99]),
}  # fmt: skip


@pytest.mark.parametrize("key", DAMAGE)
def test_a_damaged_file_is_refused_with_what_to_do(tmp_path: Path, key: str) -> None:
    path = write_texture(tmp_path, TEXTURE)
    assert path is not None
    np.savez_compressed(path, **{**dict(np.load(path)), key: DAMAGE[key]})
    with pytest.raises(HeadFileError, match=FILE) as caught:
        read_texture(tmp_path)
    assert "omote" in str(caught.value.hint)


@pytest.mark.parametrize("other", [
    {COLOUR: np.ones(4)}, {COLOUR: np.array(["a", "b", "c"])}, {f"{TILES}a": np.full((1, 4), np.nan)},
    {PICTURE: np.zeros((2, 2), np.uint8)}, {COLOUR: np.array([0.5, 1.5, 0.5])}, {f"{TILES}a": np.ones((2, 3))},
])  # fmt: skip
def test_what_is_no_colour_picture_or_rectangle_is_refused(tmp_path: Path, other: dict[str, np.ndarray]) -> None:
    path = write_texture(tmp_path, TEXTURE)
    assert path is not None
    np.savez_compressed(path, **{**dict(np.load(path)), **other})
    with pytest.raises(HeadFileError):
        read_texture(tmp_path)


def test_mutated_files_are_read_or_refused_in_words(tmp_path: Path) -> None:
    path, rng = write_texture(tmp_path, TEXTURE), random.Random(5)
    assert path is not None
    whole = path.read_bytes()
    for _ in range(150):
        path.write_bytes(mutate(whole, rng))
        try:
            read_texture(tmp_path)
        except HeadFileError as error:
            assert FILE in str(error)


def textured_head(folder: Path, look: Look | None = None) -> Head:
    save_data(folder, small_head())
    write_texture(folder, TEXTURE)
    return Head.load(folder, look=look)


def test_parts_know_where_in_it_they_are(tmp_path: Path) -> None:
    head = textured_head(tmp_path)
    assert head.texture is not None
    part = head.part("a")
    np.testing.assert_array_equal(part.attributes["texture_uv"], TEXTURE.places("a", part.uv))
    assert not head.part("b").attributes["texture_uv"].any()
    assert Head(small_head()).texture is None and "texture_uv" not in Head(small_head()).part("a").attributes


def test_an_eye_knows_its_rectangle_until_a_person_has_eyes_of_another_colour(tmp_path: Path) -> None:
    parts = small_head().parts
    eye = replace(parts[2], name="eye_left", material="eye", follows="left_eye")
    for look, known in ((None, True), (Look(), True), (Look(iris=(0.1, 0.2, 0.3)), False)):
        save_data(tmp_path, replace(small_head(), parts=[*parts[:2], eye]))
        write_texture(tmp_path, TEXTURE)
        part = Head.load(tmp_path, look=look).part("eye_left")
        assert "texture_uv" not in part.attributes
        np.testing.assert_array_equal(part.attributes["texture_rectangle"][3], ROWS[0] if known else np.zeros(4))
