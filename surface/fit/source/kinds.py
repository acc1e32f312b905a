"""What the pieces of a mesh are, by the names of objects and materials: skin, eye, hair, teeth, clothes and so on.

The table is ``kinds.toml`` beside this module. A name of a piece is ``object/material``, or one of both.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from surface.base import files
from surface.base.arrays import Bools
from surface.fit.source.mesh import FitMesh
from surface.readers.meshdata import MeshData

WORDS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[^\W\d_a-zA-Z]+")
MAX_WORDS = 4  # of one entry of the table
MIN_LETTERS = 5  # of an entry that is also found at the beginning or end of a longer word
SHORT_ENDINGS = (
    "lash",
    "lashes",
    "brow",
    "brows",
    "hair",
)  # shorter entries that are also found at the end of a longer word
WHITE = (1.0, 1.0, 1.0)
SKIN, PROP = "skin", "prop"
MAX_NAMES = 4  # of pieces of one kind that a note lists
FACE_MOTION = 0.5  # of the largest motion: a piece that shapes move this far belongs to the face, whatever its name
SCAFFOLD = 0.01  # of all faces: a prop of fewer is what modellers put at a joint, though it moves with the face
HAIR_MOTION = 0.05  # of the largest motion: hair that shapes move this far is fitted, so that it moves


@dataclass(frozen=True)
class Kind:
    """One row of the table.

    name : "skin", "iris", "hair" and so on. rule : "skin", "part", "eye" or "out", as the table explains.
    material : by which a head draws it; "skin" for what is drawn as no part of its own.
    worn : whether a head keeps it as it is, unless shapes move it.
    colour : linear RGB of what is worn, where the mesh does not say.
    """

    name: str
    rule: str
    material: str
    worn: bool = False
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)


@cache
def kinds() -> dict[str, Kind]:
    """All kinds by name."""
    return {
        name: Kind(
            name, row["rule"], row.get("material", SKIN), row.get("worn", False), tuple(row.get("colour", WHITE))
        )
        for name, row in _table().items()
    }


def kind_of(name: str) -> Kind:
    """The kind of a piece by its name; skin where no word in it is known.

    The material decides where it is anything but skin, then the object. What lies on a person, such as clothes, is
    skin nevertheless where its material says so in words.
    """
    whole, _, material = name.rpartition("/")
    inner, outer = _said(material), _said(whole)
    every = kinds()
    if inner is not None and inner != SKIN:
        return every[inner]
    if outer is None or (inner == SKIN and every[outer].rule == "out"):
        return every[SKIN]
    return every[outer]


def material_of(name: str) -> str:
    """The material by which a head draws a piece of that name."""
    return kind_of(name).material


def kind_name(name: str) -> str:
    """Name of the kind of a piece, by the piece's name."""
    return kind_of(name).name


def is_known(name: str) -> bool:
    """Whether any word in a piece's name is in the table."""
    return any(_said(part) is not None for part in name.split("/"))


def worn_faces(mesh: FitMesh) -> Bools:
    """Which faces (f,) belong to hair, hats, glasses and jewellery that a head keeps as they are: no shapes move them.
    None do where nothing would be left."""
    worn = np.zeros(len(mesh.faces), bool)
    named = [k for k, name in enumerate(mesh.pieces) if kind_of(name).worn]
    far = np.abs(mesh.deltas).max(axis=(0, 2), initial=0.0) if named else np.zeros(0)  # how far each vertex moves
    far[~np.isfinite(far)] = 0.0  # what is damaged is found later
    for k in named:
        own = mesh.piece == k
        used = np.unique(mesh.faces[own])
        least = HAIR_MOTION if kind_of(mesh.pieces[k]).rule == "part" else FACE_MOTION
        moved = far[used[(used >= 0) & (used < len(far))]].max(initial=0.0)
        if not moved or moved < least * far.max():
            worn |= own
    return worn if not worn.all() else np.zeros(len(mesh.faces), bool)


def without_clothes(mesh: FitMesh, worn: Bools | None = None) -> tuple[Bools, list[str]]:
    """Which faces (f,) belong to the person and not to clothes, hats or glasses; and notes on what was left out.

    Names do not count where shapes move the piece as they move the face, but for small props, or where nothing would be
    left. Faces that are
    ``worn`` (f,) are not the person's either, and are kept elsewhere: no note says that they are left out.
    """
    apart = np.zeros(len(mesh.faces), bool) if worn is None else worn
    kept, notes = ~apart, []
    out: dict[str, list[str]] = {}
    for k, name in enumerate(mesh.pieces):
        kind, own = kind_of(name), (mesh.piece == k) & ~apart
        if kind.rule != "out" or not own.any():
            continue
        scaffold = kind.name == "prop" and own.sum() < SCAFFOLD * len(own)
        if _moves(mesh, own) and not scaffold:
            notes.append(f"{name!r}: named as {kind.name}, but shapes move it: kept as skin")
        else:
            kept &= ~own
            out.setdefault(kind.name, []).append(name)
    if not kept.any():
        return ~apart, []
    return kept, notes + [f"{kind} left out: {listed(names)}" for kind, names in out.items()]


def skin_and_eyes(mesh: FitMesh | MeshData, kept: Bools) -> tuple[Bools, list[str]]:
    """Which of the faces ``kept`` (f,) are skin or eyes, not clothes, hair or parts inside the mouth; and notes on what
    was left out. Names do not count where nothing would remain."""
    own, out = kept.copy(), dict[str, list[str]]()
    for k, name in enumerate(mesh.pieces):
        kind, there = kind_of(name), kept & (mesh.piece == k)
        if kind.rule in ("out", "part") and there.any():
            own &= ~there
            out.setdefault(kind.name, []).append(name)
    return (own, [f"{kind} left out: {listed(names)}" for kind, names in out.items()]) if own.any() else (kept, [])


def listed(names: list[str]) -> str:
    """Names of pieces in one line; of very many the first ones, and how many more."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(map(repr, names[:MAX_NAMES])) + more


def piece_kinds(mesh: FitMesh, kept: Bools) -> dict[str, str]:
    """What each object of a mesh is; ``kept`` (f,) are the faces that are not left out."""
    out = {}
    for k, name in enumerate(mesh.pieces):
        own = mesh.piece == k
        if own.any():
            said = kind_name(name).replace("_", " ")
            out[name] = said if kept[own].any() else f"{said}, left out"
    return out


def _moves(mesh: FitMesh, own: Bools) -> bool:
    """Whether shapes move some faces (f,) nearly as far as they move anything."""
    used = np.unique(mesh.faces[own])
    most = np.abs(mesh.deltas).max(initial=0.0)
    used = used[(used >= 0) & (used < len(mesh.vertices))]
    return bool(most > 0 and np.abs(mesh.deltas[:, used]).max(initial=0.0) >= FACE_MOTION * most)


@cache
def _table() -> dict[str, Any]:
    return files.read_toml(Path(__file__).with_name("kinds.toml"))


@cache
def _entries() -> dict[str, str]:
    """Every entry, written together -> its kind."""
    return {word.replace(" ", ""): name for name, row in _table().items() for word in row["words"]}


@cache
def _said(name: str) -> str | None:
    """The kind by the words in one name: the longest word counts, of two the last; skin only where there is no other,
    and scaffolding wherever it is named."""
    words = [w.lower() for w in WORDS.findall(name)]
    spans = [(i, j) for i in range(len(words)) for j in range(i + 1, min(i + MAX_WORDS, len(words)) + 1)]
    found = [(i, j, kind) for i, j in spans if (kind := _entry("".join(words[i:j]), j - i > 1)) is not None]
    outer = [(i, j, k) for i, j, k in found if not any(a <= i and j <= b and b - a > j - i for a, b, _ in found)]
    ranked = [(k == PROP, k != SKIN, sum(map(len, words[i:j])), i, k) for i, j, k in outer]
    return max(ranked)[-1] if ranked else None


def _entry(word: str, several: bool) -> str | None:
    """The kind of an entry that this is; of one word also an entry that it begins or ends with, the longest."""
    if word in _entries() or several:
        return _entries().get(word)
    parts = [e for e in _entries() if _inside(e, word)]
    return _entries()[max(parts, key=len)] if parts else None


def _inside(entry: str, word: str) -> bool:
    if not entry.isascii():
        return entry in word
    long = len(entry) >= MIN_LETTERS and (word.startswith(entry) or word.endswith(entry))
    return long or (entry in SHORT_ENDINGS and word.endswith(entry))
