"""Tessellate a surface over a domain into a watertight triangle mesh, by quad tree (section 2.3 of the paper)."""

from __future__ import annotations

import numpy as np

from surface.base import keys
from surface.base.arrays import Floats, Ints
from surface.base.progress import Progress, part_of
from surface.spline.controlpoints import ControlPoints

from . import blocks, quadtree
from .domain import Domain
from .mesh import Mesh
from .quadtree import Lattice, Leaves
from .splitting import Limits, SplitTests, inner_side
from .trim import Flat, replace_vertices, trim

MAX_ROOTS = 24  # root cells along the longer side
CHUNK_VERTICES = 1 << 17  # evaluated between two reports of progress


def tessellate(surface: ControlPoints, domain: Domain, limits: Limits, flip: bool, progress: Progress) -> Mesh:
    """Do what :meth:`surface.DCPSurface.tessellate` says."""
    limits.check()
    size = diagonal_of(surface)
    if limits.max_points is None and limits.chord_error is None:
        limits = limits._replace(chord_error=1e-3 * size)
    scale = _mean_scale(surface, domain)
    joined = surface.closed[0] == tuple(domain.rect[:2]), surface.closed[1] == tuple(domain.rect[2:])  # goes around
    lattice = _lattice(domain, scale, limits.max_depth, limits.roots, joined)
    tests = SplitTests(surface, domain, lattice, scale, limits)
    if len(domain.segments):
        tests.follow_loops(limits.loop_error or limits.chord_error or 5e-4 * size)
    leaves, inner = quadtree.grow(lattice, tests.split, part_of(progress, 0.0, 0.4))
    if limits.measured and limits.chord_error is not None:
        progress("quad tree", 0.4)
        leaves, inner = tests.tighten(leaves, inner, limits.chord_error)
    progress("triangles", 0.45)
    corners, owner = quadtree.triangulate(lattice, leaves, inner)
    nodes, _, triangles = keys.unique(corners)
    flat = Flat(lattice.uv(*lattice.point(nodes)), triangles, owner)
    if len(domain.segments):
        progress("trimming", 0.55)
        flat = trim(flat, domain, scale)
    return _finish(surface, flat, domain, lattice, leaves, flip, part_of(progress, 0.6, 1.0))


def _mean_scale(surface: ControlPoints, domain: Domain) -> tuple[float, float]:
    """Return the mean length on the surface per unit of u and of v."""
    u0, u1, v0, v1 = domain.rect
    steps = (np.arange(24) + 0.5) / 24
    uv = np.stack(np.meshgrid(u0 + steps * (u1 - u0), v0 + steps * (v1 - v0)), axis=-1).reshape(-1, 2)
    slopes = surface.sample_derivatives(uv[domain.inside(uv)])[1][:, 1:]
    slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))]
    if not len(slopes):
        return 1.0, 1.0
    lengths = [float(np.linalg.norm(slopes[:, k], axis=1).mean()) for k in range(2)]
    low = 1e-6 * max(*lengths, 1e-300)
    return max(lengths[0], low), max(lengths[1], low)


def _lattice(
    domain: Domain, scale: tuple[float, float], depth: int, roots: tuple[int, int] | None, joined: tuple[bool, bool]
) -> Lattice:
    """Return root cells whose borders include those of the rectangle and the lines of all slits.

    Cells are roughly square on the surface, unless ``roots`` gives their number along u and v.
    """
    u0, u1, v0, v1 = domain.rect
    cuts: tuple[list[float], list[float]] = ([u0, u1], [v0, v1])
    for slit in domain.slits:
        along, across = (0, 1) if slit.axis == "u" else (1, 0)
        cuts[along].extend([slit.start, slit.end])
        cuts[across].append(slit.at)
    lines_u, lines_v = np.unique(np.clip(cuts[0], u0, u1)), np.unique(np.clip(cuts[1], v0, v1))
    if roots is not None:
        return Lattice(_divide(lines_u, (u1 - u0) / roots[0]), _divide(lines_v, (v1 - v0) / roots[1]), depth, joined)
    extent = (u1 - u0) * scale[0], (v1 - v0) * scale[1]
    least = min(float(np.diff(lines_u).min()) * scale[0], float(np.diff(lines_v).min()) * scale[1])
    edge = max(min(*extent, 1.2 * least), max(extent) / MAX_ROOTS)
    # A ring of fewer than three cells would fold flat.
    edges = [min(edge, extent[k] / 3) if joined[k] else edge for k in range(2)]
    return Lattice(_divide(lines_u, edges[0] / scale[0]), _divide(lines_v, edges[1] / scale[1]), depth, joined)


def _divide(borders: Floats, edge: float) -> Floats:
    """Return the borders with others between them, in equal steps of about ``edge``."""
    pieces = np.maximum(1, np.rint(np.diff(borders) / edge).astype(np.int64))
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(borders, borders[1:], pieces, strict=False)]
    return np.concatenate([*parts, borders[-1:]])


def _finish(
    surface: ControlPoints, flat: Flat, domain: Domain, lattice: Lattice, leaves: Leaves, flip: bool, progress: Progress
) -> Mesh:
    """Split vertices on slits, evaluate, drop uncovered triangles, sort by cell, and list control points by cell."""
    flat, side = _open_slits(flat, domain)
    code = _vertex_codes(flat, lattice, leaves)
    place, out = _evaluate(surface, flat.uv, side, code, part_of(progress, 0.1, 0.7))
    keep = (side >= 0)[flat.triangles].all(axis=1)
    if not keep.all():
        flat = Flat(flat.uv, flat.triangles[keep], flat.owner[keep])
        code = _vertex_codes(flat, lattice, leaves)
    flat = _drop_poles(surface, flat, out[place, 0], domain)
    code = _vertex_codes(flat, lattice, leaves)
    if any(lattice.joined):
        flat = _weld(flat, side, domain, lattice.joined)
    progress("cells", 0.7)
    order = _sort_used(flat, code)
    code, out = code[order], out[place[order]]
    rank = np.zeros(len(flat.uv), dtype=np.int32)
    rank[order] = np.arange(len(order))
    triangles = rank[flat.triangles]
    uv = np.ascontiguousarray(flat.uv[order])
    start = blocks.group(code, lattice.depth, uv, surface) if len(order) else np.zeros(1, np.int64)
    list_start, list_ids = blocks.point_lists(start, uv, side[order], surface)
    vertices = out[:, 0].copy()
    normals = unit_normals(vertices, out[:, 1], out[:, 2], triangles)
    progress("cells", 1.0)
    return Mesh(
        vertices=vertices,
        normals=-normals if flip else normals,
        triangles=np.ascontiguousarray(triangles[:, ::-1]) if flip else triangles,
        uv=uv,
        side=side[order],
        cell=np.repeat(np.arange(len(start) - 1, dtype=np.int32), np.diff(start)),
        cell_start=start,
        list_start=list_start,
        list_ids=list_ids,
        leaves=len(leaves.level),
        flip=flip,
        structure=surface.structure,
    )


def diagonal_of(surface: ControlPoints) -> float:
    """Return the diagonal of the control points' box; 1 if they are all in one place."""
    return float(np.linalg.norm(np.ptp(surface.points, axis=0))) or 1.0


def _drop_poles(surface: ControlPoints, flat: Flat, points: Floats, domain: Domain) -> Flat:
    """Drop triangles without area at a pole, a border of the rectangle that is a single point in space.

    ``points (m, 3)`` are the positions of the vertices.
    """
    kept, near = np.ones(len(flat.triangles), dtype=bool), 1e-9 * diagonal_of(surface)
    for number in range(4):
        on = (flat.uv[:, number // 2] == domain.rect[number])[flat.triangles]
        at = np.concatenate([points[flat.triangles[on]], surface.sample(_border_samples(domain, number), None)[2]])
        if (np.ptp(at, axis=0) <= near).all():
            beyond = np.linalg.norm(points[flat.triangles] - at[0], axis=2).max(axis=1) > near
            kept &= (on.sum(axis=1) < 2) | ~beyond
    return flat if kept.all() else Flat(flat.uv, flat.triangles[kept], flat.owner[kept])


def _border_samples(domain: Domain, number: int) -> Floats:
    """Return (33, 2) samples along a border of the rectangle: 0 and 1 at the ends of u, 2 and 3 at those of v."""
    axis, low, high = number // 2, np.array(domain.rect[::2]), np.array(domain.rect[1::2])
    uv: Floats = low + np.linspace(0.0, 1.0, 33)[:, None] * (high - low)
    uv[:, axis] = domain.rect[number]
    return uv


def _open_slits(flat: Flat, domain: Domain) -> tuple[Flat, Ints]:
    """Give vertices on an open slit one copy per side; return the triangulation and the limit each vertex takes."""
    if not domain.slits:
        return flat, np.zeros(len(flat.uv), dtype=np.int64)
    side = inner_side(flat.uv[flat.triangles], flat.uv[flat.triangles].mean(axis=1), domain)
    copies, _, triangles = keys.unique(flat.triangles * 4 + side)
    return Flat(flat.uv[copies // 4], triangles, flat.owner), copies % 4


def _evaluate(surface: ControlPoints, uv: Floats, side: Ints, code: Ints, progress: Progress) -> tuple[Ints, Floats]:
    """Evaluate in the order of codes; return the row of each vertex (m,), and rows of S, S_u and S_v (m, 3, 3).

    The limits that were taken are written to ``side``; -1 where nothing covers a vertex.
    """
    order, out = np.argsort(code, kind="stable"), np.zeros((len(uv), 3, 3))
    for first in range(0, len(order), CHUNK_VERTICES):
        progress("vertices", first / len(order))
        part = order[first : first + CHUNK_VERTICES]
        side[part], out[first : first + CHUNK_VERTICES] = surface.sample_derivatives(uv[part], side[part])
    place = np.zeros(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    return place, out


def _weld(flat: Flat, side: Ints, domain: Domain, joined: tuple[bool, bool]) -> Flat:
    """Use the vertices at the start of a closed direction instead of those at its end."""
    target = np.arange(len(flat.uv))
    for axis in range(2):
        if not joined[axis]:
            continue
        start, end = domain.rect[2 * axis : 2 * axis + 2]
        low, high = np.flatnonzero(flat.uv[:, axis] == start), np.flatnonzero(flat.uv[:, axis] == end)
        along = flat.uv[:, 1 - axis] + 1j * (side >> (1 - axis) & 1)  # place along the seam, limit there
        _, first, second = np.intersect1d(along[low], along[high], assume_unique=True, return_indices=True)
        target[high[second]] = low[first]
    return replace_vertices(flat, target[target])  # the corner of a torus goes both ways


def _vertex_codes(flat: Flat, lattice: Lattice, leaves: Leaves) -> Ints:
    """Return the code (m,) of the first leaf that uses each vertex; the greatest integer for unused vertices."""
    shift = lattice.depth - leaves.level
    x, y = leaves.cell[:, 0] << shift, leaves.cell[:, 1] << shift
    unit = 1 << lattice.depth
    root = (y >> lattice.depth) * lattice.shape[0] + (x >> lattice.depth)
    leaf_code = (root << (2 * lattice.depth)) | blocks.morton(x % unit, y % unit)
    code = np.full(len(flat.uv), np.iinfo(np.int64).max)
    blocks.lower_codes(flat.triangles, flat.owner, leaf_code, code)
    return code


def _sort_used(flat: Flat, code: Ints) -> Ints:
    """Return the used vertices, sorted by code."""
    used = np.zeros(len(flat.uv), dtype=bool)
    used[flat.triangles] = True
    order = np.argsort(code, kind="stable")
    return order[used[order]]


def unit_normals(points: Floats, su: Floats, sv: Floats, triangles: np.ndarray) -> Floats:
    """Return unit vectors (m, 3) along S_u x S_v; where that vanishes, the mean normal of the triangles around."""
    normal, bad = np.zeros(su.shape), np.zeros(len(su), dtype=np.bool_)
    blocks.unit_cross(su, sv, normal, bad)
    if bad.any():
        a, b, c = (points[triangles[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        total = np.zeros_like(points)
        for k in range(3):
            np.add.at(total, triangles[:, k], face)
        normal[bad] = total[bad] / np.maximum(np.linalg.norm(total[bad], axis=1), 1e-300)[:, None]
    return normal
