"""Triangles for pictures in a hurry, kept beside the head in ``decimated.npz``: over the same vertices, but fewer.

For each part there are ``PART/full`` and, coarser, ``PART/fast``, both (k, 3). The file belongs to one tessellation;
parts that it does not fit, or a head without it, are drawn with all their triangles.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array
from surface.head.model.sidecar import read_sidecar, sidecar_path, write_sidecar
from surface.head.posing.order import checksums, matching_arrays
from surface.head.posing.part import HeadPart

FILE = "decimated.npz"
LEVELS = ("full", "fast")
Triangles = NDArray[np.int32]


def decimated_path(head: str | Path) -> Path:
    """Where a head's decimated triangles are kept; ``head`` is its folder or its head.toml."""
    return sidecar_path(head, FILE)


def read_decimated(head: str | Path, parts: Iterable[HeadPart] = ()) -> dict[str, Triangles]:
    """Triangles (k, 3) by "PART/LEVEL", and under "PART" what they were made from; empty where there is no such file.

    Raises
    ------
    HeadFileError : the file is damaged, of a newer version, or was made for another mesh of one of ``parts``.
    """
    path = decimated_path(head)
    hint = f"delete {path}, or make the head again: omote fit"
    made = read_sidecar(
        path, lambda kept: {k: v.astype(np.int32) for k, v in matching_arrays(kept, parts).items()}, hint
    )
    return made or {}


def write_decimated(head: str | Path, parts: Iterable[HeadPart], decimated: Mapping[str, Triangles]) -> Path:
    """Keep triangles by "PART/LEVEL" beside the head; returns the file's path."""
    own = list(parts)
    packed: dict[str, Array] = {name: _packed(triangles) for name, triangles in decimated.items()}
    return write_sidecar(
        decimated_path(head), packed | {part.name: tessellation_key(part) for part in own}, checksums(own)
    )


def _packed(triangles: Triangles) -> NDArray[np.unsignedinteger]:
    """The narrowest that holds them."""
    return triangles.astype(np.uint16 if triangles.max(initial=0) < 1 << 16 else np.uint32)


def tessellation_key(part: HeadPart) -> Triangles:
    """What tells one tessellation of a part from another: vertices, triangles and a sum over these."""
    check = zlib.crc32(np.ascontiguousarray(part.triangles, np.int32).tobytes()) & 0x7FFFFFFF
    return np.array([len(part.vertices), len(part.triangles), check], np.int32)


def apply_decimated(parts: Iterable[HeadPart], decimated: Mapping[str, Triangles]) -> None:
    """Give parts their ``decimated`` triangles by level; those of another tessellation are passed over."""
    for part in parts:
        if np.array_equal(decimated.get(part.name, ()), tessellation_key(part)):
            found = {level: decimated.get(f"{part.name}/{level}") for level in LEVELS}
            part.decimated = {
                level: t for level, t in found.items() if t is not None and _indices_valid(t, len(part.vertices))
            }


def _indices_valid(triangles: Triangles, vertices: int) -> bool:
    """Are there any, and do all indices point at something?"""
    shaped = triangles.ndim == 2 and triangles.shape[1] == 3 and len(triangles) > 0
    return bool(shaped and triangles.min() >= 0 and triangles.max() < vertices)
