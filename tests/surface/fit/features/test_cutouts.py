"""Cards get the outline of what their texture draws; what it leaves clear is neither drawn nor measured."""

import io
from dataclasses import replace

import numpy as np
import pytest
from lash_strip import LONG, TALL, mesh, strip

from surface.fit.features import cutouts
from surface.fit.features.cutouts import cut_out
from surface.head.model.meshes import domain_of
from surface.readers.meshdata import Material

Image = pytest.importorskip("PIL.Image")


def picture(opaque: np.ndarray) -> bytes:
    """A PNG that is opaque where ``opaque (h, w)`` says, top row first."""
    pixels = np.zeros((*opaque.shape, 4), np.uint8)
    pixels[..., 3] = 255 * opaque
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


def card(opaque: np.ndarray, alpha: str = "BLEND"):
    """The strip, and a mesh that shows the picture on all of it; its texture coordinates are not the part's."""
    material = Material(alpha=alpha, texture=picture(opaque))
    whole, islands = mesh(material)
    whole = replace(whole, uv=whole.vertices[:, :2] / [LONG, TALL])
    return strip()[0], whole, [replace(islands[0], uv=whole.uv)]


def left_half() -> np.ndarray:
    opaque = np.zeros((40, 80), bool)
    opaque[:, :40] = True
    return opaque


@pytest.mark.parametrize("alpha", ["BLEND", "MASK"])
def test_what_is_clear_is_cut_off(alpha: str) -> None:
    part = cut_out(*card(left_half(), alpha))
    assert domain_of(part).inside(np.array([[0.1, 0.5], [0.45, 0.1], [0.55, 0.5], [0.9, 0.9]])).tolist() == [
        True, True, False, False,
    ]  # fmt: skip


def test_pictures_are_the_right_way_up() -> None:
    opaque = np.zeros((40, 80), bool)
    opaque[:10] = True  # the top: high v
    part = cut_out(*card(opaque))
    assert domain_of(part).inside(np.array([[0.5, 0.9], [0.5, 0.5]])).tolist() == [True, False]


def test_two_spots_are_two_outlines_and_specks_none() -> None:
    opaque = np.zeros((80, 160), bool)
    opaque[20:60, 20:60] = opaque[20:60, 100:140] = opaque[70, 80] = True
    assert len(cut_out(*card(opaque)).loops) == 2


@pytest.mark.parametrize("opaque", [np.ones((8, 8), bool), np.zeros((8, 8), bool)])
def test_all_or_nothing_is_drawn_whole(opaque: np.ndarray) -> None:
    part, *rest = card(opaque)
    assert cut_out(part, *rest) is part


def test_skin_opaque_cards_and_cards_without_a_texture_stay_whole() -> None:
    part, whole, islands = card(left_half())
    skin = replace(part, material="skin")
    assert cut_out(skin, whole, islands) is skin
    for material in (None, Material(alpha="BLEND"), replace(whole.materials[0], alpha="OPAQUE")):
        other = replace(whole, materials=(material,))
        assert cut_out(part, other, islands) is part


@pytest.mark.parametrize(
    ("alpha", "cutoff", "opaque", "whole"),
    [("BLEND", 0.1, 0.49, True), ("BLEND", 0.9, 0.51, False), ("MASK", 0.3, 0.29, True), ("MASK", 0.3, 0.31, False)],
)
def test_a_place_is_drawn_from_a_half_or_the_materials_own_cutoff_on(monkeypatch, alpha, cutoff, opaque, whole):
    part, given, islands = card(left_half(), alpha)
    given = replace(given, materials=(replace(given.materials[0], cutoff=cutoff),))
    monkeypatch.setattr(cutouts, "opacity_at", lambda _, uv: np.where(uv[:, 0] < 0.5, opaque, 0.0))
    assert (cut_out(part, given, islands) is part) == whole


@pytest.mark.parametrize(("share", "whole"), [(0.01, True), (0.03, False), (0.97, False), (0.99, True)])
def test_a_card_that_is_opaque_nearly_nowhere_or_everywhere_is_drawn_whole(monkeypatch, share, whole):
    part, given, islands = card(left_half())
    monkeypatch.setattr(cutouts, "opacity_at", lambda _, uv: (uv[:, 0] < share).astype(float))
    assert (cut_out(part, given, islands) is part) == whole


def test_the_longer_side_has_201_places(monkeypatch):
    part, given, islands = card(left_half())
    raster, asked = cutouts._raster, []
    monkeypatch.setattr(cutouts, "_raster", lambda *args: asked.append(args[-3:]) or raster(*args))
    cut_out(part, given, islands)
    ((low, step, size),) = asked
    assert step == pytest.approx(1 / 200) and low.tolist() == [0.0, 0.0] and size.tolist() == [201, 201]


def test_an_outline_encloses_more_than_12_places():
    for side, area in ((3.0, 9.0), (4.0, 16.0)):
        square = np.array([[0.0, 0], [side, 0], [side, side], [0, side]])
        assert cutouts._area(square) == cutouts._area(square[::-1]) == area
    assert cutouts.MIN_AREA == 12


def test_shares_of_a_places_in_a_triangle_sum_to_one():
    tri = np.array([[1.0, 1], [3, 1], [1, 5]])
    at = np.array([[1.0, 1], [2, 1], [1, 4], [2, 3], [0, 0]])
    found = cutouts._shares(tri, at)
    np.testing.assert_allclose(found, [[1, 0, 0], [0.5, 0.5, 0], [0.25, 0, 0.75], [0, 0.5, 0.5], [1.75, -0.5, -0.25]])
    assert (cutouts._shares(tri[[0, 1, 1]], at) == -1).all()
