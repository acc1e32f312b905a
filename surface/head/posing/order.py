"""Arrays by vertex that are kept beside a head belong to one order of its vertices: a checksum says to which.

It is worked out from whole numbers alone, so it is the same on every machine.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array
from surface.base.errors import HeadFileError
from surface.head.model.sidecar import Sidecar
from surface.head.posing.part import HeadPart

STEPS = 1 << 14  # of u and v per unit
OFFSET = 1 / 3  # of a step: halves, quarters and so on never lie between two steps, where a last bit would decide


def checksum(triangles: NDArray[np.integer], uv: NDArray[np.floating]) -> int:
    """A number that changes with the order of vertices: of ``triangles (t, 3)`` and of ``uv (m, 2)`` in steps."""
    places = np.floor(np.asarray(uv, np.float64) * STEPS + OFFSET)
    check = zlib.crc32(np.ascontiguousarray(triangles, "<i4").tobytes())
    return zlib.crc32(np.ascontiguousarray(places, "<i4").tobytes(), check)


def checksums(parts: Iterable[HeadPart]) -> dict[str, int]:
    """Of every part's tessellation, by the part's name."""
    return {part.name: checksum(part.mesh.triangles, part.mesh.uv) for part in parts}


def matching_arrays(kept: Sidecar, parts: Iterable[HeadPart]) -> dict[str, Array]:
    """The arrays of a file that belong to these parts as they are tessellated.

    A part that is tessellated anew when the head is loaded, for another budget, loses its arrays: they were made for
    the mesh in the head's file.

    Raises
    ------
    HeadFileError : the file was made for another mesh than the one in the head's file.
    """
    arrays = dict(kept.arrays)
    for part in parts:
        if kept.checks.get(part.name) in (None, checksum(part.mesh.triangles, part.mesh.uv)):
            continue
        if part.stored:
            folder = kept.path.parent
            raise HeadFileError(
                f"{kept.path}: was made for another mesh of part {part.name!r} than head.npz holds",
                hint=f"delete {kept.path}, or make the head again: omote fit MESH -o {folder}",
            )
        arrays = {k: v for k, v in arrays.items() if k != part.name and not k.startswith(f"{part.name}/")}
    return arrays
