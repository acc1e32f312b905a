"""surface.fit.painting.skin: textures of a mesh's skin over the (u, v) of a head, which may be others."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

from surface.fit.painting.skin import BLOCK, OTHERS, SIDES, SkinIslands, Square, skin_squares
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


def shown(square: Square, u: float, v: float) -> np.ndarray:
    """Linear RGB that a square has at a place of its tile."""
    x, y = (square.origin + square.scale * np.array([u, v])).astype(int)
    return square.colour[y, x]


@pytest.mark.parametrize("quads", [True, False])
def test_a_square_shows_at_its_own_u_v_what_the_texture_shows_there(quads: bool) -> None:
    mesh, island = sheet(Material(texture=ramp()), quads=quads)
    (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    assert square.scale == SIDE and square.known > 0.9
    for u in (0.03, 0.2, 0.5, 0.71, 0.97):  # the texture repeats: at its very border the other side is mixed in
        for v in (0.03, 0.3, 0.97):
            wanted = np.array([1.0 - v, u]) * SIZE / (SIZE - 1) - 0.5 / (SIZE - 1)
            np.testing.assert_allclose(shown(square, u, v)[:2], linear(wanted), atol=0.01)


def test_the_materials_own_colour_counts_and_what_is_clear_gets_the_colours_beside_it() -> None:
    material = Material(texture=ramp(alpha=0), alpha="MASK", colour=(0.5, 1.0, 1.0, 1.0))
    mesh, island = sheet(material)
    (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    assert 0.45 < square.known < 0.55
    assert square.colour[..., 0].max() < 0.5 * linear(np.array(0.52)), "nothing of the clear half, halved"
    edge = np.array([shown(square, 0.5, v)[0] for v in (0.02, 0.2, 0.4, 0.49)])
    assert np.ptp(edge) < 0.02 and (edge > 0.08).all(), "the colour beside it, not a mean of all that is known"


def test_an_opaque_material_shows_its_colours_whatever_the_textures_alpha_says() -> None:
    found = []
    for alpha in (0, 255):
        mesh, island = sheet(Material(texture=ramp(alpha)))
        (square,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
        assert square.known > 0.9
        found.append(square.colour)
    np.testing.assert_allclose(*found, atol=1e-6)


def test_tiles_of_a_part_that_is_small_are_small_and_lie_where_its_islands_do() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    low = replace(island, uv=0.25 * island.uv)
    second = replace(island, uv=0.01 * island.uv + [TILE, 0.0])
    found = skin_squares(mesh, [SkinIslands("face", [island], False), SkinIslands("ears", [low, second], False)], GREY)
    one, two = found["ears"]
    assert [len(square.colour) for square in (one, two)] == [SMALL_SIDE // 4 + 2 * BLOCK, 3 * BLOCK]
    assert one.scale == two.scale == SMALL_SIDE
    face = found["face"][0]
    np.testing.assert_allclose(shown(one, 0.125, 0.1), shown(face, 0.5, 0.4), atol=0.02)


def test_an_island_beside_its_tile_is_shown_whole() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    (square,) = skin_squares(mesh, [SkinIslands("face", [replace(island, uv=island.uv - 0.07)], False)], GREY)["face"]
    (whole,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    for u, v in ((0.02, 0.5), (0.4, 0.03), (0.9, 0.9)):
        np.testing.assert_allclose(shown(square, u - 0.07, v - 0.07), shown(whole, u, v), atol=0.01)


def test_islands_that_are_to_be_tiled_fill_their_tiles() -> None:
    mesh, island = sheet(Material(texture=ramp()))
    shrunk = replace(island, uv=3.0 + 0.1 * island.uv)
    (square,) = skin_squares(mesh, [SkinIslands("face", [shrunk], True)], GREY)["face"]
    (whole,) = skin_squares(mesh, [SkinIslands("face", [island], False)], GREY)["face"]
    for u, v in ((0.05, 0.5), (0.5, 0.05), (0.9, 0.9)):
        np.testing.assert_allclose(shown(square, u, v), shown(whole, u, v), atol=0.01)


@pytest.mark.parametrize(("pixels", "side"), [(1000, SIDE), (1050, LARGE_SIDE), (4096, LARGE_SIDE)])
def test_a_texture_with_more_pixels_gets_a_larger_square(pixels: int, side: int) -> None:
    out = io.BytesIO()
    Image.new("RGB", (pixels, pixels), (200, 150, 120)).save(out, "JPEG")
    mesh, island = sheet(Material(texture=out.getvalue()))
    found = skin_squares(mesh, [SkinIslands("face", [island], False), SkinIslands("back", [island], False)], GREY)
    assert [found[name][0].scale for name in ("face", "back")] == [side, OTHERS * side]


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
    assert (found["back"][0].colour == GREY).all() and found["back"][0].known == 0.0
