"""Cards get the outline of what their texture draws; what it leaves clear is neither drawn nor measured."""

import io
from dataclasses import replace

import numpy as np
import pytest
from lash_strip import LONG, TALL, mesh, strip

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
