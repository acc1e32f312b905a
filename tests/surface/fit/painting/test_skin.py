"""surface.fit.painting.skin: textures of a mesh's skin over the (u, v) of a head, which may be others."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from surface.fit.painting.skin import FEWEST, OTHERS, SIDES, SkinIslands, skin_squares
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh
from surface.fit.source.textures import linear
from surface.head.model.texture import TILE
from surface.readers.meshdata import Material

Image = pytest.importorskip("PIL.Image")
LARGE_SIDE, SIDE, _ = SIDES
SMALL_SIDE = int(OTHERS * SIDE)
GREY = np.array([0.2, 0.2, 0.2])
SIZE = 64


def ramp(alpha: int = 255) -> bytes:
    """Red runs from the left to the right, green from the bottom to the top; the right half is clear by ``alpha``."""
    run = np.linspace(0.0, 255.0, SIZE)
    pixels = np.zeros((SIZE, SIZE, 4))
    pixels[..., 0], pixels[..., 1], pixels[..., 3] = run[None], run[::-1, None], 255
    pixels[:, SIZE // 2 :, 3] = alpha
    out = io.BytesIO()
    Image.fromarray(pixels.astype(np.uint8)).save(out, "PNG")
    return out.getvalue()


def sheet(material: Material, *, quads: bool = True) -> tuple[FitMesh, Island]:
    """A sheet of 4 x 4 faces whose texture coordinates fill the picture, and its island, whose (u, v) are turned by a
    right angle against them: u is the texture's v, v is 1 less its u."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(5), np.arange(5), indexing="ij"))
    at = np.arange(25).reshape(5, 5)
    a, b = (x.ravel() for x in np.meshgrid(np.arange(4), np.arange(4), indexing="ij"))
    faces = np.column_stack([at[a, b], at[a + 1, b], at[a + 1, b + 1], at[a, b + 1]])
    if not quads:
        faces = np.vstack([np.column_stack([faces[:, rows], np.full(16, -1)]) for rows in ([0, 1, 2], [0, 2, 3])])
    uv = np.column_stack([i, j]) / 4.0
    mesh = FitMesh(
        np.column_stack([i, j, 0 * i]).astype(float), faces, uv, faces.copy(), (), np.zeros((0, 25, 3)),
        np.zeros(len(faces), np.int64), ("Skin",), (material,),
    )  # fmt: skip
    return mesh, Island(np.arange(25), np.column_stack([uv[:, 1], 1.0 - uv[:, 0]]), faces)


@pytest.mark.parametrize("quads", [True, False])
def test_a_square_shows_at_its_own_u_v_what_the_texture_shows_there(quads: bool) -> None:
    mesh, island = sheet(Material(texture=ramp()), quads=quads)
    (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    assert square.colour.shape == (SIDE, SIDE, 3) and square.reach == 1.0 and square.known == 1.0
    v, u = (np.indices((SIDE, SIDE)) + 0.5) / SIDE  # v runs down the square
    inner = slice(20, -20)  # the texture repeats, so half of its pixel at the border is mixed with the other side
    wanted = np.stack([1.0 - v, u], axis=-1) * SIZE / (SIZE - 1) - 0.5 / (SIZE - 1)
    found = square.colour[..., :2]
    np.testing.assert_allclose(found[inner, inner], linear(wanted)[inner, inner], atol=0.01)


def test_the_materials_own_colour_counts_and_what_is_clear_gets_the_colours_beside_it() -> None:
    material = Material(texture=ramp(alpha=0), alpha="MASK", colour=(0.5, 1.0, 1.0, 1.0))
    mesh, island = sheet(material)
    (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    assert 0.45 < square.known < 0.55
    assert square.colour[..., 0].max() < 0.5 * linear(np.array(0.52)), "nothing of the clear half, halved"
    edge = square.colour[: SIDE // 2 - 8, SIDE // 2]
    np.testing.assert_allclose(edge, np.broadcast_to(square.colour[SIDE // 2 - 8, SIDE // 2], edge.shape), atol=0.02)
    assert (edge[:, 0] > 0.08).all(), "the colour beside it, not a mean of all that is known"


def test_an_opaque_material_shows_its_colours_whatever_the_textures_alpha_says() -> None:
    found = []
    for alpha in (0, 255):
        mesh, island = sheet(Material(texture=ramp(alpha)))
        (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
        assert square.known == 1.0
        found.append(square.colour)
    np.testing.assert_allclose(*found, atol=1e-6)


def test_tiles_of_a_part_that_is_small_are_small_and_lie_where_its_islands_do() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    low = replace(island, uv=0.25 * island.uv)
    second = replace(island, uv=0.01 * island.uv + [TILE, 0.0])
    found = skin_squares(mesh, [SkinIslands("face", [island], False), SkinIslands("ears", [low, second], False)], GREY)
    one, two = found["ears"]
    assert one.colour.shape == (SMALL_SIDE // 4, SMALL_SIDE // 4, 3) and one.reach == 0.25
    assert two.colour.shape == (FEWEST, FEWEST, 3) and two.reach == FEWEST / SMALL_SIDE
    face = found["face"][0].colour
    np.testing.assert_allclose(one.colour[64, 64], face[512, 512], atol=0.02)


def test_islands_that_are_to_be_tiled_fill_their_tiles() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    shrunk = replace(island, uv=3.0 + 0.1 * island.uv)
    (square,) = skin_squares(mesh, [SkinIslands("face", [shrunk], True)], GREY)["face"]
    (whole,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    np.testing.assert_allclose(square.colour[20:-20, 20:-20], whole.colour[20:-20, 20:-20], atol=0.01)


@pytest.mark.parametrize(("pixels", "side"), [(1000, SIDE), (1050, LARGE_SIDE), (4096, LARGE_SIDE)])
def test_a_texture_with_more_pixels_gets_a_larger_square(pixels: int, side: int) -> None:
    out = io.BytesIO()
    Image.new("RGB", (pixels, pixels), (200, 150, 120)).save(out, "JPEG")
    mesh, island = sheet(Material(texture=out.getvalue()))
    found = skin_squares(mesh, [SkinIslands("face", [island], False), SkinIslands("back", [island], False)], GREY)
    assert [len(found[name][0].colour) for name in ("face", "back")] == [side, OTHERS * side]


@pytest.mark.parametrize("material", [Material(), Material(texture=b"no picture")])
def test_a_face_without_a_texture_has_no_squares(material: Material) -> None:
    mesh, island = sheet(material)
    assert skin_squares(mesh, [SkinIslands("face", [island], False)], GREY) == {}


def test_another_part_without_a_texture_gets_the_colour_of_the_skin() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    lost = replace(mesh, face_uv=np.full_like(mesh.face_uv, -1))
    face = SkinIslands("face", [island], False)
    assert set(skin_squares(mesh, [face, SkinIslands("back", [island], False)], GREY)) == {"face", "back"}
    assert skin_squares(lost, [face], GREY) == {}
    two = replace(
        mesh, pieces=("Skin", "Bare"), materials=(Material(texture=ramp()), Material()),
        piece=np.repeat([0, 1], 16), vertices=np.vstack([mesh.vertices] * 2), deltas=np.zeros((0, 50, 3)),
        faces=np.vstack([mesh.faces, mesh.faces + 25]), face_uv=np.vstack([mesh.face_uv] * 2),
    )  # fmt: skip
    other = Island(island.vertex + 25, island.uv, island.faces)
    found = skin_squares(two, [face, SkinIslands("back", [other], False)], GREY)
    np.testing.assert_array_equal(found["back"][0].colour, np.broadcast_to(GREY, (SMALL_SIDE, SMALL_SIDE, 3)))
