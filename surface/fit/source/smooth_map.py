"""Make a map to (u, v) smooth inside an island.

Texture coordinates may bend from one face of the mesh to the next, and more so beside a flat hole that was opened. A
surface that is smooth over (u, v) cannot follow that: it goes round every such bend in waves along the skin, which show
as ripples where the skin is curved.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import identity
from scipy.sparse.linalg import splu

from surface.base.arrays import Floats, Ints
from surface.fit.source.flatten import mean_value
from surface.fit.source.islands import Island, boundary_loops, signed_areas
from surface.fit.source.mesh import FitMesh, triangles

SMOOTHING = 30.0  # weight of bends of the map, relative to changes of it: waves of a few edges go, longer ones stay
HALVINGS = 4  # of the change, until no face turns over


def smooth_map(mesh: FitMesh, island: Island) -> Island:
    """The island with smoother (u, v) inside; its borders, and slits with them, keep theirs.

    Minimises |x - x0|^2 + SMOOTHING |L x|^2, with L the difference of a point's (u, v) from the mean of its neighbours
    by mean value coordinates, which is 0 for a map that is linear on a flat surface. A face that ran anticlockwise does
    so still.
    """
    rim = np.unique(np.concatenate([np.zeros(0, np.int64), *boundary_loops(island)]))
    tri = triangles(island.faces)
    inner = np.setdiff1d(tri, rim)
    if not len(inner):
        return island
    bend = (identity(len(island.uv), format="csr") - mean_value(mesh.vertices[island.vertex], tri))[inner]
    own = bend[:, inner]
    change = np.zeros_like(island.uv)
    system = (identity(len(inner)) + SMOOTHING * (own.T @ own)).tocsc()
    change[inner] = splu(system).solve(-SMOOTHING * (own.T @ (bend @ island.uv)))
    return _unturned(island, tri, change)


def _unturned(island: Island, tri: Ints, change: Floats) -> Island:
    """The island with as much of a change (m, 2) of its (u, v) as turns none of its triangles (t, 3) over."""
    halves = replace(island, faces=np.pad(tri, ((0, 0), (0, 1)), constant_values=-1))
    upright = signed_areas(halves) > 0
    for k in range(HALVINGS):
        uv = island.uv + 0.5**k * change
        if (signed_areas(replace(halves, uv=uv))[upright] > 0).all():
            return replace(island, uv=uv)
    return island
