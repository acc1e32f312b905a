"""surface.export.textures: pictures of strands and strips that programs without omote's shaders draw."""

from __future__ import annotations

import io

import numpy as np
import pytest

from surface.export.textures import STRAND_CUTOFF, png_bytes, strand_picture, strip_picture


def test_strands_have_heights_about_a_half_and_few_stand_above_full_cover() -> None:
    picture = strand_picture(96)
    assert picture.shape == (96, 96, 4) and picture.dtype == np.uint8
    height = STRAND_CUTOFF * 255.0 / picture[..., 3]
    assert np.median(height) == pytest.approx(0.5, abs=0.05)
    assert 0.002 < np.mean(height > 1.0) < 0.06 and height.max() <= 2.0
    grey = picture[..., 0].astype(float)
    assert (picture[..., 1] == grey).all() and (picture[..., 2] == grey).all()
    inner = np.abs(np.diff(grey, axis=0)).mean()
    assert np.abs(grey[0] - grey[-1]).mean() < 1.5 * inner  # it tiles


def test_a_strip_fades_at_its_ends_and_on_its_long_sides_where_it_is_soft() -> None:
    hard, soft = (strip_picture((0.8, 0.8, 0.2, 0.0), each, (32, 64))[..., 3] / 255.0 for each in (False, True))
    np.testing.assert_allclose(hard[:, 32], 0.8, atol=0.01)
    assert hard[16, 0] < 0.1 and hard[16, -1] < 0.1
    assert soft[-1, 32] < 0.05 and soft[0, 32] < 0.3 and soft[20, 32] == pytest.approx(0.8, abs=0.05)


def test_a_png_of_every_size_is_what_pillow_reads() -> None:
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    for shape in ((1, 1, 3), (5, 7, 3), (300, 2, 3)):
        picture = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
        got = image.open(io.BytesIO(png_bytes(picture)))
        assert (got.format, got.mode) == ("PNG", "RGB")
        np.testing.assert_array_equal(np.asarray(got), picture)
