"""How far a mesh's own flat faces are from a smooth surface: a lower bound on the error of any fit to a coarse mesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from surface.base.arrays import Floats, Ints
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh, triangles


def facet_sag(mesh: FitMesh, chart: Chart) -> Floats:
    """(m,) mm: at each sample of a chart, how far the mesh's faces lie from a surface that is smooth across them.

    Over a chord of a circle the arc is as high as half the distance from the chord's middle to the tangents at its
    ends. Likewise in a face: half the mean of the steps from its centre to the planes through its corners, across the
    normals there. A vertex has the mean of its faces: one surface cannot pass through vertices and facets alike.
    """
    normal = _normals(mesh.vertices, triangles(mesh.faces))
    mix = chart.mix.tocsr()
    row = np.repeat(np.arange(mix.shape[0]), np.diff(mix.indptr))
    centre, corner = mix @ mesh.vertices, mix.indices
    height = ((mesh.vertices[corner] - centre[row]) * normal[corner]).sum(axis=1)
    step = csr_matrix((mix.data, (row, np.arange(len(row)))), shape=(len(centre), len(row)))
    sag: Floats = 0.5 * np.linalg.norm(step @ (height[:, None] * normal[corner]), axis=1)
    return np.where(np.diff(mix.indptr) == 1, _around(mix, sag), sag)


def _around(mix: csr_matrix, sag: Floats) -> Floats:
    """(m,) the mean of what samples of several vertices have, at each sample over those that share its vertices."""
    several = np.flatnonzero(np.diff(mix.indptr) > 1)
    shares = mix[several]
    shares.data[:] = 1.0
    own = shares.T @ sag[several] / np.maximum(np.asarray(shares.sum(axis=0)).ravel(), 1.0)
    near: Floats = mix @ own
    return near


def _normals(points: Floats, tri: Ints) -> Floats:
    """(n, 3) unit normals of vertices, weighted by the areas of triangles."""
    a, b, c = (points[tri[:, k]] for k in range(3))
    across, normal = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(normal, tri[:, k], across)
    unit: Floats = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return unit
