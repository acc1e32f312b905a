"""Margins of lids that lie inside an eyeball: out of it they would be crushed against the skin before them.

The margin of a lid, as thick as the lid, stands on the eyeball: it leads from the edge that is seen straight back.
Where a mesh has its eyes inside its lids, the margin's inner rim is moved out of the exact eyeball until it lies on top
of the outer one, and the surface folds there. Such a margin is left out; the lid then ends at the edge that is seen.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes.linings import MIN_RING_VERTICES, on_rim
from surface.fit.points.eyeball import surface_height
from surface.fit.points.lid_seating import AHEAD, LID_MM
from surface.fit.source.mesh import FitMesh, directed_edges

MAX_RINGS = 4  # of vertices, from a hole's rim outwards, that may belong to a margin
MAX_DISTANCE = 1.4  # of margins from an eye's centre, in radii
MIN_STEEPNESS = 0.6  # of an edge's length: its part straight away from the eyeball, where it belongs to a margin
MIN_LIFT = 0.35  # of an edge's length: a rim that is lifted this far comes to lie on the next ring
CORNER_WIDTH = 0.06  # of the opening's width, in which only vertices that would be crushed are left out
MAX_CRUSHED = 0.3  # of a lid's rim: where more of it would be crushed, all of it is left out, so that no teeth remain


def margins(mesh: FitMesh, skin: Bools, centres: Floats, radius: float) -> Ints:
    """Faces of the skin (f,) between the rims of the holes before both eyes, ``centres (2, 3)``, and the edges of their
    lids that are seen.

    From the rim outwards, the vertices of both upper or both lower lids go with all their faces as long as many lie so
    deep in the eyeballs that lifting them out would bring them as high as the next ring, and on top of it.
    """
    eyes = [_Eye(mesh.vertices - centre, radius) for centre in centres]
    filled = np.where(mesh.faces < 0, mesh.faces[:, :1], mesh.faces)
    kept = skin.copy()
    for _ in range(MAX_RINGS):
        a, b = directed_edges(mesh.faces[kept])
        rim = on_rim(a, b, len(mesh.vertices))
        lids = [eye.lids(rim) for eye in eyes]
        crushed = [eye.crushed(a, b, rim) for eye in eyes]
        going = np.zeros(len(rim), bool)
        for k in (0, 1):  # upper, lower
            if (
                np.mean([c[own[k]].mean() if len(own[k]) else 0.0 for c, own in zip(crushed, lids, strict=True)])
                > MAX_CRUSHED
            ):
                for eye, hit, own in zip(eyes, crushed, lids, strict=True):
                    going[own[k][hit[own[k]] | eye.between_corners(own[k], np.concatenate(own))]] = True
        if going.sum() < MIN_RING_VERTICES:
            break
        kept &= ~going[filled].any(axis=1)
    return np.flatnonzero(skin & ~_without_teeth(mesh, kept, skin & ~kept))


class _Eye:
    """Where a mesh's vertices, ``local (n, 3)`` from the centre of an eye of a radius, lie about it."""

    def __init__(self, local: Floats, radius: float) -> None:
        self._local, self._away = local, np.maximum(np.linalg.norm(local, axis=1), 1e-9)
        height = radius * surface_height(local / self._away[:, None], AHEAD) + LID_MM[0]
        self._lift = height - self._away
        self._close = (self._away < MAX_DISTANCE * radius) & (local[:, 2] > 0)

    def lids(self, rim: Bools) -> tuple[Ints, Ints]:
        """Vertices of the rim (n,) of the upper and of the lower lid, which meet in its corners."""
        ids = np.flatnonzero(rim & self._close)
        ids = ids[np.argsort(self._local[ids, 0])]
        if len(ids) < MIN_RING_VERTICES:
            return ids[:0], ids[:0]
        (x0, y0), (x1, y1) = self._local[ids[[0, -1]], :2]
        above = self._local[ids, 1] > np.interp(self._local[ids, 0], [x0, x1], [y0, y1])
        return ids[above], ids[~above]

    def between_corners(self, ids: Ints, rim: Ints) -> Bools:
        """Which of some vertices do not lie in the corners of the rim: there skin behind a margin is further off the
        eyeball, and one could see in between."""
        x = self._local[rim, 0]
        off = np.minimum(self._local[ids, 0] - x.min(), x.max() - self._local[ids, 0])
        return np.asarray(off > CORNER_WIDTH * np.ptp(x))

    def crushed(self, a: Ints, b: Ints, rim: Bools) -> Bools:
        """(n,) which vertices of the rim, lifted out of the eyeball, come as high as one that an edge a -> b (e,) leads
        to from there, straight away from the eyeball."""
        start, end = np.concatenate([a, b]), np.concatenate([b, a])
        out = rim[start] & ~rim[end] & self._close[start]
        start, end = start[out], end[out]
        length = np.linalg.norm(self._local[end] - self._local[start], axis=1)
        rise = self._away[end] - self._away[start]
        found = np.zeros(len(rim), bool)
        found[start[(self._lift[start] > MIN_LIFT * length) & (rise > MIN_STEEPNESS * length)]] = True
        return found


def _without_teeth(mesh: FitMesh, kept: Bools, gone: Bools) -> Bools:
    """(f,) the faces that are kept, but those that stand out alone beside faces that are gone: two of their edges are
    on the rim."""
    kept, touched = kept.copy(), np.zeros(len(mesh.vertices), bool)
    touched[mesh.faces[gone][mesh.faces[gone] >= 0]] = True
    for _ in range(MAX_RINGS):
        ids = np.flatnonzero(kept)
        a, b = directed_edges(mesh.faces[ids])
        single = ~np.isin(a * len(touched) + b, b * len(touched) + a) & touched[a] & touched[b]
        face = np.repeat(np.arange(len(ids)), (mesh.faces[ids] >= 0).sum(axis=1))
        teeth = np.bincount(face[single], minlength=len(ids)) > 1
        if not teeth.any():
            break
        kept[ids[teeth]] = False
        touched[mesh.faces[ids[teeth]][mesh.faces[ids[teeth]] >= 0]] = True
    return kept
