"""Colours of skin, white and iris, and the iris's size, from textures and base colours of a mesh."""

import io
from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, disc, face, joined, pair, shell

from surface.fit.eyes import colours as eye_colours
from surface.fit.eyes.colours import paint_layers
from surface.fit.features.generic import make_plan
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import Samples, linear
from surface.head.model.data import PartData
from surface.readers.meshdata import Material

pytestmark = pytest.mark.usefixtures("given_charts")
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


def dots(angle, colours, centre=(3.0, 4.0, 5.0), radius=12.0):
    """Samples on an eyeball at angles (k,) from straight ahead, 24 around each, of these colours (k, 3)."""
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    a, b = (x.ravel() for x in np.meshgrid(angle, around, indexing="ij"))
    points = np.array(centre) + radius * np.column_stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
    colour = np.column_stack([np.repeat(colours, 24, axis=0), np.ones(len(a))])
    return Samples(points, colour, np.sin(a) + 1e-3)


def ringed(edge_deg: float, iris=(0.05, 0.1, 0.2), white=(0.7, 0.6, 0.5)):
    angle = np.radians(np.arange(0.5, 90, 0.5))
    return dots(angle, np.where(np.degrees(angle)[:, None] < edge_deg, iris, white))


@pytest.mark.parametrize("edge", [20.0, 30.0, 40.0])
def test_an_iris_ends_where_rings_become_white(edge: float) -> None:
    found = eye_colours.by_rings(ringed(edge), np.array([3.0, 4.0, 5.0]), 0.5)
    assert found.iris_radius == pytest.approx(np.sin(np.radians(edge)), abs=0.045)
    np.testing.assert_allclose(found.iris, [0.05, 0.1, 0.2])
    np.testing.assert_allclose(found.white, [0.7, 0.6, 0.5])


def test_the_white_beside_an_iris_counts_and_not_that_in_the_shade_of_lids() -> None:
    angle = np.radians(np.arange(0.5, 90, 0.5))
    degrees = np.degrees(angle)[:, None]
    colours = np.where(degrees < 30, [[0.05, 0.1, 0.2]], np.where(degrees < 47, [[0.7, 0.7, 0.7]], [[0.6, 0.6, 0.6]]))
    found = eye_colours.by_rings(dots(angle, colours), np.array([3.0, 4.0, 5.0]), 0.5)
    np.testing.assert_allclose(found.white, 0.7)


def test_an_eye_of_one_colour_has_no_iris_and_one_without_white_tells_nothing() -> None:
    plain = eye_colours.by_rings(ringed(30, (0.7, 0.6, 0.5)), np.array([3.0, 4.0, 5.0]), 0.44)
    assert plain.iris is None and plain.iris_radius == 0.44
    np.testing.assert_allclose(plain.white, [0.7, 0.6, 0.5])
    front = dots(np.radians(np.arange(0.5, 40, 0.5)), np.tile([0.1, 0.2, 0.3], (79, 1)))
    none = eye_colours.by_rings(front, np.array([3.0, 4.0, 5.0]), 0.44)
    assert none.iris is None and none.white is None and none.iris_radius == 0.44
    faint = eye_colours.by_rings(ringed(30, (0.68, 0.58, 0.5)), np.array([3.0, 4.0, 5.0]), 0.44)
    assert faint.iris is None  # hardly another colour


def test_the_pupil_and_the_rim_do_not_colour_an_iris() -> None:
    angle = np.radians(np.arange(0.5, 90, 0.5))
    share = (np.sin(angle) / np.sin(np.radians(30)))[:, None]
    colours = np.where(
        share < 0.4, [[0.004, 0.004, 0.004]], np.where(share < 0.87, [[0.1, 0.2, 0.05]], [[0.01, 0.01, 0.01]])
    )
    colours = np.where(np.degrees(angle)[:, None] > 30, [[0.7, 0.7, 0.7]], colours)
    found = eye_colours.by_rings(dots(angle, colours), np.array([3.0, 4.0, 5.0]), 0.5)
    np.testing.assert_allclose(found.iris, [0.1, 0.2, 0.05])
    disc = np.linspace(0, 1, 60)[1:]
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    r, b = (x.ravel() for x in np.meshgrid(disc, around, indexing="ij"))
    shade = np.where(r < 0.4, 0.01, np.where(r < 0.87, 0.3, 0.02))
    flat = Samples(np.column_stack([9 + 5 * r * np.cos(b), 5 * r * np.sin(b), 0 * r]),
                   np.column_stack([shade, shade, shade, np.ones(len(r))]), r)  # fmt: skip
    np.testing.assert_allclose(eye_colours._of_iris_piece(flat), 0.3)
    fine = np.sqrt((np.arange(4000) + 0.5) / 4000)  # places evenly over a disc whose shade is their radius
    turn = np.arange(4000) * np.pi * (3.0 - np.sqrt(5.0))
    rising = Samples(np.column_stack([9 + 5 * fine * np.cos(turn), 5 * fine * np.sin(turn), 0 * fine]),
                     np.column_stack([fine, fine, fine, np.ones(4000)]), np.ones(4000))  # fmt: skip
    half = np.sqrt(0.5 * (0.42**2 + 0.85**2))  # as much of the ring inside as outside
    np.testing.assert_allclose(eye_colours._of_iris_piece(rising), half, atol=0.003)
    assert eye_colours._of_iris_piece(None) is None
    clear = replace(flat, colour=flat.colour * np.array([1, 1, 1, 0.4]))
    assert eye_colours._of_iris_piece(clear) is None


def test_most_is_the_weighted_median_of_what_is_opaque_within_limits() -> None:
    rng = np.random.default_rng(0)
    colour = np.column_stack([rng.uniform(0.1, 0.9, (41, 3)), np.ones(41)])
    weight = rng.integers(1, 4, 41)
    every = Samples(np.zeros((41, 3)), colour, weight.astype(float))
    chosen = rng.uniform(size=41) < 0.7
    found = eye_colours._most(every, chosen, (0.0, 1.0))
    for k in range(3):
        rows = np.sort(np.repeat(colour[chosen, k], weight[chosen]))
        assert found[k] == rows[(len(rows) - 1) // 2]
    np.testing.assert_allclose(eye_colours._most(every, chosen, (0.0, 0.2)), np.minimum(found, 0.2))
    np.testing.assert_allclose(eye_colours._most(every, chosen, (0.95, 1.0)), 0.95)
    assert eye_colours._most(every, chosen & False, (0.0, 1.0)) is None
    clear = replace(every, colour=np.where(np.arange(41)[:, None] < 40, colour * np.array([1, 1, 1, 0.5]), colour))
    np.testing.assert_array_equal(eye_colours._most(clear, chosen | True, (0.0, 1.0)), colour[40, :3])
