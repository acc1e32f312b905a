"""Triangles for pictures in a hurry, kept beside the head in ``lean.npz``: over the same vertices, but fewer.

For each part there are ``PART/full`` and, coarser, ``PART/fast``, both (k, 3). The file belongs to one tessellation;
parts that it does not fit, or a head without it, are drawn with all their triangles.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.head.model.beside import beside, read_beside, write_beside
from surface.head.posing.order import belonging, checksums
from surface.head.posing.part import HeadPart

FILE = "lean.npz"
LEVELS = ("full", "fast")
Triangles = NDArray[np.int32]


def lean_path(head: str | Path) -> Path:
    """Where a head's lean triangles are kept; ``head`` is its folder or its head.toml."""
    return beside(head, FILE)


def read_lean(head: str | Path, parts: Iterable[HeadPart] = ()) -> dict[str, Triangles]:
    """Triangles (k, 3) by "PART/LEVEL", and under "PART" what they were made from; empty where there is no such file.

    Raises
    ------
    HeadFileError : the file is damaged, of a newer version, or was made for another mesh of one of ``parts``.
    """
    path = lean_path(head)
    hint = f"delete {path}, or make the head again: omote fit"
    made = read_beside(path, lambda kept: {k: v.astype(np.int32) for k, v in belonging(kept, parts).items()}, hint)
    return made or {}


def write_lean(head: str | Path, parts: Iterable[HeadPart], lean: Mapping[str, Triangles]) -> Path:
    """Keep triangles by "PART/LEVEL" beside the head; returns the file's path."""
    own = list(parts)
    packed: dict[str, NDArray[Any]] = {name: _packed(triangles) for name, triangles in lean.items()}
    return write_beside(lean_path(head), packed | {part.name: made_from(part) for part in own}, checksums(own))


def _packed(triangles: Triangles) -> NDArray[np.unsignedinteger]:
    """The narrowest that holds them."""
    return triangles.astype(np.uint16 if triangles.max(initial=0) < 1 << 16 else np.uint32)


def made_from(part: HeadPart) -> Triangles:
    """What tells one tessellation of a part from another: vertices, triangles and a sum over these."""
    check = zlib.crc32(np.ascontiguousarray(part.triangles, np.int32).tobytes()) & 0x7FFFFFFF
    return np.array([len(part.vertices), len(part.triangles), check], np.int32)


def apply_lean(parts: Iterable[HeadPart], lean: Mapping[str, Triangles]) -> None:
    """Give parts their ``lean`` triangles by level; those of another tessellation are passed over."""
    for part in parts:
        if np.array_equal(lean.get(part.name, ()), made_from(part)):
            found = {level: lean.get(f"{part.name}/{level}") for level in LEVELS}
            part.lean = {level: t for level, t in found.items() if t is not None and _sound(t, len(part.vertices))}


def _sound(triangles: Triangles, vertices: int) -> bool:
    """Are there any, and do all indices point at something?"""
    shaped = triangles.ndim == 2 and triangles.shape[1] == 3 and len(triangles) > 0
    return bool(shaped and triangles.min() >= 0 and triangles.max() < vertices)
