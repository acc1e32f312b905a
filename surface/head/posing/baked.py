"""Read, write and apply what is baked for a head's meshes: shade, which is the share of the sky that each vertex sees
(``occlusion.npz``), decimated triangles (``decimated.npz``), and where the grain of skin lies (``grain.npz``).

These files belong to one order of the vertices, which a checksum per part identifies; parts that are tessellated in
another way, and heads without the files, are drawn unshaded and with all their triangles.

Shade under ``PART`` is (m, 1); there may be more: where the sky lies, ``PART/visible`` (m, 4), and how thin the flesh
is, ``PART/thin`` (m, 1), 0 thick. Triangles are ``PART/full`` and, coarser, ``PART/fast``, both (k, 3).
Grain under ``PART`` is (m, 2).
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Array, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.sidecar import Sidecar, read_sidecar, sidecar_path, write_sidecar
from surface.head.posing.part import HeadPart
from surface.mesh.mesh import Mesh

SHADE, DECIMATED, GRAIN = "occlusion.npz", "decimated.npz", "grain.npz"
LEVELS = ("full", "fast")
GRAIN_STEPS = 1 << 10  # per tile of the grain's texture
STEPS = 1 << 14  # per unit of u and v
OFFSET = 1 / 3  # of a step, so that dyadic fractions never lie on the border of two steps, where rounding would decide
Shares = Mapping[str, NDArray[np.floating]]
Triangles = NDArray[np.int32]
Unpacked = TypeVar("Unpacked")


class Meshed(Protocol):
    """What a file of baked arrays is checked against: a part's name and mesh, and whether that was stored."""

    @property
    def name(self) -> str: ...
    @property
    def mesh(self) -> Mesh: ...
    @property
    def stored(self) -> bool: ...


def checksum(triangles: NDArray[np.integer], uv: NDArray[np.floating]) -> int:
    """Return CRC-32 of ``triangles (t, 3)`` and of ``uv (m, 2)`` in whole steps, so that it is the same on every
    machine."""
    places = np.floor(np.asarray(uv, np.float64) * STEPS + OFFSET)
    check = zlib.crc32(np.ascontiguousarray(triangles, "<i4").tobytes())
    return zlib.crc32(np.ascontiguousarray(places, "<i4").tobytes(), check)


def checksums(parts: Iterable[HeadPart]) -> dict[str, int]:
    """Return checksum of every part's tessellation, by the part's name."""
    return {part.name: checksum(part.mesh.triangles, part.mesh.uv) for part in parts}


def read_baked(
    head: str | Path, file: str, parts: Iterable[Meshed], unpack: Callable[[Array], Unpacked]
) -> dict[str, Unpacked]:  # fmt: skip
    """Return the arrays of a file beside a head, unpacked, that belong to these parts as they are tessellated; empty
    where there is no such file.

    Raises HeadFileError: the file is damaged, of a newer version, or was made for another mesh of a part.
    """

    def matching(stored: Sidecar) -> dict[str, Unpacked]:
        arrays = dict(stored.arrays)
        for part in parts:
            if stored.checks.get(part.name) in (None, checksum(part.mesh.triangles, part.mesh.uv)):
                continue
            if part.stored:  # else it was tessellated again, for another budget than the file's
                why = f"was made for another mesh of part {part.name!r} than head.npz holds"
                raise HeadFileError(f"{path}: {why}", hint=f"{hint} MESH -o {path.parent}")
            arrays = {k: v for k, v in arrays.items() if k != part.name and not k.startswith(f"{part.name}/")}
        return {name: unpack(array) for name, array in arrays.items()}

    path = sidecar_path(head, file)
    hint = f"delete {path}, or make the head again: omote fit"
    return read_sidecar(path, matching, hint) or {}


def read_shade(head: str | Path, parts: Iterable[Meshed] = ()) -> dict[str, Floats32]:
    """Return shares (m, k), 0..1, by the name they are stored under; empty where the head has no such file.

    head : the head's folder or its head.toml.
    parts : what the shares are for; those of another tessellation are left out.

    Raises HeadFileError: the file is damaged, of a newer version, or was made for another mesh of a part.
    """
    return read_baked(head, SHADE, parts, _shares)


def _shares(stored: Array) -> Floats32:
    share: Floats32 = stored.reshape(len(stored), -1).astype(np.float32) / np.float32(255)
    return share


def write_shade(head: str | Path, shares: Shares, parts: Iterable[HeadPart] = ()) -> Path:
    """Write shares (m, k), 0..1, of ``parts`` to the head's folder; returns the file's path."""
    packed = {name: np.rint(np.clip(np.squeeze(s), 0.0, 1.0) * 255.0).astype(np.uint8) for name, s in shares.items()}
    return write_sidecar(shade_path(head), packed, checksums(parts))


def shade_path(head: str | Path) -> Path:
    """Return the path of a head's shade."""
    return sidecar_path(head, SHADE)


def apply_shade(parts: Iterable[HeadPart], shares: Shares) -> None:
    """Multiply the parts' ``occlusion`` attribute by their shares, where these fit; it stays at least at what is
    painted as ``occlusion_floor``."""
    for part in parts:
        share = shares.get(part.name)
        if share is not None and share.shape == (len(part.vertices), 1):
            painted = part.attributes.get("occlusion", np.float32(1.0))
            floor = part.attributes.get("occlusion_floor", np.float32(0.0))
            part.attributes["occlusion"] = np.maximum(painted * share, floor).astype(np.float32)
        for name in ("visible", "thin"):
            more = shares.get(f"{part.name}/{name}")
            if more is not None and len(more) == len(part.vertices):
                part.attributes[name] = more


def read_decimated(head: str | Path, parts: Iterable[Meshed] = ()) -> dict[str, Triangles]:
    """Return triangles (k, 3) by "PART/LEVEL", and :func:`tessellation_key` under "PART"; errors as
    :func:`read_shade`.
    """
    return read_baked(head, DECIMATED, parts, lambda stored: stored.astype(np.int32))


def write_decimated(head: str | Path, parts: Iterable[HeadPart], decimated: Mapping[str, Triangles]) -> Path:
    """Write triangles by "PART/LEVEL" to the head's folder, as the narrowest type; returns the file's path."""
    own = list(parts)
    packed: dict[str, Array] = {part.name: tessellation_key(part) for part in own}
    for name, triangles in decimated.items():
        packed[name] = triangles.astype(np.uint16 if triangles.max(initial=0) < 1 << 16 else np.uint32)
    return write_sidecar(sidecar_path(head, DECIMATED), packed, checksums(own))


def tessellation_key(part: HeadPart) -> Triangles:
    """Return three integers that identify a part's mesh with its seams: numbers of vertices and triangles, and a sum
    over these.
    """
    check = zlib.crc32(np.ascontiguousarray(part.triangles, np.int32).tobytes()) & 0x7FFFFFFF
    return np.array([len(part.vertices), len(part.triangles), check], np.int32)


def apply_decimated(parts: Iterable[HeadPart], decimated: Mapping[str, Triangles]) -> None:
    """Set the ``decimated`` triangles by level of the parts whose meshes they were made for."""
    for part in parts:
        if np.array_equal(decimated.get(part.name, ()), tessellation_key(part)):
            found = {level: decimated.get(f"{part.name}/{level}") for level in LEVELS}
            part.decimated = {
                level: t for level, t in found.items() if t is not None and _is_valid(t, len(part.vertices))
            }


def _is_valid(triangles: Triangles, vertices: int) -> bool:
    """Whether there are any triangles and all indices are in range."""
    shaped = triangles.ndim == 2 and triangles.shape[1] == 3 and len(triangles) > 0
    return bool(shaped and triangles.min() >= 0 and triangles.max() < vertices)


def read_grain(head: str | Path, parts: Iterable[Meshed] = ()) -> dict[str, Floats32]:
    """Return texture coordinates (m, 2) of the grain by part, in tiles; errors as :func:`read_shade`."""
    return read_baked(head, GRAIN, parts, _tiles)


def _tiles(stored: Array) -> Floats32:
    """Return the coordinates. Raises ValueError: the array is damaged."""
    if stored.ndim != 2 or stored.shape[1] != 2 or stored.dtype != np.int16:
        raise ValueError(f"holds an array of shape {stored.shape} and type {stored.dtype}, expected (any, 2) int16")
    return (stored / np.float32(GRAIN_STEPS)).astype(np.float32)


def write_grain(head: str | Path, laid: Shares, parts: Iterable[HeadPart]) -> Path:
    """Write texture coordinates (m, 2), in tiles, of ``parts`` to the head's folder; returns the file's path."""
    limits = np.iinfo(np.int16)
    packed = {n: np.clip(np.rint(uv * GRAIN_STEPS), limits.min, limits.max).astype(np.int16) for n, uv in laid.items()}
    return write_rows(sidecar_path(head, GRAIN), packed, parts)


def apply_grain(parts: Iterable[HeadPart], laid: Mapping[str, Floats32]) -> None:
    """Set the ``grain`` attribute (m, 2) of the parts that it was laid out for."""
    set_attribute(parts, "grain", laid)


def set_attribute(parts: Iterable[HeadPart], attribute: str, rows: Mapping[str, Floats32]) -> None:
    """Set an attribute of the parts for which there are rows (m, ...), one for each vertex, by part."""
    for part in parts:
        found = rows.get(part.name)
        if found is not None and len(found) == len(part.vertices):
            part.attributes[attribute] = found


def write_rows(path: Path, packed: Mapping[str, Array], parts: Iterable[HeadPart]) -> Path:
    """Write arrays (m, ...) by part to a file beside a head, with checksums of the meshes that they belong to; returns
    the path. Raises HeadFileError: it cannot be written."""
    return write_sidecar(path, packed, {name: check for name, check in checksums(parts).items() if name in packed})
