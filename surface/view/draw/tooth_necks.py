"""Where the gum covers a tooth: its colour fades in towards the free border of each crown.

Fitted teeth are open crowns whose border lies in the gum. Where the gum lies lower, as towards the tongue, the border
is seen, sharp and ragged; coloured as gum it looks as the gum that creeps up a tooth. In a row the gum also covers the
inner sides up to necks that are round arches, lower in the middle of a tooth than beside its neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from surface.mesh.mesh import border_edges

_NECK_MM = 0.0, 0.8  # from the border of a crown: as far as it is all gum, and where the tooth begins
_LOW = 0.80  # share of a crown's height, from its tip, above which a border is where crowns touch, not the gum
_ROW = 4  # crowns that make a row, which has an inner side
_INNER = 0.1, 0.5  # of half a crown's thickness: inwards of this it begins to have an inner side, and has
_NECK = 0.52, 0.74  # share of a crown's height that is free inside, in its middle: of a molar, and of a front tooth
_SLIM = 0.60, 0.95  # a crown's thickness by its height: of a front tooth, and of a molar
_ARCH = 0.22  # how much less of it is free at the flanks
_NEAR = 3  # crowns, the tooth's own among them, that show how its row runs
_EDGE = 0.05  # of its height: over which the gum's edge fades
_SAME_MM = 1e-3  # vertices that are closer are one
_MAX_PAIRS = 1 << 16  # of a vertex and a vertex of the border, that are compared at a time


def tooth_necks(vertices: NDArray[np.float64], triangles: NDArray[np.integer]) -> NDArray[np.float32]:
    """Return (m,) float32: how much gum covers each vertex (m, 3), mm, of teeth; 0 all over teeth without a border."""
    if not len(triangles):
        return np.zeros(len(vertices), np.float32)
    same, places = _welded(vertices)
    welded = same[triangles]
    welded = welded[(welded != np.roll(welded, 1, axis=1)).all(axis=1)].astype(np.int32)
    tooth = _connected(welded, len(places))
    border = np.zeros(len(places), bool)
    border[border_edges(welded).ravel()] = True
    at = places * _SAME_MM
    out = np.zeros(len(places))
    crowns = [np.flatnonzero(tooth == k) for k in np.unique(tooth[border])]
    for own in crowns:
        out[own] = _covered(at[own], border[own])
    if len(crowns) >= _ROW:
        _cover_inside([at[own] for own in crowns], [border[own] for own in crowns], out, crowns)
    return out[same].astype(np.float32)


def _cover_inside(
    row: Sequence[NDArray[np.float64]], borders: Sequence[NDArray[np.bool_]], out: NDArray[np.float64],
    crowns: Sequence[NDArray[np.intp]],
) -> None:  # fmt: skip
    """Write the gum on the inner sides of crowns, each (n, 3) with its ``border (n,)``, to their places in ``out``."""
    middles = np.array([tooth.mean(axis=0) for tooth in row])
    down = _unit(np.sum([tooth[edge].mean(axis=0) - tooth.mean(axis=0) for tooth, edge in zip(row, borders)], axis=0))
    inside = middles.mean(axis=0)
    for own, tooth, middle in zip(crowns, row, middles, strict=True):
        near = middles[np.argsort(((middles - middle) ** 2).sum(axis=1))[:_NEAR]]
        inwards = _across_row(near - near.mean(axis=0), inside - middle, down)
        out[own] = np.maximum(out[own], _covered_inside(tooth - middle, down, inwards))


def _across_row(near: NDArray[np.float64], inside: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """The direction (3,) across a row of which some neighbours (k, 3) are known, level, on the side of ``inside``."""
    level = near - np.outer(near @ down, down)
    along = np.linalg.svd(level)[2][0]
    across = np.cross(along, down)
    return _unit(across * np.sign(across @ inside))


def _covered_inside(
    at: NDArray[np.float64], down: NDArray[np.float64], inwards: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) share of gum on the inner side of one crown (n, 3); ``down`` is where the gum is, ``inwards`` the tongue."""
    low, deep, aside = (_spread(at @ way) for way in (down, inwards, np.cross(down, inwards)))
    slim = np.clip((_SLIM[1] - np.ptp(at @ inwards) / max(float(np.ptp(at @ down)), 1e-9)) / (_SLIM[1] - _SLIM[0]), 0.0, 1.0)
    neck = _NECK[0] + (_NECK[1] - _NECK[0]) * slim - _ARCH * aside**2
    within = _eased((deep - _INNER[0]) / (_INNER[1] - _INNER[0]))
    return within * _eased(0.5 + (0.5 + 0.5 * low - neck) / _EDGE)


def _spread(across: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (n,) along a line, from -1 to 1."""
    low, high = across.min(), across.max()
    return (2.0 * across - low - high) / max(high - low, 1e-9)


def _eased(share: NDArray[np.float64]) -> NDArray[np.float64]:
    cut = np.clip(share, 0.0, 1.0)
    return cut * cut * (3.0 - 2.0 * cut)


def _unit(way: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(way / max(float(np.linalg.norm(way)), 1e-9))


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
    away[near] = _distances(at[near], at[low])
    return _eased((_NECK_MM[1] - away) / (_NECK_MM[1] - _NECK_MM[0]))


def _welded(vertices: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return (m,) which place each vertex (m, 3) has, and these places (k, 3) from their least corner, in steps of
    :data:`_SAME_MM`."""
    steps = np.round(vertices / _SAME_MM).astype(np.int64)
    steps -= steps.min(axis=0)
    size = steps.max(axis=0) + 1
    key = (steps[:, 0] * size[1] + steps[:, 1]) * size[2] + steps[:, 2]  # sorting rows takes ten times as long
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    return same, steps[first].astype(np.float64)


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


def _distances(points: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) the distance of each point (n, 3) from the nearest of some places (m, 3)."""
    least, own = np.full(len(points), np.inf), points - places.mean(axis=0)  # near 0, where squares lose little
    for some in np.array_split(places - places.mean(axis=0), -(-len(places) * len(points) // _MAX_PAIRS)):
        least = np.minimum(least, ((some**2).sum(axis=1) - 2.0 * own @ some.T).min(axis=1))
    distances: NDArray[np.float64] = np.sqrt(np.maximum(least + (own**2).sum(axis=1), 0.0))
    return distances
