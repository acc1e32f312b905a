"""surface.fit.painting.eyes: what eyes look like from the front, of balls and of flat pieces."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, disc, face, joined, pair, shell

from surface.fit.eyes.search import Eyes
from surface.fit.painting.eyes import SIDE, eye_pictures
from surface.fit.source.mesh import FitMesh
from surface.readers.meshdata import Material

Image = pytest.importorskip("PIL.Image")
BROWN, WHITE, GREEN = (120, 70, 40), (220, 215, 205), (20, 200, 20)


def encoded(pixels: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def plain(colour: tuple[int, ...], alpha: str = "OPAQUE") -> Material:
    return Material(texture=encoded(np.tile(np.array(colour), (8, 8, 1))), alpha=alpha)


def ringed(edge_deg: float) -> Material:
    """Brown as far as ``edge_deg`` from the axis, then white, over (u, v) of :func:`eye_face.shell`; the upper half of
    the iris is green, so that a picture that is upside down is noticed."""
    at = (np.arange(256) + 0.5) / 256 * 2.0 - 1.0
    x, y = np.meshgrid(at, at)
    inside = (180.0 * np.hypot(x, y) < edge_deg)[..., None]
    return Material(texture=encoded(np.where(inside, np.where((y < 0)[..., None], GREEN, BROWN), WHITE)))


def eyes_of(mesh: FitMesh) -> Eyes:
    drawn = np.array([name != "Head" for name in mesh.pieces])[mesh.piece]
    return Eyes(CENTRES, RADIUS, drawn, drawn, ~drawn)


def looks(mesh: FitMesh, *materials: Material | None) -> list[np.ndarray | None]:
    mesh = replace(mesh, materials=(None, *materials))
    return eye_pictures(mesh, eyes_of(mesh))


def at(picture: np.ndarray | None, x: float, y: float) -> np.ndarray:
    """sRGB, 0..255, at a place in eyeball radii from its middle."""
    assert picture is not None
    c = picture[int(SIDE * (0.5 - 0.5 * y)), int(SIDE * (0.5 + 0.5 * x))]
    return 255.0 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


def test_a_ball_shows_its_front_as_it_is_seen_from_afar() -> None:
    edge = 30.0
    mesh = joined([("Head", face()), *pair(lambda c: shell(c, rows=33, columns=48))])
    for picture in looks(mesh, ringed(edge), ringed(edge)):
        assert picture is not None and picture.shape == (SIDE, SIDE, 3)
        inner, outer = np.sin(np.radians(edge - 3)), np.sin(np.radians(edge + 3))
        for angle in np.radians([20, 70, 200, 340]):
            x, y = np.cos(angle), np.sin(angle)
            wanted = GREEN if y > 0 else BROWN
            np.testing.assert_allclose(at(picture, inner * x, inner * y), wanted, atol=3)
            np.testing.assert_allclose(at(picture, outer * x, outer * y), WHITE, atol=3)
        np.testing.assert_allclose(at(picture, 0.9, -0.9), WHITE, atol=3, err_msg="beside the ball: what is nearest")


def test_an_iris_is_seen_before_a_white_whose_rim_lies_before_it_and_lets_through_what_is_clear() -> None:
    half = np.zeros((256, 256, 4))
    half[:, :128], half[:, 128:] = (*BROWN, 255), (*GREEN, 0)
    iris = pair(lambda c: disc(np.add(c, [3.0, 0, 6.0]), 5.0), ("Iris_Left", "Iris_Right"))
    mesh = joined([("Head", face()), *pair(lambda c: shell(c, reach=1.4)), *iris])
    clear = Material(texture=encoded(half), alpha="BLEND")
    left, right = looks(mesh, plain(WHITE), plain(WHITE), clear, clear)
    for picture in (left, right):
        np.testing.assert_allclose(at(picture, 2.0 / RADIUS, 0.0), BROWN, atol=3)
        np.testing.assert_allclose(at(picture, 5.0 / RADIUS, 0.0), WHITE, atol=3, err_msg="where the iris is clear")
        np.testing.assert_allclose(at(picture, -5.0 / RADIUS, 0.0), WHITE, atol=3)


def test_corneas_and_highlights_are_not_part_of_it() -> None:
    cover = pair(lambda c: shell(c, 1.05 * RADIUS), ("Cornea_Left", "Cornea_Right"))
    mesh = joined([("Head", face()), *pair(shell), *cover])
    for picture in looks(mesh, plain(WHITE), plain(WHITE), plain(GREEN), plain(GREEN)):
        np.testing.assert_allclose(at(picture, 0.0, 0.0), WHITE, atol=3)


def test_eyes_without_a_texture_have_no_picture_and_each_eye_has_its_own() -> None:
    mesh = joined([("Head", face()), *pair(shell)])
    assert looks(mesh, None, None) == [None, None]
    assert looks(mesh, Material(colour=(0.1, 0.2, 0.3, 1.0)), Material(texture=b"damaged")) == [None, None]
    left, right = looks(mesh, plain(BROWN), plain(GREEN))
    np.testing.assert_allclose(at(left, 0.1, 0.1), BROWN, atol=3)
    np.testing.assert_allclose(at(right, 0.1, 0.1), GREEN, atol=3)
    assert eye_pictures(mesh, replace(eyes_of(mesh), radius=0.0)) == [None, None]
