"""Edge flips: make a triangulation Delaunay-like where that is possible without moving a vertex."""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel


def improve(points: Floats, triangles: Ints, kept: Ints, rounds: int = 6) -> None:
    """Flip edges whose opposite angles sum to more than half a turn, in place, in at most ``rounds`` passes.

    ``points`` are (m, 2) or (m, 3) float64, ``triangles`` (t, 3) int64, consistently oriented, an edge has one or two.
    Edges whose ends share a bit of the mask ``kept (m,)`` int64 stay.
    """
    xyz = np.zeros((len(points), 3))
    xyz[:, : points.shape[1]] = points
    for _ in range(rounds):
        pairs = edge_pairs(triangles)
        if not len(pairs) or _flip_round(xyz, triangles, kept, pairs) == 0:
            return


def edge_keys(triangles: Ints) -> tuple[Ints, int]:
    """Return (3 t,): keys of edges, ``least end * width + greatest end`` of each triangle in turn, and the width."""
    edges, width = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), int(triangles.max(initial=0)) + 1
    return edges.min(axis=1) * width + edges.max(axis=1), width


def edge_pairs(triangles: Ints) -> Ints:
    """Return (e, 2): pairs of triangles that share an edge."""
    key = edge_keys(triangles)[0]
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    return np.stack([order[:-1][same], order[1:][same]], axis=1) // 3


@kernel
def _normal(xyz, i, j, k):
    ax, ay, az = xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], xyz[j, 2] - xyz[i, 2]
    bx, by, bz = xyz[k, 0] - xyz[i, 0], xyz[k, 1] - xyz[i, 1], xyz[k, 2] - xyz[i, 2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def _cotangent(xyz, apex, a, b):
    """Return cotangent of the angle at ``apex``."""
    ax, ay, az = xyz[a, 0] - xyz[apex, 0], xyz[a, 1] - xyz[apex, 1], xyz[a, 2] - xyz[apex, 2]
    bx, by, bz = xyz[b, 0] - xyz[apex, 0], xyz[b, 1] - xyz[apex, 1], xyz[b, 2] - xyz[apex, 2]
    nx, ny, nz = _normal(xyz, apex, a, b)
    return (ax * bx + ay * by + az * bz) / max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)


@kernel
def _flip_round(xyz, triangles, kept, pairs):
    """Flip edges in one pass; a pair whose triangles were already changed in this pass is checked again."""
    count = 0
    for e in range(pairs.shape[0]):
        s, t = pairs[e, 0], pairs[e, 1]
        ia = -1
        for k in range(3):  # the edge a-b of s that t holds as b-a
            a, b = triangles[s, k], triangles[s, (k + 1) % 3]
            for q in range(3):
                if triangles[t, q] == b and triangles[t, (q + 1) % 3] == a:
                    ia = k
        if ia < 0:
            continue
        a, b, c = triangles[s, ia], triangles[s, (ia + 1) % 3], triangles[s, (ia + 2) % 3]
        d = triangles[t, 0] + triangles[t, 1] + triangles[t, 2] - a - b
        if kept[a] & kept[b] or c == d:
            continue
        if _cotangent(xyz, c, a, b) + _cotangent(xyz, d, a, b) >= -1e-9:
            continue
        n0, n1 = _normal(xyz, a, b, c), _normal(xyz, b, a, d)
        m0, m1 = _normal(xyz, a, d, c), _normal(xyz, d, b, c)
        x, y, z = n0[0] + n1[0], n0[1] + n1[1], n0[2] + n1[2]
        if m0[0] * x + m0[1] * y + m0[2] * z <= 0.0 or m1[0] * x + m1[1] * y + m1[2] * z <= 0.0:
            continue  # the two triangles do not form a convex quadrilateral
        triangles[s, 0], triangles[s, 1], triangles[s, 2] = a, d, c
        triangles[t, 0], triangles[t, 1], triangles[t, 2] = d, b, c
        count += 1
    return count
