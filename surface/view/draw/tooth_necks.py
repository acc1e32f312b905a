"""Where the gum covers a tooth: its colour fades in towards the free border of each crown.

Fitted teeth are open crowns whose border lies in the gum. Where the gum lies lower, as towards the tongue, the border
is seen, sharp and ragged; coloured as gum it looks as the gum that creeps up a tooth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.mesh.mesh import border_edges

_NECK_MM = 0.4, 1.8  # from the border of a crown: as far as it is all gum, and where the tooth begins
_LOW = 0.55  # share of a crown's height, from its tip, above which a border is where crowns touch, not the gum
_SAME_MM = 1e-3  # vertices that are closer are one


def tooth_necks(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> NDArray[np.float32]:
    """Return (m,) float32: how much gum covers each vertex (m, 3), mm, of teeth; 0 all over teeth without a border."""
    from scipy.sparse import coo_matrix  # imported lazily: only teeth need it
    from scipy.sparse.csgraph import connected_components  # imported lazily: only teeth need it

    if not len(triangles):
        return np.zeros(len(vertices), np.float32)
    places, same = np.unique(np.round(vertices / _SAME_MM).astype(np.int64), axis=0, return_inverse=True)
    same = same.ravel()
    welded = same[triangles]
    welded = welded[(welded != np.roll(welded, 1, axis=1)).all(axis=1)].astype(np.int32)
    edges = border_edges(welded)
    ends = np.concatenate([welded[:, :2], welded[:, 1:]])
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(len(places), len(places)))
    tooth = connected_components(graph, directed=False)[1]
    border = np.zeros(len(places), bool)
    border[edges.ravel()] = True
    at = np.asarray(places * _SAME_MM, np.float64)
    out = np.zeros(len(places))
    for k in np.unique(tooth[border]):
        own = np.flatnonzero(tooth == k)
        out[own] = _covered(at[own], border[own])
    return out[same].astype(np.float32)


def _covered(at: NDArray[np.float64], border: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n,) share of gum at vertices (n, 3) of one crown, of which those of ``border`` : (n,) lie on its border."""
    from scipy.spatial import cKDTree  # imported lazily: only teeth need it

    along = at[border].mean(axis=0) - at.mean(axis=0)
    height = at @ along
    span = float(np.ptp(height))
    if span == 0.0:
        return np.zeros(len(at))
    low = border & (height - height.min() > _LOW * span)
    if not low.any():
        return np.zeros(len(at))
    away = cKDTree(at[low]).query(at)[0]
    share = np.clip((_NECK_MM[1] - away) / (_NECK_MM[1] - _NECK_MM[0]), 0.0, 1.0)
    faded: NDArray[np.float64] = share * share * (3.0 - 2.0 * share)
    return faded
