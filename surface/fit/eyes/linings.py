"""Find the faces behind a lid's edge that the blink shape hardly moves, so that a fit can leave them out.

Scans and avatars often have a strip of skin that runs from the lid's edge inwards over the eyeball. A blink moves the
edge and leaves that strip behind; the opening that is fitted has to end at the edge, which moves.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.mesh import FitMesh, directed_edges
from surface.fit.source.names import sources_of

MAX_RINGS = 6  # of vertices, from a hole's rim outwards, that may belong to a lining
LAG_FACTOR = 1.5  # a vertex on the rim lags if the next ring moves further than this many times its own way
LAG_RADII = 0.1  # plus this distance, in radii of the eyeball
MIN_RING_VERTICES = 5  # that lag: a lining runs along a lid, fewer are only a corner of the eye
MAX_DISTANCE_RADII = 1.6  # of a lining from the eye's centre


def linings(mesh: FitMesh, skin: Bools, centre: Floats, radius: float, side: str) -> Ints:
    """Faces of the skin (f,) between the rim of the opening in front of an eye and the edges of the lids.

    side : "Left" or "Right". From the rim outwards, vertices that lag behind the next ring in the blink shape are left
    out with all their faces; the lid's edge moves furthest. Empty where the mesh has no blink shape.
    """
    indices = sources_of(mesh.names).get(f"eyeBlink{side}", [])
    if not indices:
        return np.zeros(0, np.int64)
    moved = np.linalg.norm(mesh.deltas[indices].sum(axis=0), axis=1)
    close = np.linalg.norm(mesh.vertices - centre, axis=1) < MAX_DISTANCE_RADII * radius
    kept = skin.copy()
    for _ in range(MAX_RINGS):
        a, b = directed_edges(mesh.faces[kept])
        rim, neighbour = on_rim(a, b, len(moved)), np.zeros(len(moved))
        np.maximum.at(neighbour, np.concatenate([a, b]), np.where(rim, 0.0, moved)[np.concatenate([b, a])])
        lags = rim & close & (neighbour > LAG_FACTOR * moved + LAG_RADII * radius)
        if lags.sum() < MIN_RING_VERTICES:
            break
        filled = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces)
        kept &= ~lags[filled].any(axis=1)
    return np.flatnonzero(skin & ~kept)


def on_rim(a: Ints, b: Ints, count: int) -> Bools:
    """(count,) vertices of the directed edges a -> b (e,) that have none in the opposite direction."""
    single = ~np.isin(a * count + b, b * count + a)
    out = np.zeros(count, bool)
    out[a[single]] = out[b[single]] = True
    return out
