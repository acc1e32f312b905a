"""Change the texture coordinates of an unknown mesh's islands so that control points can be fitted in them.

Where one half of a face lies on the other one in (u, v), mirrored, it becomes an island of its own. Every island is
turned so that up on the head is up in (u, v), since slits run along u. It is scaled so that, on average, lengths in
(u, v) are lengths on the surface. Flat holes are opened, so that lengths across a lid are about right, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.source.chart import TILE, slit_of
from surface.fit.source.islands import Island, boundary_loops, signed_areas
from surface.fit.source.mesh import FitMesh, components, directed_edges
from surface.head.model.parameters import smoothstep

MIN_HALF_AREA = 0.03  # of a mirrored half, relative to its island; smaller areas of that orientation are folds
MAX_TILT_RAD = 0.35  # of a hole: those tilted further do not show which direction is level
MAX_ASPECT = 0.7  # height over width of a hole: higher ones do not show it either
MIN_SLOPE = 0.05  # sine of a slope below which a surface has no upward direction
MIN_ISLAND_SIZE = 0.12  # of an island in its tile, relative to the largest island
COLUMNS = 33  # places along a hole at which its middle line is computed
MAX_SLIT_OFFSET = 0.7  # of a slit from the middle line of its hole, in half heights of the hole
OPENED_ASPECT = 0.4  # height over width that a flat hole is given
BAND_HEIGHT = 2.0  # half the height of the band that is stretched most, in heights of the hole
FADE_V = 2.0  # distance above and below the hole over which the stretching fades, in widths of the hole
FADE_U = 1.2  # distance beside the hole over which it fades, in widths of the hole


def separate(island: Island) -> list[Island]:
    """The island cut into islands without overlap: faces that are clockwise in (u, v), and anticlockwise ones."""
    area = signed_areas(island)
    one, two = _neighbours(island)
    same = (area[one] > 0) == (area[two] > 0)
    label = components(one[same], two[same], len(area))
    size = np.bincount(label, np.abs(area))
    large = size >= MIN_HALF_AREA * size.sum()
    if large.sum() < 2:
        return [island]
    label = _join_small(label, large, one, two)
    return [island.subset(label == k) for k in np.flatnonzero(large)]


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
    out, changed = label.copy(), True
    while changed:
        changed = False
        for at, other in [(a, out[b]) for a, b in ((one, two), (two, one))]:
            take = ~large[out[at]] & large[other]
            out[at[take]] = other[take]
            changed |= bool(take.any())
    return out


def lay_out(mesh: FitMesh, islands: list[Island]) -> list[Island]:
    """Islands of one part side by side in tiles, upright, each as large as its surface."""
    upright = [_upright(mesh, island) for island in islands]
    largest = max((float(np.ptp(i.uv, axis=0).max()) for i in upright), default=1.0)
    return [_in_tile(island, k, largest) for k, island in enumerate(upright)]


def _upright(mesh: FitMesh, island: Island) -> Island:
    """The island turned and scaled: faces anticlockwise in (u, v), up on the head along v, lengths in mm."""
    uv = island.uv * ([-1.0, 1.0] if signed_areas(island).sum() < 0 else [1.0, 1.0])
    slope, weight = _slopes(mesh, replace(island, uv=uv))
    total = max(float(weight.sum()), 1e-30)
    scale, axes = np.linalg.eigh(np.einsum("f,fik,fjk->ij", weight, slope, slope) / total)
    even = (axes * np.sqrt(np.maximum(scale, 1e-6 * max(float(scale.max()), 1e-30)))) @ axes.T
    up = np.linalg.inv(even) @ (weight @ slope[:, :, 1]) / total
    c, s = up[::-1] / np.linalg.norm(up) if np.linalg.norm(up) > MIN_SLOPE else (1.0, 0.0)
    return _levelled(replace(island, uv=uv @ even.T @ np.array([[c, -s], [s, c]]).T))


def _levelled(island: Island) -> Island:
    """The island turned a little more, so that its flat holes (mouth and lids) lie along u, as slits do."""
    tilt, length = [], []
    for loop in boundary_loops(island)[1:]:
        across = island.uv[loop] - island.uv[loop].mean(axis=0)
        (long, short), (along, _) = np.linalg.svd(across, full_matrices=False)[1:]
        angle = float(np.arctan(along[1] / along[0])) if abs(along[0]) > 1e-9 else np.pi
        if short < MAX_ASPECT * long and abs(angle) < MAX_TILT_RAD:
            tilt.append(angle)
            length.append(long)
    if not tilt:
        return island
    mean = float(np.average(tilt, weights=length))
    c, s = np.cos(mean), np.sin(mean)
    return replace(island, uv=island.uv @ np.array([[c, s], [-s, c]]).T)


def _slopes(mesh: FitMesh, island: Island) -> tuple[Floats, Floats]:
    """(f, 2, 3) derivatives of position along u and v, and (f,) areas in (u, v) as weights, 0 for slivers."""
    a, b, c = island.faces[:, :3].T
    points = mesh.vertices[island.vertex]
    sides, rise = (np.stack([x[b] - x[a], x[c] - x[a]], axis=1) for x in (island.uv, points))
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
    size = max(extent / max(largest, 1e-12), MIN_ISLAND_SIZE)
    return replace(island, uv=(island.uv - low) * (size / extent) + [TILE * k, 0.0])


def straighten_holes(island: Island) -> Island:
    """The island with v shifted so that the middle line of every hole with a slit has one v.

    A slit runs along u from one end of its hole to the other. In a bent or tilted hole it would cut the skin beside the
    hole. The shift fades with the distance from the hole; u is unchanged.
    """
    for loop in boundary_loops(island)[1:]:
        rim = island.uv[loop]
        if slit_of(rim) is not None:
            island = replace(island, uv=_straightened(island.uv, rim))
    return island


def _straightened(uv: Floats, rim: Floats) -> Floats:
    """All points (m, 2), shifted so that the hole with this rim is straight; unchanged where a slit fits into it."""
    low, high = rim.min(axis=0), rim.max(axis=0)
    width, level = float(high[0] - low[0]), 0.5 * float(low[1] + high[1])
    u = low[0] + width * np.linspace(0.0, 1.0, COLUMNS)
    middle, half = middle_line(rim, u)
    off = middle - level
    inner = slice(1, -1)
    if (np.abs(off) < MAX_SLIT_OFFSET * half)[inner].all():
        return uv
    outside = np.maximum(low[0] - uv[:, 0], uv[:, 0] - high[0]) / (FADE_U * width)
    fade = (1.0 - smoothstep(outside)) * np.exp(-(((uv[:, 1] - level) / (FADE_V * width)) ** 2))
    return np.column_stack([uv[:, 0], uv[:, 1] - fade * np.interp(uv[:, 0], u, off)])


def middle_line(rim: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Middle (n,) and half height (n,) in v of a hole with this rim (k, 2), at places ``u (n,)`` along it."""
    start, end = rim, np.roll(rim, -1, axis=0)
    middle, half = np.empty(len(u)), np.empty(len(u))
    for k, at in enumerate(np.clip(u, rim[:, 0].min(), rim[:, 0].max())):
        met = (np.minimum(start[:, 0], end[:, 0]) <= at) & (np.maximum(start[:, 0], end[:, 0]) >= at)
        along = end[met, 0] - start[met, 0]
        flat = np.abs(along) < 1e-12
        share = np.where(flat, 0.0, (at - start[met, 0]) / np.where(flat, 1.0, along))
        v = start[met, 1] + share * (end[met, 1] - start[met, 1])
        middle[k], half[k] = 0.5 * (v.min() + v.max()), 0.5 * (v.max() - v.min())
    return middle, half


def open_flat_holes(island: Island) -> Island:
    """The island with v stretched about the centre lines of its flat holes.

    Within a hole's width, lines of constant v stay straight, and slits with them. The stretching fades with the
    distance from the hole; u is unchanged.
    """
    shift = np.zeros(len(island.uv))
    for loop in boundary_loops(island)[1:]:
        (u0, v0), (u1, v1) = island.uv[loop].min(axis=0), island.uv[loop].max(axis=0)
        width, height = u1 - u0, max(v1 - v0, 1e-6)
        if height < OPENED_ASPECT * width:
            u, v = island.uv[:, 0], island.uv[:, 1] - 0.5 * (v0 + v1)
            outside = np.maximum(u0 - u, u - u1) / (FADE_U * width)
            fade = (1.0 - smoothstep(outside)) * np.exp(-((v / (FADE_V * width)) ** 2))
            half = BAND_HEIGHT * height
            shift += (OPENED_ASPECT * width / height - 1.0) * half * np.arctan(v / half) * fade
    return replace(island, uv=np.column_stack([island.uv[:, 0], island.uv[:, 1] + shift]))
