"""Colours of skin, white and iris, and the iris's size, from textures and base colours of a mesh."""

import io
from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, disc, face, joined, pair, shell

from surface.fit.features.eye_colours import paint_layers
from surface.fit.features.generic import make_plan
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import linear
from surface.head.model.data import PartData
from surface.readers.meshdata import Material

BROWN, WHITE, SKIN = (120, 70, 40), (220, 215, 205), (200, 150, 120)


def picture(pixels: np.ndarray, kind: str = "PNG") -> bytes:
    image = pytest.importorskip("PIL.Image")
    out = io.BytesIO()
    image.fromarray(pixels.astype(np.uint8)).save(out, kind)
    return out.getvalue()


def eye_picture(edge_deg: float, size: int = 256) -> bytes:
    """A pupil, an iris as far as ``edge_deg`` from the axis, and white: over (u, v) of :func:`eye_face.shell`."""
    at = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    polar = 180.0 * np.hypot(*np.meshgrid(at, at))
    pixels = np.where((polar < edge_deg)[..., None], BROWN, WHITE)
    return picture(np.where((polar < 0.35 * edge_deg)[..., None], 5, pixels))


def one_colour(colour: tuple[int, ...]) -> Material:
    r, g, b = linear(np.array(colour) / 255.0).tolist()
    return Material("plain", (r, g, b, 1.0))


def painted(mesh: FitMesh) -> dict[tuple[str, str], list[float]]:
    """Values by part and attribute."""
    plan = make_plan(mesh)
    assert plan.found is not None
    parts = [_part(p.name, p.material) for p, _ in plan.parts]
    return {(layer["part"], layer["attribute"]): layer["value"] for layer in paint_layers(mesh, plan.found, parts)}


def _part(name: str, material: str) -> PartData:
    none = np.zeros(0)
    return PartData(name, material, "skin", none, none, none, none, none.astype(np.int64), [], none, (0, 0.1, 6), [],
                    none, none)  # fmt: skip


def srgb(value: list[float]) -> np.ndarray:
    a = np.array(value)
    return 255.0 * np.where(a <= 0.0031308, 12.92 * a, 1.055 * a ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("edge", [24.0, 32.0])
def test_a_textured_eyeball_tells_its_iris(edge: float) -> None:
    material = Material("Eye", texture=eye_picture(edge), mime="image/png")
    mesh = joined([("Head", face()), *pair(shell)])
    found = painted(replace(mesh, materials=(one_colour(SKIN), material, material)))
    for part in ("eye_left", "eye_right"):
        np.testing.assert_allclose(srgb(found[part, "iris"]), BROWN, atol=3)
        np.testing.assert_allclose(srgb(found[part, "sclera"]), WHITE, atol=3)
        radius = found.get((part, "iris_radius"), [0.49])[0]
        assert radius == pytest.approx(np.sin(np.radians(edge)), abs=0.04)
    np.testing.assert_allclose(srgb(found["face", "albedo"]), SKIN, atol=1)


def test_eyes_of_two_colours_stay_two() -> None:
    blue = Material("R", texture=picture(np.tile(np.array([40, 80, 160]), (8, 8, 1))))
    brown = Material("L", texture=picture(np.tile(np.array(BROWN), (8, 8, 1))))
    iris = [
        (f"Iris_{n[3:]}", disc(c + np.array([0, 0, 11.5]), 5.0)) for (n, _), c in zip(pair(shell), CENTRES, strict=True)
    ]
    mesh = joined([("Head", face()), *pair(shell), *iris])
    found = painted(replace(mesh, materials=(None, one_colour(WHITE), one_colour(WHITE), brown, blue)))
    np.testing.assert_allclose(srgb(found["eye_left", "iris"]), BROWN, atol=2)
    np.testing.assert_allclose(srgb(found["eye_right", "iris"]), [40, 80, 160], atol=2)
    np.testing.assert_allclose(srgb(found["eye_left", "sclera"]), WHITE, atol=2)
    assert found["eye_left", "iris_radius"][0] == pytest.approx(5.0 / RADIUS, abs=0.01)
    assert ("face", "albedo") not in found


@pytest.mark.parametrize("texture", [b"\x89PNG\r\n\x1a\n and nothing", b""])
def test_a_picture_that_cannot_be_read_tells_nothing(texture: bytes) -> None:
    mesh = joined([("Head", face()), *pair(shell)])
    found = painted(replace(mesh, materials=(Material(texture=texture),) * 3))
    assert {attribute for _, attribute in found} <= {"iris_radius"}


def test_what_is_clear_in_a_texture_does_not_count() -> None:
    pixels = np.zeros((8, 8, 4))
    pixels[:, :4] = (*BROWN, 255)
    pixels[:, 4:] = (0, 255, 0, 0)
    seen = Material("Skin", texture=picture(pixels), alpha="MASK")
    found = painted(replace(joined([("Head", face())]), materials=(seen,)))
    np.testing.assert_allclose(srgb(found["face", "albedo"]), BROWN, atol=3)


def test_large_eyes_get_an_iris_as_large_as_peoples() -> None:
    mesh = joined([("Head", face()), *pair(lambda c: shell(c - np.array([0, 0, 6.0]), 18.0))])
    found = painted(mesh)
    assert found["eye_left", "iris_radius"][0] * 18.0 == pytest.approx(6.0, abs=0.3)
