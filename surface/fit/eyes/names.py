"""What names of nodes, objects and materials say of eyes; the words are those of :mod:`surface.fit.source.kinds`."""

from __future__ import annotations

import re

from surface.fit.source.kinds import kind_of

JOINED = re.compile(r"(?:left|right|(?:^|[^a-z])[lr])eyes?(?![a-z])", re.IGNORECASE)  # one word for both
COVERS = ("eye_cover", "highlight", "iris")
SKIN_BESIDE = ("lid", "socket", "eyebag", "eye bag", "eye_bag")


def is_eye(name: str) -> bool:
    """Does a piece of this name, ``object/material``, belong to an eye?"""
    return kind_of(name).rule == "eye" or (
        kind_of(name).rule == "skin" and JOINED.search(name) is not None and not _beside_skin(name)
    )


def is_cover(name: str) -> bool:
    """Is it a part of an eye that does not say how large the eyeball is, as a cornea or a highlight?"""
    return kind_of(name).name in COVERS


def is_iris(name: str) -> bool:
    """Is it an iris without its white?"""
    return kind_of(name).name == "iris"


def is_beside(name: str) -> bool:
    """Does it name something near an eye that is no part of it, as a lid or a lash?"""
    kind = kind_of(name)
    return kind.rule in ("part", "out") or (kind.rule == "skin" and _beside_skin(name))


def _beside_skin(name: str) -> bool:
    return any(word in name.lower() for word in SKIN_BESIDE)
