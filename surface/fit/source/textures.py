"""Colours of faces: base colour and texture of their material, sampled all over them."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.source.mesh import FitMesh, triangles
from surface.readers.meshdata import Material

LARGEST = 1024  # pixels of a side that are kept: colours of areas need no more
MOST_PIXELS = 64_000_000  # of a picture that is decoded at all


@dataclass(frozen=True)
class Samples:
    """Points on faces: positions (m, 3) on the mesh, linear RGB and opacity (m, 4), area that each stands for (m,)."""

    points: Floats
    colour: Floats
    weight: Floats


def sample_colours(mesh: FitMesh, faces: Ints, *, steps: int = 4) -> Samples | None:
    """Samples all over faces (k,) of materials whose colour is known; None where none is.

    steps : a triangle gets (steps + 1) (steps + 2) / 2 of them.
    """
    if not mesh.materials or not len(faces):
        return None
    pieces = mesh.piece[faces]
    found = [_of_piece(mesh, faces[pieces == k], mesh.materials[k], steps) for k in np.unique(pieces)]
    own = [s for s in found if s is not None]
    if not own:
        return None
    return Samples(*(np.concatenate([getattr(s, key) for s in own]) for key in ("points", "colour", "weight")))


def _of_piece(mesh: FitMesh, faces: Ints, material: Material | None, steps: int) -> Samples | None:
    if material is None:
        return None
    picture = _picture(material.texture) if material.texture is not None else None
    mapped = bool((mesh.face_uv[faces][:, :3] >= 0).all()) and len(mesh.uv) > 0
    if picture is None and (material.texture is not None or material.colour[:3] == (1.0, 1.0, 1.0)):
        return None  # a texture that cannot be read, or nothing said
    tri, tri_uv = triangles(mesh.faces[faces]), triangles(mesh.face_uv[faces])
    share = _inside(steps)
    corner = mesh.vertices[tri]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    points = np.einsum("sk,tkx->tsx", share, corner).reshape(-1, 3)
    colour = np.tile(np.array(material.colour), (len(points), 1))
    if picture is not None:
        if not mapped:
            return None
        uv = np.einsum("sk,tkx->tsx", share, mesh.uv[tri_uv]).reshape(-1, 2)
        colour = colour * _looked_up(picture, material.in_picture(uv))
    if material.alpha == "OPAQUE":
        colour[:, 3] = 1.0
    elif material.alpha == "MASK":
        colour[:, 3] = colour[:, 3] >= material.cutoff
    return Samples(points, colour, np.repeat(area / len(share), len(share)))


def _inside(steps: int) -> Floats:
    """(s, 3) shares of a triangle's corners, evenly over it."""
    i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    kept = i + j <= steps
    s, t = (i[kept] + 1 / 3) / (steps + 1), (j[kept] + 1 / 3) / (steps + 1)
    return np.column_stack([1.0 - s - t, s, t])


def _picture(data: bytes) -> Floats | None:
    """(h, w, 4) linear RGB and opacity of an encoded picture; None where it or Pillow cannot be read."""
    try:
        from PIL import Image  # optional: the extra view

        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > MOST_PIXELS:
                return None
            image.draft("RGB", (LARGEST, LARGEST))
            small = image.convert("RGBA")
            small.thumbnail((LARGEST, LARGEST))
            pixels = np.asarray(small, float) / 255.0
    except (ImportError, OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
    pixels[..., :3] = linear(pixels[..., :3])
    return pixels


def linear(srgb: Floats) -> Floats:
    """Linear intensities of sRGB ones, 0..1 (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _looked_up(picture: Floats, at: Floats) -> Floats:
    """(m, 4) the pixels at places (m, 2), 0..1 right and down; pictures repeat."""
    height, width = picture.shape[:2]
    x = np.floor((at[:, 0] % 1.0) * width).astype(np.int64) % width
    y = np.floor((at[:, 1] % 1.0) * height).astype(np.int64) % height
    found: Floats = picture[y, x]
    return found
