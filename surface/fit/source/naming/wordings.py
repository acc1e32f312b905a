"""Read one name of a shape: which parameter it means in some vocabulary, or which vowel, viseme or mood.

The vocabularies are ``names.toml`` and ``presets.toml`` beside this module.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from surface.base import files

SIDES = {"l": "Left", "left": "Left", "lft": "Left", "r": "Right", "right": "Right", "rgt": "Right"}
SIDES |= {"左": "Left", "右": "Right"}
CORNERS = {a + b for a in "udtb" for b in "lr"} | {
    b + a for a in "udtb" for b in "lr"
}  # one word for a part and a side
WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|左|右|[^\W\d_a-zA-Z左右]+")
COPY = re.compile(r"(?:\.\d+|_0\d\d|[._ ]copy|[._ ]clone)$", re.IGNORECASE)  # suffixes of duplicates
NUMBERED = re.compile(r"(?<![A-Za-z])[A-Z]\d\d(?=_)")  # Character Creator numbers its names of ARKit's shapes
LOOK = {"eyelook", "eyeslook"}


@dataclass(frozen=True)
class Meaning:
    """What a name says.

    key : the parameter without its side, as ``mouthFunnel/mouthfunnelup`` for one of the shapes that make it together,
        or a mood or sound of ``presets.toml``.
    side : "Left", "Right" or "". plain : whether it is ARKit's own word for it.
    """

    key: str
    side: str = ""
    plain: bool = False


def read_name(name: str) -> Meaning | None:
    """The parameter that a name means; None where it means none, or could mean several."""
    for words in _ways(name):
        found = _looking(words) or _parameter(words)
        if found is not None:
            return found
    return None


def read_preset(name: str) -> str | None:
    """The mood, vowel or viseme that a name means."""
    return next((key for words in _ways(name) if (key := _presets().get("".join(words)))), None)


def is_junk(name: str) -> bool:
    """Whether a name is that of no expression: the face at rest, or one that a program made up."""
    words = [w for w in _words(name) if not w.isdigit()]
    return "".join(words) in {_joined(way) for way in names_table()["junk"]} or not words


@cache
def names_table() -> dict[str, Any]:
    """``names.toml``."""
    return files.read_toml(Path(__file__).with_name("names.toml"))


@cache
def presets_table() -> dict[str, Any]:
    """``presets.toml``."""
    return files.read_toml(Path(__file__).with_name("presets.toml"))


@cache
def sums() -> dict[str, list[list[str]]]:
    """By parameter: groups of keys of the shapes that make it together."""
    out: dict[str, list[list[str]]] = {}
    for table in _vocabularies(names_table()):
        for key, ways in table.get("sum", {}).items():
            out.setdefault(key, []).append([f"{key}/{_joined(way)}" for way in ways])
    return out


def _vocabularies(table: dict[str, Any]) -> list[dict[str, Any]]:
    return [value for value in table.values() if isinstance(value, dict)]


@cache
def _keys() -> dict[str, str]:
    """Every way to say a parameter, without spaces and sides -> its key."""
    table = names_table()
    out = {key.lower(): key for group in ("sided", "sideways", "whole") for key in table[group]}
    for vocabulary in _vocabularies(table):
        for key, ways in vocabulary.items():
            if isinstance(ways, list):
                out |= {_joined(way): out.get(_joined(way), key) for way in ways}
        for key, ways in vocabulary.get("sum", {}).items():
            out |= {_joined(way): f"{key}/{_joined(way)}" for way in ways if _joined(way) not in out}
    return out


@cache
def _presets() -> dict[str, str]:
    """Every way to say a preset -> its key; a word of several vocabularies has one meaning."""
    return {
        _joined(way): key
        for vocabulary in _vocabularies(presets_table()) for key, ways in vocabulary.items() if isinstance(ways, list)
        for way in ways
    }  # fmt: skip


def _joined(way: str) -> str:
    return way.replace(" ", "").lower()


def _ways(name: str) -> list[list[str]]:
    """Words of a name: all of them, then those after each beginning that means nothing."""
    words = _words(name)
    spans = [(i, j) for i in range(len(words)) for j in range(i + 1, min(i + 3, len(words)))]
    known = [j for i, j in spans if "".join(words[i:j]) in _beginnings()]
    return [words, *(words[j + (words[j].isdigit() and j + 1 < len(words)) :] for j in known)]


@cache
def _beginnings() -> frozenset[str]:
    return frozenset(_joined(way) for way in names_table()["beginnings"])


def _words(name: str) -> list[str]:
    """Words of a name in lower case; everything before the last dot, colon or bar is ignored."""
    bare = re.split(r"[.:|](?=[^.:|]{3})", COPY.sub("", name))[-1]
    words = [w.lower() for w in WORDS.findall(NUMBERED.sub("", bare))]
    return [part for w in words for part in (_halves(w) if w in CORNERS and len(words) > 1 else [w])]


def _halves(corner: str) -> list[str]:
    """``ul`` and ``lu`` as ``u`` and ``l``."""
    return [corner[0], corner[1]] if corner[1] in "lr" else [corner[1], corner[0]]


def _parameter(words: list[str]) -> Meaning | None:
    sides = [SIDES[w] for w in words if w in SIDES]
    base = "".join(w for w in words if w not in SIDES)
    key = _keys().get(base)
    if key is None or len(sides) > 1:
        return None
    return Meaning(key, sides[0] if sides else "", base == key.lower())


def _looking(words: list[str]) -> Meaning | None:
    """Gaze that is named by two sides, the eye's and the direction's: ``Eye_L_Look_R``, ``eyeLookLeftL``."""
    sides = [(k, SIDES[w]) for k, w in enumerate(words) if w in SIDES]
    if len(sides) != 2 or "".join(w for w in words if w not in SIDES) not in LOOK:
        return None
    (first, one), (_, two) = sides
    look = next(k for k, word in enumerate(words) if "look" in word)
    eye, towards = (one, two) if first < look else (two, one)
    return Meaning("eyeLookOut" if eye == towards else "eyeLookIn", eye)
