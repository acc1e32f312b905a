"""Keep skin from passing through itself on a scan, as an ear does that hair hides.

The map to a scan and the scan's detail are soft: two sides of an ear, or an ear and the neck, may be matched to one
surface and come to lie in each other. A stiffer map keeps them apart, so skin goes back to it there.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Bools, Floats, Ints
from surface.check.cells import joined_nearer
from surface.check.crossings import Crossings
from surface.head.model.parameters import smoothstep

ROUNDS = 4
BACK_MM = (3.0, 8.0)  # distance from what crosses up to which skin goes back fully, and from which on it stays
TOGETHER_MM = 10.0  # places that cross and are no further apart belong together
WIDER, WIDEST_MM = 1.5, 30.0  # radius of what goes back as a whole, in theirs; the greatest
NEXT_MM = 4.0  # at rest, between the middles of triangles on both sides of a seam
FEWEST = 8  # vertices of a place that crosses; fewer are a seam's corner, which nobody sees
HOPELESS_MM = 6.0  # at rest, from what crosses where it would go back to
SAME = 1e-6  # vertices that are nearer at rest, relative to the skin's size, are in one place


def uncrossed(at: Floats, still: Floats, rest: Floats, triangles: Ints, part: Ints, able: Bools) -> Floats:
    """The skin's vertices ``at (n, 3)``, moved towards ``still (n, 3)`` where triangles (t, 3) pass through each other.

    still : the same vertices by a stiffer map. rest : (n, 3) on the head that the skin comes from. part : (t,) number
    of the part of skin that each triangle belongs to. able : (n,) which of the vertices that cross are asked about;
    none near what crosses at rest or by the stiffer map, too. Where more would cross afterwards than before, nothing
    moves.
    """
    size = float(np.ptp(rest, axis=0).max()) or 1.0
    same = np.unique(np.round(rest / (SAME * size)), axis=0, return_inverse=True)[1].reshape(-1)
    kinds = int(part.max(initial=0)) + 1
    found = Crossings(rest, triangles, same, part, np.ones((kinds, kinds), bool))
    able = able & ~_near_any(rest, [crossing(found, as_is, rest, np.ones_like(able)) for as_is in (rest, still)])
    first = _places(found, at, rest, able)
    crossed, out = np.zeros(len(at), bool), at
    for _ in range(ROUNDS):
        more = first if out is at else _places(found, out, rest, able)
        if not len(more):
            break
        crossed[more] = True
        out = at + _share(rest, rest[crossed])[:, None] * (still - at)
    return out if len(_places(found, out, rest, able)) < len(first) else at


def crossing(found: Crossings, at: Floats, rest: Floats, able: Bools) -> Ints:
    """The vertices (k,), of those that are ``able (n,)``, whose triangles pass through others at ``at (n, 3)``, but for
    triangles of two parts that lie beside each other at ``rest (n, 3)``: at seams these always cross a little."""
    pairs, triangles = found.pairs(at), found.tree.triangles
    middle = rest[triangles].mean(axis=1)
    beside = np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1) < NEXT_MM
    seam = beside & (found.kind[pairs[:, 0]] != found.kind[pairs[:, 1]])
    ids: Ints = np.unique(triangles[pairs[~seam].ravel()])
    return ids[able[ids]]


def _places(found: Crossings, at: Floats, rest: Floats, able: Bools) -> Ints:
    """Those of :func:`crossing`, of which there are enough about one place."""
    ids = crossing(found, at, rest, able)
    if not len(ids):
        return ids
    group = joined_nearer(rest[ids], np.arange(len(ids)), TOGETHER_MM)
    out: Ints = ids[np.bincount(group)[group] >= FEWEST]
    return out


def _near_any(points: Floats, rows: list[Ints]) -> Bools:
    """(n,) which of points (n, 3) are near any of those of some rows."""
    every = np.concatenate(rows)
    if not len(every):
        return np.zeros(len(points), bool)
    near: Bools = cKDTree(points[every]).query(points)[0] < HOPELESS_MM
    return near


def _share(points: Floats, crossed: Floats) -> Floats:
    """(n,) how far each of points (n, 3) goes back, 0..1, near places ``crossed (k, 3)`` and in the balls round those
    of them that belong together."""
    out: Floats = 1.0 - smoothstep(cKDTree(crossed).query(points)[0], *BACK_MM)
    label = joined_nearer(crossed, np.arange(len(crossed)), TOGETHER_MM)
    for k in np.unique(label):
        own = crossed[label == k]
        middle = 0.5 * (own.min(axis=0) + own.max(axis=0))
        radius = min(WIDER * float(np.linalg.norm(own - middle, axis=1).max()), WIDEST_MM)
        beside = np.linalg.norm(points - middle, axis=1) - radius
        fade = max(radius, BACK_MM[1] - BACK_MM[0])  # a wide place ends gently
        out = np.maximum(out, 1.0 - smoothstep(beside, BACK_MM[0], BACK_MM[0] + fade))
    return out
