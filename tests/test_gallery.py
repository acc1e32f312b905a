"""The pictures of docs/gallery.md, drawn small as docs/make_gallery.py draws them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from docs.make_gallery import DRAWN, PAGE, PICTURES, emotions, own_shapes, room, themes

SMALL = (96, 104)


def tiles(picture: np.ndarray, columns: int, rows: int = 1) -> list[np.ndarray]:
    """The pictures on a sheet, about."""
    height, width = picture.shape[0] // rows, picture.shape[1] // columns
    cut = [
        picture[r * height : (r + 1) * height, c * width : (c + 1) * width] for r in range(rows) for c in range(columns)
    ]
    return [each.astype(float) for each in cut]


def different(pictures: list[np.ndarray]) -> float:
    """How much the two that are most alike differ, of 255."""
    pairs = [(a, b) for i, a in enumerate(pictures) for b in pictures[:i]]
    return min(float(np.abs(a - b).mean()) for a, b in pairs)


@pytest.mark.slow
def test_every_person_shows_an_expression() -> None:
    assert different(tiles(emotions(SMALL), 4, 2)) > 3.0


@pytest.mark.slow
def test_themes_heads_and_own_shapes_differ() -> None:
    assert different(tiles(themes(SMALL), 3)) > 3.0
    assert different(tiles(room((320, 120)), 3)) > 3.0
    rest, sweet, smile, both = tiles(own_shapes((192, 208)), 4)
    assert np.abs(rest - sweet).max() > 10.0 and np.abs(smile - both).max() > 10.0


def test_the_page_shows_what_is_drawn() -> None:
    shown = set(re.findall(r"pictures/(gallery-[\w-]+\.webp)", PAGE.read_text(encoding="utf-8")))
    assert shown == set(DRAWN) == {path.name for path in PICTURES.glob("gallery-*.webp")}
