"""Meshes of skin and clothes that are rounder than the stored ones, for large pictures: there the outline of a skull or
a shoulder shows the edges of its triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from surface.base.arrays import Array, Bools, Ints
from surface.head.model.data import HeadData, PartData
from surface.head.model.finer_mesh import FinerMesh
from surface.head.model.light import Coarser
from surface.head.model.meshes import make_surface, tessellate, unpack
from surface.mesh.mesh import Mesh
from surface.mesh.splitedges import split_edges

MAX_ROUNDS = 6  # of splitting edges; each quarters how far they are from the surface
MATERIALS = ("skin", "cloth")
LOOSE = "cloth"  # its borders are joined to no other part, so they may be split


class Rounded(FinerMesh):
    """A part's mesh with every edge inside it split that lies farther than ``chord_mm`` from the surface, and those at
    the borders of clothes.

    before : how the mesh became finer already, whose vertices come before. coarser : fewer triangles over the mesh, by
    level, which stay as they are.
    """

    def __init__(
        self, mesh: Mesh, part: PartData, chord_mm: float, coarser: Mapping[str, Ints], before: FinerMesh | None = None
    ) -> None:
        super().__init__(mesh, part)
        self._chord_mm, self._before = chord_mm, before
        triangles = np.asarray(mesh.triangles, np.int64)
        for _ in range(MAX_ROUNDS):
            count = len(triangles)
            triangles = split_edges(triangles, self._is_far, self._middles, borders=part.material == LOOSE)
            self._place()
            if len(triangles) == count:
                break
        self.triangles = triangles
        self.coarser = {level: self._behind_new(np.asarray(each, np.int64)) for level, each in coarser.items()}

    def _is_far(self, edges: Ints) -> Bools:
        """Return (e,): which edges lie too far from the surface, in their middles."""
        middle = self._surface.evaluate(*self._between(edges))
        away = np.linalg.norm(middle - self._places[edges].mean(axis=1), axis=1)
        found: Bools = away > self._chord_mm
        return found

    def carry(self, values: Array) -> Array:
        """As :meth:`FinerMesh.carry`, of values by vertex of the mesh before all that made it finer."""
        return super().carry(values if self._before is None else self._before.carry(values))


def with_rounder_outlines(
    data: HeadData, chord_mm: float, refined: Mapping[str, FinerMesh], coarser: Coarser
) -> tuple[HeadData, dict[str, FinerMesh]]:
    """Return the head with skin and clothes whose edges lie at most ``chord_mm`` (mm) from their surface at rest,
    borders of skin excepted.

    refined : the parts that became finer before. coarser : fewer triangles over the mesh of any other part, by level.
    Returns them and those of this call, too, by part.
    """
    found, parts = dict(refined), []
    for part in data.parts:
        if _is_rounded(part, chord_mm):
            surface, before = make_surface(part), refined.get(part.name)
            mesh = unpack(part.mesh, surface, part.budget, rough=False, flip=part.flip)
            mesh = mesh or tessellate(part, surface, data.seams)
            levels = coarser(part.name, mesh) if before is None else before.coarser
            rounder = Rounded(mesh, part, chord_mm, levels, before)
            found[part.name] = rounder
            part = replace(part, mesh=rounder.pack_finer(part))
        parts.append(part)
    return replace(data, parts=parts), found


def _is_rounded(part: PartData, chord_mm: float) -> bool:
    """Whether a part is skin or cloth that may lie farther from its surface, and its (u, v) end somewhere."""
    open_ended = part.closed_u is None and part.closed_v is None
    return part.material in MATERIALS and part.budget[1] > chord_mm and open_ended
