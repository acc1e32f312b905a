"""Measure a fitted chart between the samples it was fitted to, and say where it strays.

What control points do between samples is decided by their blending functions alone. Where a slit or a rim leaves a
point few samples, or where samples contradict each other, it may lie far out: every sample is met, and a spike stands
between two of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.points.net import Net
from surface.fit.points.solve import basis
from surface.fit.source.chart import Chart, Places
from surface.fit.source.mesh import FitMesh


@dataclass(frozen=True)
class DenseErrors:
    """Distances (mm) between mesh and surface at a chart's places between samples.

    neutral : (d,); folded places, which are held only loosely, have 0. worst : (d,) of the worst shape; shape : (d,)
    which one that is, -1 without shapes.
    """

    neutral: Floats
    worst: Floats
    shape: Ints

    @property
    def most(self) -> float:
        """The largest of all."""
        return float(max(self.neutral.max(initial=0.0), self.worst.max(initial=0.0)))


def dense_errors(mesh: FitMesh, chart: Chart, net: Net, points: Floats, moves: Floats) -> DenseErrors:
    """Measure control points (n, 3) and their displacements (k, n, 3) at ``chart.between``, one shape after another."""
    places = places_of(chart, mesh)
    rows = basis(net, places.uv)
    neutral = np.linalg.norm(rows @ points - places.mix @ mesh.vertices, axis=1)
    worst, shape = np.zeros(len(places.uv)), np.full(len(places.uv), -1)
    for k, (move, delta) in enumerate(zip(moves, mesh.deltas, strict=False)):
        off = np.linalg.norm(rows @ move - places.mix @ delta, axis=1)
        shape[off > worst] = k
        worst = np.maximum(worst, off)
    return DenseErrors(np.where(places.folded, 0.0, np.nan_to_num(neutral)), np.nan_to_num(worst), shape)


def places_of(chart: Chart, mesh: FitMesh) -> Places:
    """The chart's places between samples; none where it was made without."""
    none = np.zeros((0, 2))
    return chart.between or Places(none, csr_matrix((0, len(mesh.vertices))), none, np.zeros(0, bool))


def around(places: Places, mix: csr_matrix) -> Bools:
    """(d,) the places that share a vertex of the mesh with any row of ``mix (r, n)``."""
    flag = np.zeros(places.mix.shape[1])
    flag[np.unique(mix.indices)] = 1.0
    near: Bools = np.asarray(places.mix @ flag).ravel() > 0
    return near


def bounded(
    mesh: FitMesh, chart: Chart, net: Net, points: Floats, moves: Floats, strays: Bools
) -> tuple[Floats, Floats]:  # fmt: skip
    """Points and moves, with those that reach a stray place moved into the mesh's own range around it.

    The surface is a weighted mean of control points with weights above 0: what none of them exceeds, it does not.
    """
    places = places_of(chart, mesh)
    reach = basis(net, places.uv).tocsc()
    at, points, moves = places.mix @ mesh.vertices, points.copy(), moves.copy()
    length = np.stack([np.linalg.norm(places.mix @ d, axis=1) for d in mesh.deltas]) if len(moves) else None
    for i in np.flatnonzero(np.asarray((reach[np.flatnonzero(strays)] > 0).sum(axis=0)).ravel()):
        rows = reach.indices[reach.indptr[i] : reach.indptr[i + 1]]
        low, high = at[rows].min(axis=0), at[rows].max(axis=0)
        points[i] = np.clip(points[i], low, high)
        if length is not None:
            size = np.maximum(np.linalg.norm(moves[:, i], axis=1), 1e-12)
            moves[:, i] *= np.minimum(1.0, length[:, rows].max(axis=1) / size)[:, None]
    return points, moves
