"""Colours of faces: base colour and texture of their material, sampled all over them."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.pictures import eight_bits
from surface.fit.source.mesh import FitMesh, triangles
from surface.readers.meshdata import Material, MeshData, linear

LARGEST = 1024  # pixels of a side that are kept: colours of areas need no more
MOST_PIXELS = 64_000_000  # of a picture that is decoded at all


@dataclass(frozen=True)
class Samples:
    """Points on faces: positions (m, 3) on the mesh, linear RGB and opacity (m, 4), area that each stands for (m,)."""

    points: Floats
    colour: Floats
    weight: Floats


def sample_colours(
    mesh: FitMesh, faces: Ints, *, steps: int = 4, tint: Floats | None = None
) -> Samples | None:  # fmt: skip
    """Samples all over faces (k,) of materials whose colour is known; None where none is.

    steps : a triangle gets (steps + 1) (steps + 2) / 2 of them. tint : (n, 3) linear RGB of the mesh's vertices, by
    which colours of materials are multiplied.
    """
    if (not mesh.materials and tint is None) or not len(faces):
        return None
    pieces, materials = mesh.piece[faces], mesh.materials or (None,) * (int(mesh.piece.max(initial=0)) + 1)
    found = [_of_piece(mesh, faces[pieces == k], materials[k], steps, tint) for k in np.unique(pieces)]
    own = [s for s in found if s is not None]
    if not own:
        return None
    return Samples(*(np.concatenate([getattr(s, key) for s in own]) for key in ("points", "colour", "weight")))


def opacity_at(material: Material, uv: Floats) -> Floats:
    """(m,) opacity of a material, 0..1, at texture coordinates (m, 2); its own where its texture cannot be read."""
    picture = linear_picture(material.texture) if material.texture is not None else None
    own = np.full(len(uv), material.colour[3])
    return own if picture is None else own * _looked_up(picture, material.in_picture(uv))[:, 3]


def tinted(mesh: MeshData) -> tuple[Material | None, ...]:
    """The materials of a mesh's pieces; those without a texture that have colours of vertices get their median."""
    if mesh.colours is None:
        return mesh.materials
    every = mesh.materials or (None,) * len(mesh.pieces)
    out: list[Material | None] = []
    for k, material in enumerate(every):
        used = np.unique(mesh.faces[mesh.piece == k])
        own, old = mesh.colours[used[used >= 0]], material or Material()
        if old.texture is None and len(own) and not (own == 1.0).all():
            r, g, b = (np.median(own, axis=0) * old.colour[:3]).tolist()
            material = replace(old, colour=(r, g, b, old.colour[3]))
        out.append(material)
    return tuple(out)


def _of_piece(
    mesh: FitMesh, faces: Ints, material: Material | None, steps: int, tint: Floats | None
) -> Samples | None:  # fmt: skip
    if material is None and tint is None:
        return None
    material = material or Material()
    picture = linear_picture(material.texture) if material.texture is not None else None
    mapped = bool((mesh.face_uv[faces][:, :3] >= 0).all()) and len(mesh.uv) > 0
    plain = tint is None and material.colour[:3] == (1.0, 1.0, 1.0)
    if picture is None and (material.texture is not None or plain):
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
    if tint is not None:
        colour[:, :3] *= np.einsum("sk,tkc->tsc", share, tint[tri]).reshape(-1, 3)
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


def average_colour(data: bytes) -> Floats | None:
    """(3,) mean linear RGB of what is not clear of an encoded picture; None where it or Pillow cannot be read."""
    picture = linear_picture(data)
    if picture is None or not picture[..., 3].any():
        return None
    mean: Floats = np.average(picture[..., :3].reshape(-1, 3), axis=0, weights=picture[..., 3].ravel())
    return mean


def linear_picture(data: bytes, largest: int = LARGEST) -> Floats | None:
    """(h, w, 4) linear RGB and opacity of an encoded picture, reduced to ``largest`` pixels to each side; None where it
    or Pillow cannot be read."""
    try:
        from PIL import Image  # optional: the extra view

        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > MOST_PIXELS:
                return None
            image.draft("RGB", (largest, largest))
            small = eight_bits(image).convert("RGBA")
            small.thumbnail((largest, largest))
            pixels = np.asarray(small, float) / 255.0
    except (ImportError, OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None
    pixels[..., :3] = linear(pixels[..., :3])
    return pixels


def filtered(picture: Floats, at: Floats) -> Floats:
    """(m, 4) a picture (h, w, 4) at places (m, 2), 0..1 right and down, linear between its pixels; pictures repeat.

    Colours are weighted by opacity: painters leave any colour where a picture is clear.
    """
    picture = np.concatenate([picture[..., :3] * picture[..., 3:], picture[..., 3:]], axis=-1)
    size = np.array(picture.shape[1::-1])
    place = at * size - 0.5
    low = np.floor(place).astype(np.int64)
    x, y = (place - low).T[..., None]
    (left, top), (right, bottom) = (low % size).T, ((low + 1) % size).T
    above = (1.0 - x) * picture[top, left] + x * picture[top, right]
    below = (1.0 - x) * picture[bottom, left] + x * picture[bottom, right]
    mixed: Floats = (1.0 - y) * above + y * below
    mixed[:, :3] /= np.maximum(mixed[:, 3:], 1e-9)
    return mixed


def _looked_up(picture: Floats, at: Floats) -> Floats:
    """(m, 4) the pixels at places (m, 2), 0..1 right and down; pictures repeat."""
    height, width = picture.shape[:2]
    x = np.floor((at[:, 0] % 1.0) * width).astype(np.int64) % width
    y = np.floor((at[:, 1] % 1.0) * height).astype(np.int64) % height
    found: Floats = picture[y, x]
    return found
