"""Flatten a disc of triangles, with or without holes, so that nothing is flipped and nothing overlaps.

Mean value coordinates over a circle (Floater, Mean value coordinates, CAGD 2003) are one-to-one, since the weights are
positive and the border is convex. From there SLIM (Rabinovich et al., Scalable locally injective mappings, 2017; in
libigl) lowers the symmetric Dirichlet energy with a free border and never flips a triangle. Holes are filled with cones
meanwhile, so that flat ones open and none turns over; what has no flips and an outline that does not cross itself is
one-to-one.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import splu

from surface.base.arrays import Bools, Floats, Ints
from surface.base.extras import importing
from surface.fit.source.islands import Island, boundary_loops

MAX_ROUNDS = 12  # of SLIM
STEPS = 4  # of SLIM in each round; the map is checked after a round
MIN_STEP = 4e-3  # a round that moves no point by more than this fraction of the chart's size is the last
CONE_DEPTH = 0.22  # of the cone that fills a flat hole, in widths of the hole: it gives the hole its height in (u, v)
WEIGHT_RANGE = (1e-3, 1e3)  # of mean value coordinates, relative to their median: those of slivers can have any size
SLIVER_ASPECT = 1e-3  # height over length of a triangle below which its form is not kept
ANCHOR_WEIGHT = 1e-6  # of the soft constraint of one point, which keeps the map from drifting


def flatten(points: Floats, tri: Ints) -> Floats | None:
    """(m, 2) places of points (m, 3) in the plane, in their own unit; None where they cannot be found.

    tri (t, 3) : a disc that may have holes; every vertex is used, and its triangles hang together by edges.
    """
    loops = rims(points, tri)
    if not loops or not is_disc(len(points), tri, len(loops)):
        return None
    around, every = _filled(points, tri, loops[1:])
    start = _on_circle(around, every, loops[0])
    if start is None or not _one_to_one(start, every, loops[0]):
        return None
    return _relaxed(_with_form(around, every), every, start, loops[0])[: len(points)]


def rims(points: Floats, tri: Ints) -> list[Ints]:
    """Closed loops around triangles (t, 3), the longest on the surface first."""
    return boundary_loops(Island(np.arange(len(points)), points, np.pad(tri, ((0, 0), (0, 1)), constant_values=-1)))


def is_disc(points: int, tri: Ints, loops: int) -> bool:
    """Does Euler's formula hold for one disc with ``loops`` rims in all?"""
    edges = np.unique(np.sort(np.concatenate([tri[:, [0, 1]], tri[:, [1, 2]], tri[:, [2, 0]]]), axis=1), axis=0)
    return points - len(edges) + len(tri) == 2 - loops


def _filled(points: Floats, tri: Ints, holes: list[Ints]) -> tuple[Floats, Ints]:
    """Points and triangles with a cone in every hole, the deeper the flatter the hole is."""
    normal = np.zeros_like(points)
    a, b, c = points[tri].swapaxes(0, 1)
    np.add.at(normal, tri.ravel(), np.repeat(np.cross(b - a, c - a), 3, axis=0))
    tips, cones = [points], [tri]
    for k, hole in enumerate(holes):
        rim = points[hole]
        across = rim - rim.mean(axis=0)
        axes = np.linalg.svd(across, full_matrices=False)[2]
        width, height = np.ptp(across @ axes[0]), np.ptp(across @ axes[1])
        away = normal[hole].sum(axis=0)
        depth = max(CONE_DEPTH * width - 0.5 * height, 0.0)
        tips.append((rim.mean(axis=0) - depth * away / max(float(np.linalg.norm(away)), 1e-12))[None])
        cones.append(np.column_stack([np.roll(hole, -1), hole, np.full(len(hole), len(points) + k)]))
    return np.concatenate(tips), np.concatenate(cones)


def _on_circle(points: Floats, tri: Ints, rim: Ints) -> Floats | None:
    """Mean value map with the rim on a circle of the surface's area."""
    n = len(points)
    steps = np.linalg.norm(points[rim] - points[np.roll(rim, -1)], axis=1)
    steps = np.maximum(steps, 1e-3 * steps.mean())
    angle = 2.0 * np.pi * np.append(0.0, np.cumsum(steps)[:-1]) / steps.sum()
    a, b, c = points[tri].swapaxes(0, 1)
    radius = np.sqrt(0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / np.pi)
    out = np.zeros((n, 2))
    out[rim] = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    inner = np.setdiff1d(np.arange(n), rim)
    if not len(inner):
        return out
    weights = mean_value(points, tri)[inner]
    system = (identity(len(inner)) - weights[:, inner]).tocsc()
    try:
        out[inner] = splu(system).solve(np.ascontiguousarray(weights[:, rim] @ out[rim]))
    except RuntimeError:  # the matrix is singular: some points have no way to the rim
        return None
    return out


def mean_value(points: Floats, tri: Ints) -> csr_matrix:
    """(n, n) rows of positive weights that sum up to 1: each of points (n, 3) in terms of those that share triangles
    (t, 3) with it; mean value coordinates (Floater 2003)."""
    rows, columns, values = [], [], []
    for k in range(3):
        at, one, two = tri[:, k], tri[:, (k + 1) % 3], tri[:, (k + 2) % 3]
        e, f = points[one] - points[at], points[two] - points[at]
        r, s = np.linalg.norm(e, axis=1), np.linalg.norm(f, axis=1)
        cosine = np.clip((e * f).sum(axis=1) / np.maximum(r * s, 1e-300), -1.0, 1.0)
        half = np.sqrt((1.0 - cosine) / np.maximum(1.0 + cosine, 1e-9))  # tangent of half the angle
        for end, length in ((one, r), (two, s)):
            rows.append(at)
            columns.append(end)
            values.append(half / np.maximum(length, 1e-9))
    value = np.concatenate(values)
    usual = float(np.median(value))
    value = np.clip(value, WEIGHT_RANGE[0] * usual, WEIGHT_RANGE[1] * usual)
    out = csr_matrix((value, (np.concatenate(rows), np.concatenate(columns))), shape=(len(points), len(points)))
    total = np.asarray(out.sum(axis=1)).ravel()
    return csr_matrix(out.multiply(1.0 / np.maximum(total, 1e-300)[:, None]))


def _with_form(points: Floats, tri: Ints) -> Floats:
    """The points, those of slivers moved a little: SLIM keeps forms, and a triangle without area has none."""
    sides = points[tri] - points[np.roll(tri, -1, axis=1)]
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    height = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / np.maximum(longest, 1e-300)
    bad = np.unique(tri[height < SLIVER_ASPECT * np.maximum(longest, 1e-3 * np.median(longest))])
    out = points.copy()
    shift = np.random.default_rng(1).normal(size=(len(bad), 3))
    out[bad] += 0.03 * float(np.median(longest)) * shift
    return out


def _relaxed(points: Floats, tri: Ints, start: Floats, rim: Ints) -> Floats:
    """The map after as many rounds of SLIM as leave it one-to-one."""
    with importing("making charts of a mesh without usable texture coordinates", "igl"):
        import igl  # most meshes bring texture coordinates of their own

    best, size = start, float(np.ptp(start, axis=0).max())
    faces = np.asfortranarray(tri.astype(np.int32))
    data = igl.slim_precompute(
        np.asfortranarray(points), faces, np.asfortranarray(start), igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(1, np.int32), np.asfortranarray(start[:1]), ANCHOR_WEIGHT,
    )  # fmt: skip
    for _ in range(MAX_ROUNDS):
        after = np.array(igl.slim_solve(data, STEPS))[:, :2]
        if not np.isfinite(after).all() or not _one_to_one(after, tri, rim):
            break
        moved = float(np.abs((after - after.mean(axis=0)) - (best - best.mean(axis=0))).max())
        best = after
        if moved < MIN_STEP * size:
            break
    return best


def _one_to_one(at: Floats, tri: Ints, rim: Ints) -> bool:
    """Do all triangles run anticlockwise, and does the outline not cross itself?"""
    a, b, c = at[tri].swapaxes(0, 1)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return bool((area > 0).all()) and not crosses_itself(at[rim])


def crosses_itself(line: Floats) -> bool:
    """Does a closed line of points (n, 2) cross or touch itself anywhere but at common ends of its edges?"""
    start, end = line, np.roll(line, -1, axis=0)
    low, high = np.minimum(start, end), np.maximum(start, end)
    n = len(line)
    for k in range(n - 2):
        others = np.arange(k + 2, n - (k == 0))
        near = others[((low[others] <= high[k]) & (high[others] >= low[k])).all(axis=1)]
        if len(near) and _meets(start[k], end[k], start[near], end[near]).any():
            return True
    return False


def _meets(a: Floats, b: Floats, c: Floats, d: Floats) -> Bools:
    """(n,) does the edge from ``a`` to ``b`` (2,) meet those from ``c`` to ``d`` (n, 2)?"""

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        along, to = q - p, r - p
        out: Floats = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
        return out

    met: Bools = (side(a, b, c) * side(a, b, d) <= 0) & (side(c, d, a) * side(c, d, b) <= 0)
    return met
