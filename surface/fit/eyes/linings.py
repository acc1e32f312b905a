"""Linings of lids that a blink leaves where they are: an edge of the opening has to move with the lid before it."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.mesh import FitMesh, directed_edges
from surface.fit.source.names import sources_of

RINGS = 6  # of vertices, from a hole's rim outwards, that may belong to a lining
TIMES, BEHIND = 1.5, 0.1  # a vertex on the rim stays behind if the next ring moves so many times as far, and so
# much further, in radii
FEWEST = 5  # vertices of a ring: a lining goes along a lid, and fewer are a corner
REACH = 1.6  # in radii: linings lie no further from an eye's centre


def linings(mesh: FitMesh, skin: Bools, centre: Floats, radius: float, side: str) -> Ints:
    """Faces of the skin (f,) between the rim of the hole before an eye and the edges of the lids that a blink moves.

    side : "Left" or "Right". From the rim outwards, vertices go with all their faces as long as one in the next ring
    moves further; the lid's edge moves furthest. None go where the mesh has no blink.
    """
    indices = sources_of(mesh.names).get(f"eyeBlink{side}", [])
    if not indices:
        return np.zeros(0, np.int64)
    moved = np.linalg.norm(mesh.deltas[indices].sum(axis=0), axis=1)
    close = np.linalg.norm(mesh.vertices - centre, axis=1) < REACH * radius
    kept = skin.copy()
    for _ in range(RINGS):
        a, b = directed_edges(mesh.faces[kept])
        rim, most = on_rim(a, b, len(moved)), np.zeros(len(moved))
        np.maximum.at(most, np.concatenate([a, b]), np.where(rim, 0.0, moved)[np.concatenate([b, a])])
        behind = rim & close & (most > TIMES * moved + BEHIND * radius)
        if behind.sum() < FEWEST:
            break
        filled = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces)
        kept &= ~behind[filled].any(axis=1)
    return np.flatnonzero(skin & ~kept)


def on_rim(a: Ints, b: Ints, count: int) -> Bools:
    """(count,) vertices of the directed edges a -> b (e,) that have none in the opposite direction."""
    single = ~np.isin(a * count + b, b * count + a)
    out = np.zeros(count, bool)
    out[a[single]] = out[b[single]] = True
    return out
