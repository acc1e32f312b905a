"""Which part of a head is its face: lids and lips say so, then its name, then its size."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ball_head import BallHead

from controller.face.fit_colours import figures_of
from surface.check.subject import Subject
from surface.fit.transfer import colours
from surface.head.model.face import face_of
from surface.head.posing.fit_error import ATTRIBUTE
from surface.view.scene.openings import Openings


def part(name: str, count: int, material: str = "skin") -> Any:
    vertices = np.zeros((count, 3), np.float32)
    attributes = {ATTRIBUTE: np.full((count, 1), 0.25)}
    triangles = np.zeros((0, 3), np.int64)
    return SimpleNamespace(
        name=name, material=material, vertices=vertices, attributes=attributes, triangles=triangles, follows="skin"
    )


def contact(name: str) -> Any:
    return SimpleNamespace(part=name)


MASK, BACK, NECK, HAIR = part("mask", 40), part("face", 30), part("neck", 90), part("hair", 200, "hair")
EVERY = [HAIR, NECK, BACK, MASK]


@pytest.mark.parametrize(
    ("parts", "contacts", "face"),
    [
        (EVERY, [contact("mask")], MASK),
        (EVERY, [contact("face"), contact("mask"), contact("mask")], MASK),
        (EVERY, [contact("hair")], BACK),
        (EVERY, [], BACK),
        ([HAIR, MASK, NECK], [], NECK),
        ([HAIR], [contact("hair")], None),
        ([], [], None),
    ],
)
def test_lids_and_lips_say_which_skin_is_the_face_then_its_name_then_its_size(parts, contacts, face) -> None:
    assert face_of(parts, contacts) is face


@pytest.mark.parametrize("contacts", [[contact("mask")], [contact("neck"), contact("neck"), contact("mask")], []])
def test_all_who_ask_get_the_same_answer(contacts, monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture's shader of lids, the checks, the figures of the fit error, and the colours taken from a scan."""
    face = face_of(EVERY, contacts)
    assert face is not None
    data = SimpleNamespace(contacts=contacts, paint=[])
    head: Any = SimpleNamespace(
        parts=EVERY, data=data, values=lambda values: values, pose=lambda values: None, contacts=contacts
    )
    assert Openings(EVERY, contacts=contacts)._skin is face
    assert EVERY[Subject(head).skin[0]] is face
    figures = figures_of(head)
    assert figures is not None and figures.part == face.name
    asked: list[Any] = []
    monkeypatch.setattr(colours, "Head", lambda data: head)
    monkeypatch.setattr(colours, "_looked_up", lambda vertices, tree, rgb: (vertices, vertices[:, 0] > 0))
    monkeypatch.setattr(colours, "_front_colour", lambda part, *seen: asked.append(part))
    samples: Any = SimpleNamespace(points=np.zeros((3, 3)), colour=np.ones((3, 4)))
    assert colours.with_colours(data, samples) == (data, []) and asked == [face]  # type: ignore[arg-type]


def test_the_picture_asks_for_the_face_with_the_contacts_of_its_head() -> None:
    """The lids of the eyes are searched for in the part that a contact names, whatever the part is called."""
    head = BallHead()
    head.parts[0].name = "front"
    other = BallHead().parts[0]
    parts = [other, *head.parts]
    assert Openings(parts, contacts=[contact("front")])._skin is head.parts[0]
    assert Openings(parts, contacts=[contact("face")])._skin is other
