"""What names of nodes, objects and materials say of eyes; the words are in ``eyewords.toml``."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from surface.base import files

WORDS = Path(__file__).with_name("eyewords.toml")
EYE = re.compile(r"Eye|EYE|(?:^|[^a-zA-Z]|left|right|face|(?:^|[^a-zA-Z])[lr])eye")


@cache
def _words() -> dict[str, tuple[str, ...]]:
    return {key: tuple(words) for key, words in files.read_toml(WORDS).items()}


def is_eye(name: str) -> bool:
    """Does a piece of this name belong to an eye? Of ``object/material`` the last that speaks of eyes decides:
    ``Face/EyeWhite`` and ``Eyes/Atlas`` do, ``EyeLeft/Lash`` does not."""
    for part in reversed(re.split(r"[/|:]", name)):
        if _has(part, "other"):
            return False
        if EYE.search(part) or _has(part, "eye"):
            return True
    return False


def is_cover(name: str) -> bool:
    """Is it a part of an eye that does not say how large the eyeball is, as a cornea or a highlight?"""
    return _has(name, "cover")


def is_iris(name: str) -> bool:
    """Is it an iris without its white?"""
    return _has(name, "iris")


def is_beside(name: str) -> bool:
    """Does it name something near an eye that is no part of it, as a lid or a lash?"""
    return _has(name, "other")


def _has(name: str, key: str) -> bool:
    return any(word in name.lower() for word in _words()[key])
