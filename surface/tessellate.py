"""From a surface and a domain to a watertight mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import blocks, loops, quadtree
from .basis import Floats, Ints
from .domain import Domain
from .mesh import Mesh
from .quadtree import Lattice, Leaves
from .trim import Flat, trim

if TYPE_CHECKING:
    from .dcp import DCPSurface

MOST_CELLS = 4_000_000
MOST_ROOTS = 24  # along the longer side
RIM = 64  # cells along a side where the border of what is covered is followed


def tessellate(
    surface: DCPSurface,
    *,
    max_points: int | None = None,
    chord_error: float | None = None,
    max_depth: int = 9,
    min_depth: int = 0,
    domain: Domain | None = None,
    loop_error: float | None = None,
    roots: tuple[int, int] | None = None,
    flip: bool = False,
) -> Mesh:
    """See :meth:`surface.DCPSurface.tessellate`."""
    _check_limits(max_points, chord_error, max_depth, min_depth)
    where = Domain.of(surface) if domain is None else domain
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0))) or 1.0
    if max_points is None and chord_error is None:
        chord_error = 1e-3 * size
    scale = _lengths(surface, where)
    joined = _joined(surface, where)
    lattice = _lattice(where, scale, max_depth, roots, joined)
    tests = _Tests(surface, where, lattice, scale)
    tests.max_points, tests.chord_error, tests.min_depth = max_points, chord_error, min_depth
    if len(where.segments):
        tests.follow_loops(loop_error if loop_error is not None else chord_error or 5e-4 * size)
    leaves, inner = quadtree.grow(lattice, tests.split)
    keys, owner = quadtree.triangulate(lattice, leaves, inner)
    unique, triangles = np.unique(keys, return_inverse=True)
    flat = Flat(lattice.uv(*lattice.point(unique)), triangles.reshape(-1, 3), owner)
    if len(where.segments):
        flat = trim(flat, where, scale)
    return _finish(surface, flat, where, lattice, leaves, flip)


def _check_limits(max_points: int | None, chord_error: float | None, max_depth: int, min_depth: int) -> None:
    if max_points is not None and max_points < 1:
        raise ValueError(f"max_points: must be at least 1, not {max_points}")
    if chord_error is not None and not chord_error > 0:
        raise ValueError(f"chord_error: must be positive, not {chord_error}")
    if not 0 <= min_depth <= max_depth <= 20:
        raise ValueError(f"min_depth, max_depth: need 0 <= {min_depth} <= {max_depth} <= 20")


def _lengths(surface: DCPSurface, domain: Domain) -> tuple[float, float]:
    """Mean length on the surface per unit of u and of v."""
    u0, u1, v0, v1 = domain.rect
    steps = (np.arange(24) + 0.5) / 24
    uv = np.stack(np.meshgrid(u0 + steps * (u1 - u0), v0 + steps * (v1 - v0)), axis=-1).reshape(-1, 2)
    uv = uv[domain.inside(uv)]
    _, su, sv = surface.derivatives(uv)
    found = np.isfinite(su).all(axis=1) & np.isfinite(sv).all(axis=1)
    if not found.any():
        return 1.0, 1.0
    lengths = [float(np.linalg.norm(d[found], axis=1).mean()) for d in (su, sv)]
    low = 1e-6 * max(*lengths, 1e-300)
    return max(lengths[0], low), max(lengths[1], low)


def _lattice(
    domain: Domain, scale: tuple[float, float], depth: int, roots: tuple[int, int] | None, joined: tuple[bool, bool]
) -> Lattice:
    """Roots bordered by the rectangle and by the lines of all slits, roughly square on the surface."""
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
    edge = max(min(*extent, 1.2 * least), max(extent) / MOST_ROOTS)
    edge_u = min(edge, extent[0] / 3) if joined[0] else edge  # a ring of fewer than three cells would fold flat
    edge_v = min(edge, extent[1] / 3) if joined[1] else edge
    return Lattice(_divide(lines_u, edge_u / scale[0]), _divide(lines_v, edge_v / scale[1]), depth, joined)


def _joined(surface: DCPSurface, domain: Domain) -> tuple[bool, bool]:
    """In which directions does the rectangle go once around a closed surface?"""
    u0, u1, v0, v1 = domain.rect
    return surface.closed[0] == (u0, u1), surface.closed[1] == (v0, v1)


def _divide(borders: Floats, edge: float) -> Floats:
    """Borders with equal parts of about ``edge`` put between them."""
    pieces = np.maximum(1, np.rint(np.diff(borders) / edge).astype(np.int64))
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(borders, borders[1:], pieces, strict=False)]
    return np.concatenate([*parts, borders[-1:]])


class _Tests:
    """Which cells are to be quartered."""

    max_points: int | None = None
    chord_error: float | None = None
    min_depth = 0

    def __init__(self, surface: DCPSurface, domain: Domain, lattice: Lattice, scale: tuple[float, float]) -> None:
        self.surface, self.domain, self.lattice, self.scale = surface, domain, lattice, scale
        self.rings: list[tuple[Floats, Floats]] = []
        self.anchors: tuple[Floats, Floats] | None = None

    def follow_loops(self, error: float) -> None:
        """Ask for cells small enough that edges follow the loops within ``error``."""
        for loop in self.domain.loops:
            ring = np.asarray(loop)
            around = np.linalg.norm((np.roll(ring, -1, axis=0) - ring) * self.scale, axis=1).sum()
            step = max(2.0 * error, float(around) / 2000)
            points, sharp = loops.resample(ring, self.scale, step)
            size = np.zeros(len(points))
            loops.wanted_size(points * np.asarray(self.scale), sharp, error, 3.0 * error, size)
            self.rings.append((points, size))

    def split(self, level: int, cells: Ints) -> np.ndarray:
        """(n,) bool: which cells of a level to quarter."""
        if len(cells) > MOST_CELLS:
            raise ValueError(
                f"max_depth: {len(cells)} cells at level {level}; ask for a larger chord_error or max_points"
            )
        rect = self._rects(level, cells)
        active, along_loop = self._active(rect, cells, level)
        chosen = along_loop | (active & (level < self.min_depth))
        left = np.flatnonzero(active & ~chosen)
        if self.max_points is not None and len(left):
            chosen[left] = self._counts(rect[left]) > self.max_points
            left = np.flatnonzero(active & ~chosen)
        if self.chord_error is not None and len(left):
            chosen[left] = self._errors(level, cells[left]) > self.chord_error
        return chosen

    def _rects(self, level: int, cells: Ints) -> Floats:
        """(n, 4): u0, u1, v0, v1."""
        shift = self.lattice.depth - level
        low = self.lattice.uv(cells[:, 0] << shift, cells[:, 1] << shift)
        high = self.lattice.uv((cells[:, 0] + 1) << shift, (cells[:, 1] + 1) << shift)
        return np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)

    def _active(self, rect: Floats, cells: Ints, level: int) -> tuple[np.ndarray, np.ndarray]:
        """Which cells have a part in the domain, and which are too large for a loop that runs through them."""
        coarse = np.zeros(len(cells), dtype=bool)
        if not self.rings:
            return np.ones(len(cells), dtype=bool), coarse
        middle = np.stack([rect[:, :2].mean(axis=1), rect[:, 2:].mean(axis=1)], axis=1)
        active = self.domain.inside(middle)
        size = np.maximum((rect[:, 1] - rect[:, 0]) * self.scale[0], (rect[:, 3] - rect[:, 2]) * self.scale[1])
        code = quadtree.codes(self.lattice, level, cells)
        order = np.argsort(code)
        for ring, wanted in self.rings:
            at = self._find(level, ring)
            place = np.minimum(np.searchsorted(code[order], at), len(code) - 1)
            hit = code[order][place] == at
            cell, limit = order[place[hit]], wanted[hit]
            active[cell] = True
            coarse[cell[size[cell] > limit]] = True
        return active, coarse

    def _find(self, level: int, uv: Floats) -> Ints:
        """Codes of the cells that hold ``uv``; -1 outside the rectangle."""
        index = []
        for k, lines in enumerate((self.lattice.lines_u, self.lattice.lines_v)):
            root = np.searchsorted(lines, uv[:, k], side="right") - 1
            inner = np.clip(root, 0, len(lines) - 2)
            part = (uv[:, k] - lines[inner]) / (lines[inner + 1] - lines[inner])
            index.append(np.where(root == inner, (inner << level) + (part * (1 << level)).astype(np.int64), -1))
        return quadtree.codes(self.lattice, level, np.stack(index, axis=1))

    def _counts(self, rect: Floats) -> Ints:
        bins = self.surface.bins
        out = np.zeros(len(rect), dtype=np.int64)
        blocks.count_open(rect, self.surface.all_supports, bins.grid, bins.shape, bins.start, bins.ids, out)
        return out

    def _errors(self, level: int, cells: Ints) -> Floats:
        """Greatest distance of the surface from the cell's chords, at edge middles and the centre; 0 if uncovered."""
        shift = self.lattice.depth - level
        step = 1 << shift
        corner = cells << shift
        grid = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2], [2, 2]]) * (step // 2)
        x, y = corner[:, :1] + grid[:, 0], corner[:, 1:] + grid[:, 1]
        uv = self.lattice.uv(x, y)
        side = _inner_side(uv, uv[:, 4], self.domain)
        key = self.lattice.key(x, y) * 4 + side
        unique, first, back = np.unique(key, return_index=True, return_inverse=True)
        points = self.surface.evaluate(uv.reshape(-1, 2)[first], side=unique & 3)
        corners = points[back.reshape(key.shape)]
        worst = _chord_errors(corners)
        self._add_anchors(level, cells, corners, worst)
        held = np.isfinite(corners[:, :, 0])
        partly = held.any(axis=1) & ~held.all(axis=1)
        worst[partly & (self.lattice.shape[0] << level < RIM) & (self.lattice.shape[1] << level < RIM)] = np.inf
        return worst

    def _add_anchors(self, level: int, cells: Ints, p: Floats, worst: Floats) -> None:
        """Raise ``worst`` to how far the surface is from its cell where control points stand.

        So a feature between the samples of a large cell is not overlooked: where there is detail there are points.
        """
        if self.anchors is None:
            self.anchors = _anchors(self.surface, self.domain)
        uv, points = self.anchors
        code, at = quadtree.codes(self.lattice, level, cells), self._find(level, uv)
        order = np.argsort(code)
        place = np.minimum(np.searchsorted(code[order], at), len(code) - 1)
        hit = np.flatnonzero(code[order][place] == at)
        cell = order[place[hit]]
        rect = self._rects(level, cells[cell])
        s = ((uv[hit, 0] - rect[:, 0]) / (rect[:, 1] - rect[:, 0]))[:, None]
        t = ((uv[hit, 1] - rect[:, 2]) / (rect[:, 3] - rect[:, 2]))[:, None]
        a, b, c, d = (p[cell, k] for k in (0, 2, 6, 8))
        normal = np.cross(d - a, c - b)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        offset = points[hit] - (1 - t) * ((1 - s) * a + s * b) - t * ((1 - s) * c + s * d)
        np.fmax.at(worst, cell, np.abs((offset * normal).sum(axis=1)))


def _anchors(surface: DCPSurface, domain: Domain) -> tuple[Floats, Floats]:
    """(k, 2) and (k, 3): the surface where the blending functions of its points are near their greatest."""
    knots, degrees = surface.padded, surface.degrees
    uv = np.zeros((surface.n, 2))
    for k in range(2):
        column = np.arange(knots[k].shape[1])
        inner = (column >= 1) & (column <= degrees[k][:, None])
        total = np.where(inner, knots[k], 0).sum(axis=1)
        middle = (knots[k][:, 0] + knots[k][:, -1]) / 2
        uv[:, k] = np.where(degrees[k] > 0, total / np.maximum(degrees[k], 1), middle)  # Greville abscissa
    uv = uv[domain.inside(uv)]
    points = surface.evaluate(uv)
    covered = np.isfinite(points[:, 0])
    return uv[covered], points[covered]


def _inner_side(uv: Floats, centre: Floats, domain: Domain) -> Ints:
    """(n, k): limits that points of cells (n, k, 2) take so that they belong to their cell's side of every slit."""
    side = np.zeros(uv.shape[:-1], dtype=np.int64)
    for slit in domain.slits:
        axis, bit = (1, 2) if slit.axis == "u" else (0, 1)
        on = slit.holds(uv.reshape(-1, 2)).reshape(side.shape)
        side[on & (centre[:, None, axis] < slit.at)] |= bit
    return side


def _chord_errors(p: Floats) -> Floats:
    """(n,): distances for the nine points ``p (n, 9, 3)`` of cells, rows of three from the low corner up."""
    worst = np.zeros(len(p))
    for a, middle, b in ((0, 1, 2), (0, 3, 6), (2, 5, 8), (6, 7, 8)):
        worst = np.fmax(worst, _off_line(p[:, a], p[:, middle], p[:, b]))
    bow = np.fmin(_off_line(p[:, 0], p[:, 4], p[:, 8]), _off_line(p[:, 2], p[:, 4], p[:, 6]))
    return np.fmax(worst, bow)


def _off_line(a: Floats, middle: Floats, b: Floats) -> Floats:
    """Distance of ``middle`` from the line a-b."""
    along, offset = b - a, middle - a
    length = np.maximum((along * along).sum(axis=1), 1e-300)
    part = np.clip((offset * along).sum(axis=1) / length, 0, 1)
    return np.linalg.norm(offset - part[:, None] * along, axis=1)


def _finish(surface: DCPSurface, flat: Flat, domain: Domain, lattice: Lattice, leaves: Leaves, flip: bool) -> Mesh:
    """Split vertices on slits, evaluate, drop uncovered triangles, order by cell, make the lists."""
    flat, side = _open_slits(flat, domain)
    side, out = surface.sample_derivatives(flat.uv, side)
    points, su, sv = out[:, 0], out[:, 1], out[:, 2]
    keep = (side >= 0)[flat.triangles].all(axis=1)
    flat = Flat(flat.uv, flat.triangles[keep], flat.owner[keep])
    code = _codes(flat, lattice, leaves)
    if any(lattice.joined):
        flat = _weld(flat, side, domain, lattice.joined)
    order = _used_in_order(flat, code)
    code = code[order]
    rank = np.zeros(len(flat.uv), dtype=np.int32)
    rank[order] = np.arange(len(order))
    triangles = rank[flat.triangles]
    uv, supports = np.ascontiguousarray(flat.uv[order]), surface.all_supports
    start = blocks.group(code, lattice.depth, uv, supports, surface.bins) if len(order) else np.zeros(1, np.int64)
    list_start, list_ids = blocks.point_lists(start, uv, supports, surface.bins)
    normals = unit_normals(points[order], su[order], sv[order], triangles)
    return Mesh(
        vertices=points[order],
        normals=-normals if flip else normals,
        triangles=np.ascontiguousarray(triangles[:, ::-1]) if flip else triangles,
        uv=uv,
        side=side[order],
        cell=np.repeat(np.arange(len(start) - 1, dtype=np.int32), np.diff(start)),
        cell_start=start,
        list_start=list_start,
        list_ids=list_ids,
        leaves=len(leaves),
        flip=flip,
    )


def _open_slits(flat: Flat, domain: Domain) -> tuple[Flat, Ints]:
    """Give the vertices on an open slit one copy per side; returns the limit each vertex takes."""
    side = np.zeros(flat.triangles.shape, dtype=np.int64)
    if domain.slits:
        side = _inner_side(flat.uv[flat.triangles], flat.uv[flat.triangles].mean(axis=1), domain)
    unique, triangles = np.unique(flat.triangles * 4 + side, return_inverse=True)
    return Flat(flat.uv[unique // 4], triangles.reshape(-1, 3), flat.owner), unique % 4


def _weld(flat: Flat, side: Ints, domain: Domain, joined: tuple[bool, bool]) -> Flat:
    """Use the vertices at the start of a closed direction instead of those at its end."""
    target = np.arange(len(flat.uv))
    for axis in range(2):
        if not joined[axis]:
            continue
        start, end = domain.rect[2 * axis : 2 * axis + 2]
        low, high = np.flatnonzero(flat.uv[:, axis] == start), np.flatnonzero(flat.uv[:, axis] == end)
        ours, theirs = (_seam_keys(flat.uv[at, 1 - axis], side[at], 1 - axis) for at in (low, high))
        _, first, second = np.intersect1d(ours, theirs, assume_unique=True, return_indices=True)
        target[high[second]] = low[first]
    target = target[target]  # the corner of a torus goes both ways
    triangles = target[flat.triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return Flat(flat.uv, triangles[whole], flat.owner[whole])


def _seam_keys(along: Floats, side: Ints, axis: int) -> np.ndarray:
    """(k,) complex: place along a seam, and the limit in that direction."""
    return along + 1j * (side >> axis & 1)


def _codes(flat: Flat, lattice: Lattice, leaves: Leaves) -> Ints:
    """(m,) code of the first leaf that uses a vertex; the greatest number for vertices that none uses."""
    shift = lattice.depth - leaves.level
    x, y = leaves.cell[:, 0] << shift, leaves.cell[:, 1] << shift
    unit = 1 << lattice.depth
    root = (y >> lattice.depth) * lattice.shape[0] + (x >> lattice.depth)
    leaf_code = (root << (2 * lattice.depth)) | blocks.morton(x % unit, y % unit)
    code = np.full(len(flat.uv), np.iinfo(np.int64).max)
    np.minimum.at(code, flat.triangles.ravel(), np.repeat(leaf_code[flat.owner], 3))
    return code


def _used_in_order(flat: Flat, code: Ints) -> Ints:
    """Used vertices, rising by code."""
    used = np.zeros(len(flat.uv), dtype=bool)
    used[flat.triangles] = True
    order = np.argsort(code, kind="stable")
    return order[used[order]]


def unit_normals(points: Floats, su: Floats, sv: Floats, triangles: np.ndarray) -> Floats:
    """(m, 3) unit vectors along S_u x S_v; where that vanishes, the mean of the triangles around."""
    normal = np.cross(su, sv)
    length = np.linalg.norm(normal, axis=1)
    size = np.linalg.norm(su, axis=1) * np.linalg.norm(sv, axis=1)
    bad = ~(length > 1e-12 * np.maximum(size, 1e-300))
    if bad.any():
        a, b, c = (points[triangles[:, k]] for k in range(3))
        face = np.cross(b - a, c - a)
        total = np.zeros_like(points)
        for k in range(3):
            np.add.at(total, triangles[:, k], face)
        normal[bad] = total[bad]
        length[bad] = np.linalg.norm(normal[bad], axis=1)
    normal /= np.maximum(length, 1e-300)[:, None]
    return normal
