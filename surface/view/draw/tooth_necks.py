"""Where the gum covers a tooth: its colour fades in towards the free border of each crown.

Fitted teeth are open crowns whose border lies in the gum. Where the gum lies lower, as towards the tongue, the border
is seen, sharp and ragged; coloured as gum it looks as the gum that creeps up a tooth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.mesh.mesh import border_edges

_NECK_MM = 0.0, 0.8  # from the border of a crown: as far as it is all gum, and where the tooth begins
_LOW = 0.80  # share of a crown's height, from its tip, above which a border is where crowns touch, not the gum
_SAME_MM = 1e-3  # vertices that are closer are one
_MAX_PAIRS = 1 << 16  # of a vertex and a vertex of the border, that are compared at a time


def tooth_necks(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> NDArray[np.float32]:
    """Return (m,) float32: how much gum covers each vertex (m, 3), mm, of teeth; 0 all over teeth without a border."""
    if not len(triangles):
        return np.zeros(len(vertices), np.float32)
    same, at = welded(vertices)
    joined = same[triangles]
    joined = joined[(joined != np.roll(joined, 1, axis=1)).all(axis=1)].astype(np.int32)
    tooth = _connected(joined, len(at))
    border = np.zeros(len(at), bool)
    border[border_edges(joined).ravel()] = True
    out = np.zeros(len(at))
    for k in np.unique(tooth[border]):
        own = np.flatnonzero(tooth == k)
        out[own] = _covered(at[own], border[own])
    return out[same].astype(np.float32)


def _covered(at: NDArray[np.float64], border: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(n,) share of gum at vertices (n, 3) of one crown, of which those of ``border`` : (n,) lie on its border."""
    along = at[border].mean(axis=0) - at.mean(axis=0)
    height = at @ along
    span = float(np.ptp(height))
    if span == 0.0:
        return np.zeros(len(at))
    low = border & (height - height.min() > _LOW * span)
    if not low.any():
        return np.zeros(len(at))
    # Only what may be near enough is measured: most of a crown is far from its border.
    near = height > height[low].min() - _NECK_MM[1] * float(np.linalg.norm(along))
    away = np.full(len(at), np.inf)
    away[near] = distances(at[near], at[low])
    share = np.clip((_NECK_MM[1] - away) / (_NECK_MM[1] - _NECK_MM[0]), 0.0, 1.0)
    faded: NDArray[np.float64] = share * share * (3.0 - 2.0 * share)
    return faded


def welded(vertices: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return (m,) which place each vertex (m, 3) has, and these places (k, 3) from their least corner, mm; vertices
    within :data:`_SAME_MM` are one."""
    steps = np.round(vertices / _SAME_MM).astype(np.int64)
    steps -= steps.min(axis=0)
    size = steps.max(axis=0) + 1
    key = (steps[:, 0] * size[1] + steps[:, 1]) * size[2] + steps[:, 2]  # sorting rows takes ten times as long
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    places: NDArray[np.float64] = _SAME_MM * steps[first].astype(np.float64)
    return same, places


# Both are short here: to import the same from scipy takes longer than all else that is done before the first picture is
# drawn, and pictures are drawn where scipy is not installed, too.
def _connected(triangles: NDArray[np.integer], count: int) -> NDArray[np.intp]:
    """Return (count,) the least vertex of the component of triangles (t, 3) that each vertex belongs to."""
    label = np.arange(count)
    one, other = np.concatenate([triangles[:, :2], triangles[:, 1:]]).T
    while (label[one] != label[other]).any():
        low = np.minimum(label[one], label[other])
        for end in (one, other):
            np.minimum.at(label, label[end], low)
        while (label != label[label]).any():
            label = label[label]
    return label


def distances(points: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) the distance of each point (n, 3) from the nearest of some places (m, 3)."""
    least, own = np.full(len(points), np.inf), points - places.mean(axis=0)  # near 0, where squares lose little
    for some in np.array_split(places - places.mean(axis=0), -(-len(places) * len(points) // _MAX_PAIRS)):
        least = np.minimum(least, ((some**2).sum(axis=1) - 2.0 * own @ some.T).min(axis=1))
    distances: NDArray[np.float64] = np.sqrt(np.maximum(least + (own**2).sum(axis=1), 0.0))
    return distances
