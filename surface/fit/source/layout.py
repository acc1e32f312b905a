"""Islands of a mesh that nothing is known of, made fit to be charts.

A mirrored half that lies on the other one in (u, v) becomes an island of its own. Every island is turned so that up on
the head is up in (u, v), since slits run along u, and evened out: on average, lengths in (u, v) are lengths on the
surface.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.chart import NARROW, TILE
from surface.fit.source.islands import Island, boundary_loops, directed_edges
from surface.fit.source.mesh import FitMesh

LARGE = 0.03  # of an island's area: what runs the other way round in (u, v) and is smaller is a fold, not a half
TILT = 0.35  # rad; holes that lie steeper than this are no slits along u
FLAT = 0.05  # sine of a slope below which a surface has no up
SMALLEST = 0.12  # tiles are as large as their islands, but never smaller than this


def separate(island: Island) -> list[Island]:
    """The island without overlap: parts that run clockwise in (u, v) and those that run anticlockwise."""
    from scipy.sparse import coo_matrix  # takes a moment to import
    from scipy.sparse.csgraph import connected_components

    area = signed_areas(island)
    one, two = _neighbours(island)
    same = (area[one] > 0) == (area[two] > 0)
    n = len(area)
    graph = coo_matrix((np.ones(same.sum()), (one[same], two[same])), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    size = np.bincount(label, np.abs(area))
    large = size >= LARGE * size.sum()
    if large.sum() < 2:
        return [island]
    label = _join_small(label, large, one, two)
    return [cut_out(island, label == k) for k in np.flatnonzero(large)]


def signed_areas(island: Island) -> Floats:
    """(f,) areas in (u, v), negative where a face runs clockwise."""
    f = island.faces
    last = np.where(f[:, 3] < 0, f[:, 2], f[:, 3])
    a, b, c, d = (island.uv[i] for i in (f[:, 0], f[:, 1], f[:, 2], last))
    p, q = c - a, d - b
    return 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])


def _neighbours(island: Island) -> tuple[Ints, Ints]:
    """Pairs of faces (e,), (e,) that share an edge."""
    a, b = directed_edges(island.faces)
    face = np.repeat(np.arange(len(island.faces)), (island.faces >= 0).sum(axis=1))
    key = np.minimum(a, b) * len(island.uv) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(key[order][1:] == key[order][:-1])
    return face[order[twice]], face[order[twice + 1]]


def _join_small(label: Ints, large: Bools, one: Ints, two: Ints) -> Ints:
    """Give faces of small clusters the label of a large neighbour, ring by ring."""
    out = label.copy()
    while True:
        fresh = [(a, out[b]) for a, b in ((one, two), (two, one))]
        changed = False
        for at, other in fresh:
            take = ~large[out[at]] & large[other]
            out[at[take]] = other[take]
            changed |= bool(take.any())
        if not changed:
            return out


def cut_out(island: Island, chosen: Bools) -> Island:
    """Some faces of an island as one of their own."""
    faces = island.faces[chosen]
    used, inverse = np.unique(faces, return_inverse=True)
    local = inverse.reshape(faces.shape) - int(used[0] < 0)
    used = used[used >= 0]
    return Island(island.vertex[used], island.uv[used], local)


def lay_out(mesh: FitMesh, islands: list[Island]) -> list[Island]:
    """Islands of one part side by side in tiles, upright, each as large as its surface."""
    upright = [_upright(mesh, island) for island in islands]
    largest = max((float(np.ptp(i.uv, axis=0).max()) for i in upright), default=1.0)
    return [_in_tile(island, k, largest) for k, island in enumerate(upright)]


def _upright(mesh: FitMesh, island: Island) -> Island:
    """Anticlockwise, up is up, in mm."""
    uv = island.uv * ([-1.0, 1.0] if signed_areas(island).sum() < 0 else [1.0, 1.0])
    slope, weight = _slopes(mesh, Island(island.vertex, uv, island.faces))
    total = max(float(weight.sum()), 1e-30)
    scale, axes = np.linalg.eigh(np.einsum("f,fik,fjk->ij", weight, slope, slope) / total)
    even = (axes * np.sqrt(np.maximum(scale, 1e-6 * max(float(scale.max()), 1e-30)))) @ axes.T
    up = np.linalg.inv(even) @ (weight @ slope[:, :, 1]) / total
    c, s = up[::-1] / np.linalg.norm(up) if np.linalg.norm(up) > FLAT else (1.0, 0.0)
    return _levelled(Island(island.vertex, uv @ even.T @ np.array([[c, -s], [s, c]]).T, island.faces))


def _levelled(island: Island) -> Island:
    """The island turned a little more, so that its flat holes, mouth and lids, lie along u as slits do."""
    tilt, length = [], []
    for loop in boundary_loops(island)[1:]:
        across = island.uv[loop] - island.uv[loop].mean(axis=0)
        (long, short), (along, _) = np.linalg.svd(across, full_matrices=False)[1:]
        angle = float(np.arctan(along[1] / along[0])) if abs(along[0]) > 1e-9 else np.pi
        if short < NARROW * long and abs(angle) < TILT:
            tilt.append(angle)
            length.append(long)
    if not tilt:
        return island
    mean = float(np.average(tilt, weights=length))
    c, s = np.cos(mean), np.sin(mean)
    return Island(island.vertex, island.uv @ np.array([[c, s], [-s, c]]).T, island.faces)


def _slopes(mesh: FitMesh, island: Island) -> tuple[Floats, Floats]:
    """(f, 2, 3) how position grows along u and v, and (f,) areas in (u, v) as weights; slivers count nothing."""
    a, b, c = island.faces[:, 0], island.faces[:, 1], island.faces[:, 2]
    sides = np.stack([island.uv[b] - island.uv[a], island.uv[c] - island.uv[a]], axis=1)
    points = mesh.vertices[island.vertex]
    rise = np.stack([points[b] - points[a], points[c] - points[a]], axis=1)
    det = np.linalg.det(sides)
    good = det > 1e-3 * np.median(np.abs(det))
    sides[~good] = np.eye(2)
    slope = np.linalg.solve(sides, rise) * good[:, None, None]
    steep = np.linalg.norm(slope, axis=(1, 2))
    usual = np.median(steep[good]) if good.any() else 1.0
    return slope, np.where(good & (steep < 4.0 * usual), np.abs(det), 0.0)


def _in_tile(island: Island, k: int, largest: float) -> Island:
    low, high = island.uv.min(axis=0), island.uv.max(axis=0)
    extent = max(float((high - low).max()), 1e-12)
    size = max(extent / max(largest, 1e-12), SMALLEST)
    return Island(island.vertex, (island.uv - low) * (size / extent) + [TILE * k, 0.0], island.faces)
