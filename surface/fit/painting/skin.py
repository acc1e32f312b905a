"""What skin looks like over the (u, v) of a head: textures of its mesh, looked up at every texel of a square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats
from surface.fit.painting.lookup import looked_up
from surface.fit.painting.raster import covering
from surface.fit.source.chart import in_tile
from surface.fit.source.islands import FaceNumbers, Island, face_numbers, faces_of, texture_corners
from surface.fit.source.mesh import FitMesh, face_of_triangles, triangles
from surface.fit.source.pictures import filled
from surface.head.model.texture import TILE

SIDE, SMALL_SIDE = 1024, 512
"""Texels along a tile of the first part, which is the face, and of the others."""
FEWEST = 32  # texels along the smallest tile
LEAST = 0.2  # of a tile of the face that must have colours from a texture
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
    """A picture of a tile of (u, v), or of the corner of it that an island covers.

    colour : (side, side, 3) linear RGB, from the left to the right and from the top down, where v is 0.
    reach : share of the tile's width and height that it shows. known : share of it that has a colour of a texture.
    """

    colour: Floats
    reach: float = 1.0
    known: float = 1.0


def skin_squares(mesh: FitMesh, parts: Sequence[SkinIslands], colour: Floats) -> dict[str, list[Square]]:
    """Pictures of each tile of each part; none where the first part, the face, has hardly any texture.

    colour : (3,) linear RGB of what has no texture.
    """
    numbers, out = face_numbers(mesh), dict[str, list[Square]]()
    for part in parts:
        side = SMALL_SIDE if out else SIDE
        made = [_square(mesh, part, k, numbers, side, colour) for k in range(len(part.islands))]
        if not out and made[0].known < LEAST:
            return {}
        out[part.name] = made
    return out


def _square(
    mesh: FitMesh, part: SkinIslands, k: int, numbers: FaceNumbers, side: int, colour: Floats
) -> Square:  # fmt: skip
    """One tile, of which the whole would have ``side`` texels. Beside its island, and where its texture is clear, it
    has the colours that are nearest."""
    island = in_tile(part.islands[k], k) if part.tiled else part.islands[k]
    own = faces_of(island, numbers)
    rows, faces = texture_corners(mesh, island, own), own[face_of_triangles(island.faces)]
    at = (island.uv[triangles(island.faces)] - [TILE * k, 0.0]) * side
    whole, side = side, int(np.clip(np.ceil(at.max()), FEWEST, side))
    owner, share = covering(np.ascontiguousarray(at), side, side)
    seen = owner >= 0
    rgba = np.zeros((side, side, 4))
    rgba[seen] = looked_up(mesh, faces[owner[seen]], rows[owner[seen]], share[seen])
    weight = np.where(rgba[..., 3] >= OPAQUE, 1.0, 0.0)
    if not weight.any():
        return Square(np.tile(colour, (side, side, 1)), side / whole, 0.0)
    return Square(filled(rgba[..., :3] * weight[..., None], weight), side / whole, float(weight.mean()))
