"""Meshes of parts with some edges split: their vertices keep their numbers, new ones lie on the surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from surface.base.arrays import Array, Floats, Ints
from surface.head.model.data import PartData
from surface.head.model.meshes import make_surface, pack
from surface.mesh.mesh import Mesh
from surface.mesh.splitedges import Middles


class FinerMesh:
    """A part's mesh, some of whose edges a subclass splits: new vertices follow those of the mesh.

    mesh : the mesh before. part : its part.

    Attributes
    ----------
    triangles : (t, 3) of the finer mesh. coarser : fewer triangles over the same vertices, by level.
    """

    triangles: Ints
    coarser: Mapping[str, Ints]

    def __init__(self, mesh: Mesh, part: PartData) -> None:
        self.mesh, self._surface = mesh, make_surface(part)
        self._count = len(mesh.uv)
        self._middles = Middles(self._count)
        self._uv, self._places = mesh.uv, mesh.vertices
        self._side = np.asarray(mesh.side, np.int64)

    @property
    def ends(self) -> Ints:
        """(k, 2) the two vertices between which each new one lies; they may be earlier new ones."""
        return np.array(self._middles.ends, np.int64).reshape(-1, 2)

    def _place(self) -> None:
        """Put vertices that were made since the last call onto the surface."""
        ends = self.ends[len(self._uv) - self._count :]
        if len(ends):
            uv, side = self._between(ends)
            self._uv, self._side = np.concatenate([self._uv, uv]), np.concatenate([self._side, side])
            self._places = np.concatenate([self._places, self._surface.evaluate(uv, side)])

    def _between(self, ends: Ints) -> tuple[Floats, Ints]:
        """Return the middles (e, 2) between ends (e, 2), and from which side each evaluates the surface: that of both
        where both lie on the same slit."""
        return self._uv[ends].mean(axis=1), np.bitwise_and(*self._side[ends].T)

    def _behind_new(self, triangles: Ints) -> Ints:
        """Return triangles (t, 3) that were numbered before vertices were added: what seams added comes behind them."""
        return triangles + len(self.ends) * (triangles >= self._count)

    def pack_finer(self, grown: PartData) -> dict[str, Array]:
        """Return the finer mesh of the part ``grown``, which may have more control points, as arrays to keep: new
        vertices are in cells of their own.
        """
        mesh, surface = self.mesh, make_surface(grown)
        lists = self._lists(surface.n)
        starts = [mesh.cell_start]
        if len(self.ends):
            basis = surface.basis_matrix(self._uv[self._count :], side=self._side[self._count :]).tocsr()
            cuts = np.append(np.arange(0, len(self.ends), 64), len(self.ends))
            starts.append(self._count + cuts[1:])
            lists += [np.unique(basis[a:b].indices).astype(np.int32) for a, b in pairwise(cuts)]
        finer = replace(
            mesh,
            vertices=self._places, normals=np.zeros_like(self._places), triangles=self.triangles.astype(np.int32),
            uv=self._uv, side=self._side,
            cell_start=np.concatenate(starts), list_start=np.cumsum([0, *map(len, lists)]),
            list_ids=np.concatenate(lists).astype(np.int32),
        )  # fmt: skip
        return pack(finer, grown.budget)

    def _lists(self, count: int) -> list[Array]:
        """Return, by cell of the mesh, its points; ``count`` : of the part's, with those that were added."""
        return [self.mesh.points_of(c) for c in range(len(self.mesh.cell_start) - 1)]

    def carry(self, values: Array) -> Array:
        """Return rows (m, ...) by vertex, behind the mesh's own those that seams added, with rows for new vertices
        between."""
        own: Floats = np.asarray(values[: self._count], np.float64)
        rows = np.concatenate([own, np.zeros((len(self.ends), *values.shape[1:]))])
        for i, (a, b) in enumerate(self.ends.tolist(), self._count):
            rows[i] = (rows[a] + rows[b]) / 2
        return np.concatenate([rows.astype(values.dtype), values[self._count :]])
