"""How deep a mesh's skin passes through itself, to tell what a fit does from what it follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from surface.base.arrays import Bools, Ints
from surface.check.crossings import Crossings
from surface.check.overlaps import LINING, MAX_DEPTH_MM, MIN_DEPTH_MM, Overlap
from surface.fit.measures.dense import faces_of
from surface.fit.measures.mesh_pose import displacement
from surface.fit.points.report import NEUTRAL, FittedPart
from surface.fit.source.mesh import FitMesh, triangles
from surface.head.model.data import HeadData

SKIN = "skin"
NEAR_MM = 8.0  # at usual size: what lies no further from a place of the head is the same place


class MeshOverlaps:
    """Measures overlaps of a head's skin with itself in the mesh that it was fitted to.

    sources : by parameter, the shapes of the mesh that add up to it. parts : the fitted ones. scale : size of the head
    relative to a usual one.
    """

    def __init__(
        self, head: HeadData, mesh: FitMesh, sources: Mapping[str, Sequence[int]], parts: Sequence[FittedPart],
        scale: float,
    ) -> None:  # fmt: skip
        self._head, self._mesh, self._sources, self._scale = head, mesh, sources, scale
        material = {p.name: p.material for p in head.parts}
        own = [(faces_of(mesh, p.chart), material.get(p.name)) for p in parts]
        skin, lining = (_triangles(mesh, [faces for faces, m in own if m == wanted]) for wanted in (SKIN, LINING))
        self._kind = np.repeat([0, 1], [len(skin), len(lining)])
        self._triangles = np.concatenate([skin, lining])

    def depth(self, overlap: Overlap) -> float:
        """How deep, mm, the mesh's skin lies in itself at the place and in the shape of an overlap; 0 where it does
        not, and of overlaps with anything else than skin."""
        if overlap.material != SKIN or not len(self._triangles):
            return 0.0
        rest, scale = self._mesh.vertices, self._scale
        meets = np.array([[True, False], [False, False]])
        found = Crossings(rest, self._triangles, np.arange(len(rest)), self._kind, meets)
        at = rest + displacement(self._mesh, self._sources, overlap.shape or NEUTRAL, self._head.jaw)
        rows, depth = found.depths(found.pairs(at), 0, 0, MAX_DEPTH_MM * scale, MIN_DEPTH_MM * scale, lining=1)
        near = np.linalg.norm(rest[rows] - np.array(overlap.at), axis=1) < NEAR_MM * scale
        return float(depth[near].max(initial=0.0))


def _triangles(mesh: FitMesh, faces: Sequence[Bools]) -> Ints:
    """(t, 3) triangles of the faces that any of some masks (f,) choose."""
    chosen = np.any([*faces, np.zeros(len(mesh.faces), bool)], axis=0)
    return triangles(mesh.faces[chosen])
