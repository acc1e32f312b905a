"""Mesh data as read from a file, before units and axes are known, with checks of file and mesh size."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.errors import FitError
from surface.base.files import DATA_LIMIT, read_file, reading

OTHER_PICTURE = "its picture is missing, or is no PNG, JPEG or WebP"
PICTURES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}  # by their first bytes
MAX_VERTICES = 400_000
MAX_MOVES = 40_000_000  # vertices times shapes; each takes 24 bytes


@dataclass(frozen=True)
class Material:
    """What a file says of the colour of its faces; textures stay as they are encoded.

    name : of the material in the file; may be "".
    colour : linear RGB and opacity, by which the texture's colour is multiplied.
    texture : a whole PNG, JPEG or WebP file of sRGB colours; None without one. mime : its kind, for example
        ``image/png``; "" where the file does not say.
    alpha : ``OPAQUE``, ``MASK`` (nothing below ``cutoff`` is drawn) or ``BLEND``.
    two_sided : whether backs of faces are drawn, too; so they are where the file does not say.
    image_of_uv : (2, 3) from (u, v, 1) of the mesh, v up, to x to the right and y down in pictures of size 1; pictures
        repeat beyond that. See :meth:`in_picture`.
    lost : why a texture that the file names is none here; "" where it names none.
    """

    name: str = ""
    colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: bytes | None = None
    mime: str = ""
    alpha: str = "OPAQUE"
    cutoff: float = 0.5
    image_of_uv: tuple[tuple[float, float, float], tuple[float, float, float]] = ((1.0, 0.0, 0.0), (0.0, -1.0, 1.0))
    two_sided: bool = True
    lost: str = field(default="", compare=False)

    def in_picture(self, uv: Floats) -> Floats:
        """Return places (t, 2) of texture coordinates (t, 2) in the texture: 0..1 to the right, 0..1 down."""
        matrix = np.array(self.image_of_uv)
        out: Floats = uv @ matrix[:, :2].T + matrix[:, 2]
        return out


@dataclass(frozen=True)
class Expression:
    """A named expression that a file makes of its shapes: ``binds`` are names of shapes, and how much of each."""

    name: str
    binds: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class MeshData:
    """A mesh in the unit and axes of its file.

    vertices : (n, 3) float64.
    faces : (f, 4) int64, -1 fills the last place of a triangle.
    uv : (t, 2) float64, v up; face_uv : (f, 4) int64 into ``uv``; all -1 where a face has no texture coordinates.
    names : k shape names; deltas : (k, n, 3) float64.
    piece : (f,) int64 into ``pieces``, the names of the objects or materials that faces belong to.
    materials : one for each of ``pieces``, None where the file gives it none; empty where the format has none.
    expressions : what the file makes of its shapes.
    colours : (n, 3) linear RGB of vertices; None where the file has none.
    """

    vertices: Floats
    faces: Ints
    uv: Floats
    face_uv: Ints
    names: tuple[str, ...]
    deltas: Floats
    piece: Ints
    pieces: tuple[str, ...]
    materials: tuple[Material | None, ...] = ()
    expressions: tuple[Expression, ...] = ()
    colours: Floats | None = None


def linear(srgb: Floats) -> Floats:
    """Return linear intensities of sRGB ones, 0..1 (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb(intensity: Floats) -> Floats:
    """Return sRGB intensities of linear ones, 0..1 (IEC 61966-2-1)."""
    bright = 1.055 * np.maximum(intensity, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.where(intensity <= 0.0031308, 12.92 * intensity, bright)


def kind_of_picture(data: bytes) -> str:
    """Return the MIME type of a picture by its first bytes; "" for one that is not PNG, JPEG or WebP."""
    return next((kind for start, kind in PICTURES.items() if data.startswith(start)), "")


def check_size(where: str, vertices: int, shapes: int) -> None:
    """Refuse a mesh that would not fit into memory, before arrays are allocated for it.

    Raises FitError: naming the file and the number that is too large.
    """
    if vertices > MAX_VERTICES:
        raise FitError(f"{where}: {vertices} vertices; {MAX_VERTICES} are the most", hint="decimate the mesh first")
    if vertices * shapes > MAX_MOVES:
        raise FitError(f"{where}: {shapes} shapes of {vertices} vertices are too many",
                       hint="leave out shapes that are not ARKit's, or decimate the mesh")  # fmt: skip


def read_bytes(path: Path) -> bytes:
    """Return the content of a file that is not too large. Raises FitError: missing, unreadable or too large."""
    if not os.path.exists(path):
        raise FitError(f"{path}: no such mesh file", hint="give the path of a .glb, .gltf, .vrm, .obj or .npz mesh")
    with reading(path, FitError):
        return read_file(path, DATA_LIMIT)
