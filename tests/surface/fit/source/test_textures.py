"""Colours of faces: base colour, texture, opacity and the area that each sample stands for."""

import io
from dataclasses import replace

import numpy as np
import pytest

from surface.fit.source import textures as module
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import linear, sample_colours
from surface.readers.meshdata import Material

RED = Material("red", (0.5, 0.1, 0.2, 0.6))


def mesh(materials, uv=((0.0, 0.0), (1, 0), (1, 1), (0, 1)), face_uv=None) -> FitMesh:
    """A quad of 4 by 2 mm and a triangle of 3 mm2 beside it, an object each."""
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0], [10, 0, 0], [12, 0, 0], [10, 3, 0]], float)
    faces = np.array([[0, 1, 2, 3], [4, 5, 6, -1]])
    own = np.array([[0, 1, 2, 3], [0, 1, 2, -1]]) if face_uv is None else face_uv
    none = np.zeros((0, 7, 3))
    return FitMesh(
        points, faces, np.array(uv, float).reshape(-1, 2), own, (), none, np.array([0, 1]), ("a", "b"), materials
    )


def picture(pixels: np.ndarray) -> bytes:
    image = pytest.importorskip("PIL.Image")
    out = io.BytesIO()
    image.fromarray(pixels.astype(np.uint8), "RGBA" if pixels.shape[2] == 4 else "RGB").save(out, "PNG")
    return out.getvalue()


def test_samples_have_the_colour_of_their_material_and_weigh_as_much_as_their_area() -> None:
    both = mesh((replace(RED, alpha="BLEND"), None))
    found = sample_colours(both, np.array([0, 1]), steps=3)
    assert len(found.points) == 2 * 10
    np.testing.assert_allclose(found.colour, np.tile(RED.colour, (20, 1)))
    assert found.weight.sum() == pytest.approx(8.0) and found.weight.std() < 1e-12
    assert (found.points >= 0).all() and (found.points <= [4, 2, 0]).all()
    np.testing.assert_allclose(found.points.mean(axis=0), [2, 1, 0], atol=1e-9)
    two = sample_colours(mesh((RED, replace(RED, colour=(0.1, 0.1, 0.1, 1.0)))), np.array([1, 0]), steps=1)
    assert two.weight.sum() == pytest.approx(11.0)
    dark = two.colour[:, 0] == 0.1
    assert two.weight[dark].sum() == pytest.approx(3.0) and (two.points[dark, 0] >= 10).all() and dark.sum() == 3


@pytest.mark.parametrize("steps", [0, 1, 2, 5])
def test_shares_of_corners_are_inside_all_different_and_even(steps: int) -> None:
    share = module._inside(steps)
    assert len(share) == (steps + 1) * (steps + 2) // 2 == len({tuple(np.round(s, 9)) for s in share})
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    assert share.min() > 0
    np.testing.assert_allclose(share.mean(axis=0), 1 / 3)
    middles = np.sort(share[:, 1])[:: steps + 1] if steps else share[:, 1]
    assert middles.max() < 1


def test_where_nothing_is_said_there_are_no_colours() -> None:
    white = Material("white")
    for materials in ((), (None, None), (white, None), (replace(white, texture=b"no picture"), None)):
        assert sample_colours(mesh(materials), np.array([0, 1])) is None
    assert sample_colours(mesh((RED, RED)), np.zeros(0, int)) is None
    assert sample_colours(mesh((None, RED)), np.array([0])) is None
    assert sample_colours(mesh((replace(white, colour=(1.0, 1.0, 0.99, 1.0)), None)), np.array([0])) is not None


@pytest.mark.parametrize(
    ("alpha", "cutoff", "opacity"),
    [("OPAQUE", 0.5, 1.0), ("BLEND", 0.5, 0.6), ("MASK", 0.5, 1.0), ("MASK", 0.6, 1.0), ("MASK", 0.7, 0.0)],
)  # fmt: skip
def test_opacity_is_as_the_material_says(alpha, cutoff, opacity) -> None:
    found = sample_colours(mesh((replace(RED, alpha=alpha, cutoff=cutoff), None)), np.array([0]))
    np.testing.assert_array_equal(found.colour[:, 3], opacity)


def test_a_texture_is_looked_up_where_its_coordinates_say_and_multiplied() -> None:
    pixels = np.zeros((2, 4, 4))
    pixels[..., 3] = 255
    pixels[0, 0, :3], pixels[1, 3, :3], pixels[1, 0, :3] = (255, 0, 0), (0, 255, 0), (0, 0, 188)
    material = Material("x", (0.5, 0.5, 1.0, 1.0), picture(pixels))
    found = sample_colours(mesh((material, None)), np.array([0]), steps=6)
    x, y = (found.points[:, :2] / [4, 2]).T
    top_left, low_right, low_left = (x < 0.25) & (y > 0.5), (x > 0.75) & (y < 0.5), (x < 0.25) & (y < 0.5)
    np.testing.assert_allclose(found.colour[top_left, :3], np.tile([0.5, 0, 0], (top_left.sum(), 1)))
    np.testing.assert_allclose(found.colour[low_right, :3], np.tile([0, 0.5, 0], (low_right.sum(), 1)))
    np.testing.assert_allclose(found.colour[low_left, 2], ((188 / 255 + 0.055) / 1.055) ** 2.4)
    assert not found.colour[~(top_left | low_right | low_left), :3].any()
    moved = mesh((material, None), uv=np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) + np.array([3.0, -2.0]))
    np.testing.assert_allclose(sample_colours(moved, np.array([0]), steps=6).colour, found.colour)  # pictures repeat
    bare = mesh((material, None), face_uv=np.array([[0, 1, 2, 3], [0, 1, 2, -1]]) * 0 - 1)
    assert sample_colours(bare, np.array([0])) is None
    assert sample_colours(mesh((material, None), uv=np.zeros((0, 2))), np.array([0])) is None


def test_large_pictures_are_made_smaller_and_far_too_large_ones_not_read(monkeypatch) -> None:
    data = picture(np.full((6, 40, 3), 255.0))
    assert module.linear_picture(data).shape == (6, 40, 4)
    small = module.linear_picture(data, 20)
    assert small.shape == (3, 20, 4)
    np.testing.assert_allclose(small, 1.0)
    monkeypatch.setattr(module, "MOST_PIXELS", 239)
    assert module.linear_picture(data) is None
    monkeypatch.setattr(module, "MOST_PIXELS", 240)
    assert module.linear_picture(data) is not None
    for cut in (data[:40], b""):
        assert module.linear_picture(cut) is None


def test_srgb_becomes_linear_as_its_standard_says() -> None:
    """IEC 61966-2-1: known pairs, and no step where the two pieces meet."""
    np.testing.assert_allclose(linear(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1.0], atol=1e-6)
    np.testing.assert_allclose(linear(np.array([0.02])), 0.02 / 12.92)
    at = linear(np.linspace(0, 1, 5001))
    assert (np.diff(at) > 0).all() and np.diff(at).max() < 6e-4
    np.testing.assert_allclose(
        np.where(at <= 0.0031308, 12.92 * at, 1.055 * at ** (1 / 2.4) - 0.055), np.linspace(0, 1, 5001), atol=1e-6
    )


def test_pixels_are_found_by_rows_down_and_columns_to_the_right() -> None:
    pixels = np.arange(6.0)[:, None].reshape(2, 3, 1) * np.ones(4)
    at = np.array([[0.0, 0.0], [0.34, 0.0], [0.99, 0.49], [0.0, 0.51], [1.0, 1.0], [-0.01, -0.01], [2.4, 5.9]])
    np.testing.assert_array_equal(module._looked_up(pixels, at)[:, 0], [0, 1, 2, 3, 0, 5, 4])
