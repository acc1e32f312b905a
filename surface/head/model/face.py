"""Which part of a head is its face."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Protocol, TypeVar

from surface.head.model.data import Contact

FACE = "face"
"""Name of the part that is the face where a head has neither lids nor lips that say so."""


class DrawnPart(Protocol):
    """What has to be known of a part: its vertices are (m, 3)."""

    name: str
    material: str

    @property
    def vertices(self) -> Any: ...


Part = TypeVar("Part", bound=DrawnPart)


def face_of(parts: Sequence[Part], contacts: Iterable[Contact]) -> Part | None:
    """Return the part that is the face; None without skin.

    It is the skin with the most contacts, of lids and lips; of several, or without any, the one called "face"; without
    such a name the one with the most vertices, of equals the first.
    """
    opened = Counter(contact.part for contact in contacts)
    skins = [part for part in parts if part.material == "skin"]
    return max(skins, key=lambda part: (opened[part.name], part.name == FACE, len(part.vertices)), default=None)
