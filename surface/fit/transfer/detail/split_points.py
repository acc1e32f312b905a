"""Split control points of a part into finer ones that make exactly the same surface and the same expressions.

A cubic B-spline is the sum of those over knots of half the spans, with weights; so a control point may be replaced by
such points with shares of its weight. This is the knot insertion of Sederberg et al., "T-splines and T-NURCCs" (2003),
equation (6), for single blending functions. Finer points of neighbours that have the same knots are one point. Nothing
moves, in no pose: displacements of groups are shared out as positions are. Points that keep their distance from an
eyeball are the exception, for that is no linear motion: they stay as they are.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise, product

import numpy as np
from scipy.sparse import csr_matrix, diags

from surface.base.arrays import Floats, Ints
from surface.head import Group, Jaw, PartData
from surface.head.posing.rig import jaw_path

Knots = tuple[float, ...]
Name = tuple[Knots, Knots, int]
SAME = 9  # decimals to which equal knots agree
MIN_MOVE_MM = 1e-4  # displacements of points that are smaller are dropped
MIN_SPAN = 10.0**-SAME


@lru_cache(maxsize=20_000)
def halved(knots: Knots) -> dict[Knots, float]:
    """Knots of the cubic blending functions with half the spans, and their shares of the one over ``knots``, five."""
    shares = {knots: 1.0}
    for new in [0.5 * (a + b) for a, b in pairwise(knots) if b - a > MIN_SPAN]:
        finer: dict[Knots, float] = defaultdict(float)
        for old, share in shares.items():
            for each, part in _inserted(old, new).items():
                finer[each] += share * part
        shares = finer
    return shares


def _inserted(k: Knots, new: float) -> dict[Knots, float]:
    """The two functions, and their shares, that the one over knots ``k`` is the sum of if a knot is inserted."""
    if not k[0] < new < k[-1]:
        return {k: 1.0}
    every = tuple(sorted((*k, new)))
    left = (new - k[0]) / (k[3] - k[0]) if new < k[3] else 1.0
    right = (k[4] - new) / (k[4] - k[1]) if new > k[1] else 1.0
    return {every[:-1]: left, every[1:]: right}


def split_points(part: PartData, chosen: Ints, jaw: Jaw) -> PartData:
    """The part with the chosen control points (k,), cubic in both directions, split into ones of half their spans.

    jaw : its path; jawOpen's group gets what the points' shares of it, which are no linear combinations, leave over.
    The part has no mesh afterwards.
    """
    u, v, shares = _finer_points(part, chosen)
    weights = shares @ part.weights
    mix = diags(1.0 / weights) @ shares @ diags(part.weights)
    points, share = mix @ part.points, mix @ part.jaw
    turn, shift = jaw_path(jaw, 1.0)
    swung = part.jaw[:, None] * (part.points @ turn.T + shift - part.points)
    left = mix @ swung - share[:, None] * (points @ turn.T + shift - points)
    groups = [_split_group(g, mix, left if g.name == "jawOpen" else None) for g in part.groups]
    return replace(
        part, points=points, weights=weights, knots_u=u, knots_v=v, degrees=np.full((len(u), 2), 3), groups=groups,
        jaw=share, lids=mix @ part.lids, mesh={},
    )  # fmt: skip


def how_many(part: PartData, chosen: Ints, room: int) -> int:
    """How many of the chosen control points (k,), the first ones, can be split and add no more than ``room`` points."""
    u, v, lid = part.knots_u[:, :5].tolist(), part.knots_v[:, :5].tolist(), part.lids != 0.0
    used = Counter(_name(i, tuple(u[i]), tuple(v[i]), lid[i]) for i in range(len(u)))
    for count, i in enumerate(chosen.tolist()):
        own = _name(i, tuple(u[i]), tuple(v[i]), lid[i])
        used[own] -= 1
        if not used[own]:
            del used[own]
        used.update(_name(i, ku, kv, lid[i]) for ku, kv in product(halved(tuple(u[i])), halved(tuple(v[i]))))
        if len(used) > len(u) + room:
            return count
    return len(chosen)


def _finer_points(part: PartData, chosen: Ints) -> tuple[Floats, Floats, csr_matrix]:
    """Knots (n', 5) in u and in v of all points, and the shares (n', n) that they have of the points before."""
    rows: dict[Name, int] = {}
    knots: list[tuple[Knots, Knots]] = []
    entries: list[tuple[int, int, float]] = []
    lid = part.lids != 0.0
    split = np.isin(np.arange(len(part.points)), chosen) & ~lid
    pairs = zip(part.knots_u[:, :5].tolist(), part.knots_v[:, :5].tolist(), strict=True)
    for i, (u, v) in enumerate(pairs):
        along_u, along_v = (halved(tuple(k)) if split[i] else {tuple(k): 1.0} for k in (u, v))
        for (ku, a), (kv, b) in product(along_u.items(), along_v.items()):
            row = rows.setdefault(_name(i, ku, kv, lid[i]), len(knots))
            if row == len(knots):
                knots.append((ku, kv))
            entries.append((row, i, a * b))
    at, of, share = (np.array(column) for column in zip(*entries, strict=True))
    shares = csr_matrix((share, (at, of)), shape=(len(knots), len(part.points)))
    return np.array([k[0] for k in knots]), np.array([k[1] for k in knots]), shares


def _name(point: int, u: Knots, v: Knots, lid: bool) -> Name:
    """What points have in common that are one; those that keep their distance from an eyeball are by themselves."""
    return _rounded(u), _rounded(v), point if lid else -1


@lru_cache(maxsize=20_000)
def _rounded(knots: Knots) -> Knots:
    return tuple(round(x, SAME) for x in knots)


def _split_group(group: Group, mix: csr_matrix, more: Floats | None) -> Group:
    """The group that moves new points as the old ones move the surface; ``more (n', 3)`` mm is added."""
    field = np.zeros((mix.shape[1], 3))
    field[group.ids] = group.moves
    moves = mix @ field + (0.0 if more is None else more)
    ids = np.flatnonzero(np.abs(moves).max(axis=1) > MIN_MOVE_MM)
    return Group(group.name, ids.astype(np.int32), moves[ids].astype(np.float32))
