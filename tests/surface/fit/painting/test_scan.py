"""surface.fit.painting.scan: the colours of a scan where a head's skin lies on it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from surface.fit.painting.scan import EYE_REACH, FEW, scan_texture
from surface.fit.source.textures import Samples, linear
from surface.head import Head, HeadData
from surface.head.model.file import load_data

Image = pytest.importorskip("PIL.Image")
COUNT = 300_000


@pytest.fixture(scope="module")
def data(root: Path) -> HeadData:
    return load_data(root / "configs" / "heads" / "ict")


def banded(points: np.ndarray) -> np.ndarray:
    """Linear RGB by place: red runs upwards, green to the left, in bands of 12 mm."""
    waves = 0.5 + 0.5 * np.sin(2.0 * np.pi * points[:, [1, 0, 2]] / 12.0)
    return 0.15 + 0.4 * waves * [1.0, 1.0, 0.2]


def sampled(data: HeadData, count: int = COUNT) -> Samples:
    """Points all over the skin of a head, of a scan that has exactly its form; eyes are green."""
    head, random = Head(data), np.random.default_rng(3)
    parts = [part for part in head.parts if part.material == "skin" and part.follows == "skin"]
    corner = np.concatenate([part.vertices.astype(float)[part.triangles] for part in parts])
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    chosen = random.choice(len(corner), count, p=area / area.sum())
    points = np.einsum("mk,mkx->mx", random.dirichlet(np.ones(3), count), corner[chosen])
    ball = random.normal(size=(count // 20, 3))
    ball[:, 2] = np.abs(ball[:, 2])
    ball = data.eyes[0] + 1.02 * data.eye_radius * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    colour = np.vstack([banded(points), np.tile([0.0, 0.6, 0.0], (len(ball), 1))])
    every = np.vstack([points, ball])
    return Samples(every, np.column_stack([colour, np.ones(len(every))]), np.ones(len(every)))


def test_skin_shows_the_scans_colours_where_it_lies_on_it_and_nothing_of_an_eye(data: HeadData) -> None:
    made, texture = scan_texture(data, sampled(data))
    assert texture is not None and "face" in texture.tiles
    pixels = linear(np.asarray(Image.open(io.BytesIO(texture.picture)), float) / 255.0)
    head = Head(made)
    face = head.part("face")
    x, y = (texture.places("face", face.uv) * pixels.shape[1::-1]).astype(int).T
    off = np.abs(pixels[y, x] - banded(face.vertices.astype(float))).max(axis=1)
    away = np.linalg.norm(face.vertices[:, None] - data.eyes, axis=2).min(axis=1) > 1.3 * data.eye_radius
    assert np.percentile(off[away], 90) < 0.06, "waves of 12 mm"
    eye = np.linalg.norm(face.vertices - data.eyes[0], axis=1) < EYE_REACH * data.eye_radius
    red, green, _ = pixels[y[eye], x[eye]].T
    assert eye.sum() > 100 and not ((green > 0.5) & (red < 0.1)).any()


def test_its_paint_is_one_tone_and_its_brows_are_the_scans(data: HeadData) -> None:
    made, texture = scan_texture(data, sampled(data))
    assert texture is not None
    own = [la for la in made.paint if la["attribute"] == "albedo" and la["part"] == "face"]
    assert len(own) == 1 and own[0]["kind"] == "all"
    np.testing.assert_allclose(own[0]["value"], texture.colour, atol=1e-3)
    assert any(p.material == "brow" for p in data.parts) and not any(p.material == "brow" for p in made.parts)
    kept = [la for la in data.paint if la["attribute"] != "albedo" and la["part"] == "face"]
    assert [la for la in made.paint if la["attribute"] != "albedo" and la["part"] == "face"] == kept


def test_a_scan_of_few_samples_or_of_something_else_becomes_no_texture(data: HeadData) -> None:
    whole = sampled(data)
    few = Samples(*(rows[: FEW // 2] for rows in (whole.points, whole.colour, whole.weight)))
    assert scan_texture(data, few) == (data, None)
    elsewhere = Samples(whole.points + 300.0, whole.colour, whole.weight)
    assert scan_texture(data, elsewhere) == (data, None)
    clear = Samples(whole.points, whole.colour * [1, 1, 1, 0], whole.weight)
    assert scan_texture(data, clear) == (data, None)
