"""surface.export.textures: pictures of strands and strips that programs without omote's shaders draw."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.export.textures import (
    EYE_RIM,
    STRAND_CUTOFF,
    encode_srgb,
    eye_column,
    eye_picture,
    eye_rings,
    png_bytes,
    strand_picture,
    strip_picture,
)
from surface.readers.meshdata import linear as decode_srgb


def test_strands_have_heights_about_a_half_and_few_stand_above_full_cover() -> None:
    picture = strand_picture(96)
    assert picture.shape == (96, 96, 4) and picture.dtype == np.uint8
    height = STRAND_CUTOFF * 255.0 / picture[..., 3]
    assert np.median(height) == pytest.approx(0.5, abs=0.05)
    assert 0.002 < np.mean(height > 1.0) < 0.06 and height.max() <= 2.0
    grey = picture[..., 0].astype(float)
    assert (picture[..., 1] == grey).all() and (picture[..., 2] == grey).all()
    bright = decode_srgb(grey / 255.0)
    assert bright.mean() == pytest.approx(0.62, abs=0.03) and bright.std() == pytest.approx(0.17, abs=0.04)
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


@pytest.mark.parametrize(("channels", "mode"), [(1, "L"), (4, "RGBA")])
def test_a_png_of_one_or_four_channels_is_grey_or_has_alpha(channels: int, mode: str) -> None:
    image = pytest.importorskip("PIL.Image", reason="needs Pillow (extra view)")
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, channels), np.uint8)
    got = image.open(io.BytesIO(png_bytes(picture)))
    assert got.mode == mode
    np.testing.assert_array_equal(np.asarray(got).reshape(picture.shape), picture)


def test_colours_are_encoded_as_srgb_and_come_back() -> None:
    assert encode_srgb(np.array([-1.0, 0.0, 0.002, 0.0031, 0.0032, 0.2140, 0.5, 1.0, 2.0])).tolist() == [
        0, 0, 7, 10, 11, 127, 188, 255, 255
    ]  # fmt: skip
    linear = np.linspace(0.0, 1.0, 500)
    np.testing.assert_allclose(decode_srgb(encode_srgb(linear) / 255.0), linear, atol=0.0045)
    assert decode_srgb(np.array([0.04, 0.5])) == pytest.approx([0.04 / 12.92, 0.21404], rel=1e-4)


def eye(**painted: object) -> Any:
    return SimpleNamespace(painted=painted)


IRIS, WHITE = np.array([0.1, 0.3, 0.6]), np.array([0.8, 0.7, 0.9])


def test_an_eye_is_dark_in_its_pupil_coloured_in_its_iris_and_redder_at_the_rim_of_its_white() -> None:
    colour = decode_srgb(eye_picture(eye(iris=IRIS, sclera=WHITE, iris_radius=[0.5]), 256) / 255.0)
    y, x = ((np.arange(256) + 0.5) / 256 - 0.5) / EYE_RIM, ((np.arange(256) + 0.5) / 256 - 0.5) / EYE_RIM
    r = np.hypot(y[:, None], x[None])

    def mean(low: float, high: float) -> np.ndarray:
        return np.asarray(colour[(r >= low) & (r < high)].mean(axis=0))

    assert colour[r < 0.15].max() < 0.005
    np.testing.assert_allclose(mean(0.36, 0.4), 1.05 * IRIS, rtol=0.12, atol=0.02)
    assert mean(0.455, 0.465)[2] < 0.7 * mean(0.36, 0.4)[2]  # a dark ring around it
    np.testing.assert_allclose(mean(0.55, 0.6), WHITE, atol=0.01)
    np.testing.assert_allclose(mean(0.99, 1.0), WHITE * [0.92, 0.70, 0.62], atol=0.01)
    fibres = colour[(r > 0.3) & (r < 0.4)].std(axis=0) / colour[(r > 0.3) & (r < 0.4)].mean(axis=0)
    assert (fibres > 0.1).all() and (fibres < 0.6).all()


def test_a_mesh_of_one_colour_has_rings_of_pupil_iris_and_white() -> None:
    (pupil, *first), (iris, *second), (white, *third) = eye_rings(eye(iris=IRIS, sclera=2 * WHITE, iris_radius=[0.5]))
    assert (pupil, iris, white) == ("pupil", "iris", "sclera")
    assert first[:2] == [0.0, pytest.approx(0.19)] and second[:2] == [pytest.approx(0.19), 0.5]
    assert third[:2] == [0.5, np.inf] and (first[2] < 0.02).all()
    np.testing.assert_allclose(second[2], IRIS)
    np.testing.assert_allclose(third[2], np.minimum(2 * WHITE, 1.0))


def test_the_column_of_an_eye_takes_its_painted_colours() -> None:
    plain, blue = eye_column(eye()), eye_column(eye(iris=[0.0, 0.0, 1.0]))
    assert plain.shape == (256, 4, 3) and (plain == plain[:, :1]).all()
    changed = np.flatnonzero((plain != blue).any(axis=(1, 2)))
    assert 0 < len(changed) < 200 and (blue[changed, 0, 2] >= plain[changed, 0, 2]).all()
    assert blue[changed[len(changed) // 2], 0, :2].max() < 60


def test_a_strip_fades_evenly_and_goes_from_its_root_to_its_tip() -> None:
    cover = strip_picture((0.8, 0.4, 0.25, 0.0), False, (64, 256))[..., 3] / 255.0
    np.testing.assert_allclose(cover[-1], cover[-1, 128] * np.clip(np.minimum(1, 4 * edge(256)), 0, 1), atol=0.01)
    across = 1.0 - (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(cover[:, 128], 0.8 - 0.4 * across**2, atol=0.01)
    strands = strip_picture((0.5, 0.5, 0.0, 1.0), False, (64, 256))[..., 3] / 255.0
    assert strands.min() == pytest.approx(0.5 - 0.225, abs=0.02) and strands.max() == pytest.approx(0.725, abs=0.02)
    bare = strip_picture((0.0, 0.0, 0.0, 1.0), False, (64, 256))[..., 3] / 255.0
    assert bare.min() == 0.0 and bare.max() == pytest.approx(0.225, abs=0.02)


def edge(width: int) -> np.ndarray:
    """How far each place of a row is from the nearer end."""
    along = (np.arange(width) + 0.5) / width
    return np.minimum(along, 1.0 - along)
