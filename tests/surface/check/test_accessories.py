"""surface.check.accessories"""

from __future__ import annotations

from dataclasses import replace

import pytest
from cards import RED, card, picture
from small_head import small_head

from surface.check import check_head
from surface.check.accessories import damaged_textures
from surface.head import Head
from surface.head.model.texture import FILE, HeadTexture
from surface.head.posing.dressing import WornMesh


def wearing(*textures: bytes) -> Head:
    head = Head(small_head())
    head.accessories = tuple(WornMesh(replace(card(), texture=one), head.data.neck) for one in textures)
    return head


def test_a_damaged_texture_is_found_with_the_name_of_its_accessory() -> None:
    assert list(damaged_textures(wearing(picture(RED), b""))) == []
    cut = picture(RED, (300, 300))[:-200]
    for head in (wearing(picture(RED), cut), wearing(b"\x89PNG")):
        (found,) = damaged_textures(head)
        assert found.text.startswith("hat 'Card' is drawn without its texture: ") and "object at" not in found.text
        assert found in check_head(head)


def test_a_damaged_texture_of_the_head_itself_is_found_with_what_to_do() -> None:
    for data, faults in ((picture(RED), 0), (picture(RED, (300, 300))[:-200], 1), (b"\x89PNG", 1)):
        head = wearing(picture(RED))
        head.texture = HeadTexture(data, (0.5, 0.5, 0.5), {})
        found = list(damaged_textures(head))
        assert len(found) == faults
        assert all("skin and eyes are drawn without" in one.text and FILE in one.hint for one in found)
        assert not faults or found[0] in check_head(head)


def test_nothing_is_known_of_textures_without_pillow(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(data: bytes) -> None:
        raise ImportError(data)

    monkeypatch.setattr("surface.check.accessories.decoded", missing)
    head = wearing(b"\x89PNG")
    head.texture = HeadTexture(b"\x89PNG", (0.5, 0.5, 0.5), {})
    assert list(damaged_textures(head)) == []
