"""What skin looks like over the (u, v) of a head: textures of its mesh, looked up at every texel of a square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.fit.painting.lookup import looked_up, pixels_of, spread
from surface.fit.painting.raster import covering
from surface.fit.source.chart import in_tile
from surface.fit.source.islands import FaceNumbers, Island, face_numbers, faces_of, texture_corners
from surface.fit.source.mesh import FitMesh, face_of_triangles, triangles
from surface.head.model.texture import TILE

SIDES = 2048, 1024, 512
"""Texels along a tile of the first part, which is the face: as few as its texture has, but not fewer than the last but
one, unless the whole becomes too large."""
OTHERS = 0.5  # of that, texels along tiles of other parts
BLOCK = 8  # texels of a side of a JPEG's blocks, which no two tiles share; as many lie around what is shown
LEAST = 0.2  # of the face's picture that must have colours from a texture
OPAQUE = 0.5  # opacity from which on a texel's colour is the skin's


@dataclass(frozen=True)
class SkinIslands:
    """A part of skin with its islands; ``tiled`` : they are still to be moved into tiles of (u, v) beside each other,
    as :func:`surface.fit.source.chart.make_chart` does."""

    name: str
    islands: Sequence[Island]
    tiled: bool


@dataclass(frozen=True)
class Square:
    """A picture of what an island covers of its tile of (u, v).

    colour : (side, side, 3) linear RGB, u runs to the right and v down. scale : texels along one unit of (u, v).
    origin : (2,) texels from its left and top to where the tile begins. known : share of it that has a colour of a
    texture.
    """

    colour: Floats
    scale: float
    origin: Floats
    known: float = 1.0


def room_for(at: Floats) -> tuple[Floats, int]:
    """Where (2,) the origin of places ``at`` (t, 3, 2), in texels, is in a picture that has room for all of them with
    a block around, and how many texels a side of that has."""
    low = BLOCK * np.floor(at.min(axis=(0, 1)) / BLOCK) - BLOCK
    side = BLOCK * np.ceil((at.max(axis=(0, 1)) - low).max() / BLOCK) + BLOCK
    return -low, int(side)


def skin_squares(
    mesh: FitMesh, parts: Sequence[SkinIslands], colour: Floats, largest: int = SIDES[0]
) -> dict[str, list[Square]]:  # fmt: skip
    """Pictures of each tile of each part; none where the first part, the face, has hardly any texture.

    colour : (3,) linear RGB of what has no texture. largest : texels along a tile that no tile has more of.
    """
    numbers, out = face_numbers(mesh), dict[str, list[Square]]()
    face = _placed(parts[0], 0)
    whole = min(largest, SIDES[0] if _density(mesh, face, numbers) > SIDES[1] else SIDES[1])
    for part in parts:
        side = int(OTHERS * whole) if out else whole
        made = [_square(mesh, part, k, numbers, side, colour) for k in range(len(part.islands))]
        if not out and made[0].known < LEAST:
            return {}
        out[part.name] = made
    return out


def _placed(part: SkinIslands, k: int) -> Island:
    """The k-th island of a part as it lies in (u, v)."""
    return in_tile(part.islands[k], k) if part.tiled else part.islands[k]


def _sources(mesh: FitMesh, island: Island, numbers: FaceNumbers) -> tuple[Ints, Ints]:
    """Of each of an island's triangles the mesh's face (t,), -1 without one, and rows (t, 3) of ``mesh.uv``."""
    own = faces_of(island, numbers)
    return own[face_of_triangles(island.faces)], texture_corners(mesh, island, own)


def _density(mesh: FitMesh, island: Island, numbers: FaceNumbers) -> float:
    """How many pixels of its textures lie along one unit of an island's (u, v): the median of its triangles; 0 without
    a texture that can be read."""
    faces, rows = _sources(mesh, island, numbers)
    known = (faces >= 0) & (rows >= 0).all(axis=1)
    if not known.any():
        return 0.0
    sizes = np.array([pixels_of(m) if m is not None else 0.0 for m in mesh.materials])
    areas = _areas(mesh.uv[rows[known]]), _areas(island.uv[triangles(island.faces)[known]])
    ratio = areas[0] * sizes[mesh.piece[faces[known]]] / np.maximum(areas[1], 1e-12)
    return float(np.sqrt(np.median(ratio)))


def _areas(corner: Floats) -> Floats:
    """(t,) areas of triangles (t, 3, 2)."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    areas: Floats = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return areas


def _square(
    mesh: FitMesh, part: SkinIslands, k: int, numbers: FaceNumbers, scale: int, colour: Floats
) -> Square:  # fmt: skip
    """One tile, of which a whole one would have ``scale`` texels to a side. Beside its island, and where its texture is
    clear, it has the colours that are nearest."""
    island = _placed(part, k)
    faces, rows = _sources(mesh, island, numbers)
    at = (island.uv[triangles(island.faces)] - [TILE * k, 0.0]) * scale
    origin, side = room_for(at)
    owner, share = covering(np.ascontiguousarray(at + origin), side, side)
    seen = owner >= 0
    rgba = np.zeros((side, side, 4))
    rgba[seen] = looked_up(mesh, faces[owner[seen]], rows[owner[seen]], share[seen])
    known = rgba[..., 3] >= OPAQUE
    if not known.any():
        return Square(np.tile(colour, (side, side, 1)), scale, origin, 0.0)
    return Square(spread(rgba[..., :3], known), scale, origin, float(known.mean()))
