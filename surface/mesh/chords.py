"""Chord errors: distances between a surface and the triangles of a quad tree's leaves, densely sampled.

While the tree grows, nine samples per cell decide whether to quarter it. They miss features between the samples, and
ignore the diagonals of the triangles. So the finished leaves are sampled again, in steps of a quarter, against the
triangles that are drawn; also on creases, where the error between those steps is largest.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.spline.controlpoints import ControlPoints

from .quadtree import TEMPLATES

STEPS = 4  # along each side of a cell
MARGIN = 1.15  # greatest distance anywhere over that at samples: 1.07 for a parabola, 1.14 for two crossed ones
BATCH_CELLS = 20_000
GRID_STEPS = np.array([(i, j) for i in range(STEPS + 1) for j in range(STEPS + 1)])  # samples of a cell, in steps
GRID_FIRST = np.array(sorted(np.ndindex(STEPS + 3, STEPS + 3), key=lambda ij: max(ij) > STEPS))  # creases last
NODE_SAMPLES = np.array([0, 20, 24, 4, 10, 22, 14, 2])  # the samples at a leaf's corners 0-3 and edge middles 4-7


def crease_lines(surface: ControlPoints) -> tuple[Floats, Floats]:
    """Return the sorted coordinates in u, and in v, at which a blending function may have a bend or a jump.

    These are knots whose multiplicity is the degree or more; the first and the last of all knots are left out.
    """
    knots_u, knots_v, degrees_u, degrees_v = surface.arrays()[:4]
    return _multiple_knots(knots_u, degrees_u), _multiple_knots(knots_v, degrees_v)


def _multiple_knots(knots: Floats, degrees: Ints) -> Floats:
    """Return the knots (n, w) whose multiplicity in a row is at least its degree (n,), each once, sorted."""
    found = [np.zeros(0)]
    for degree in np.unique(degrees):
        rows = knots[degrees == degree, : degree + 2]
        last = max(int(degree) - 1, 0)  # further on in the row
        first = rows[:, : degree + 2 - last]
        found.append(first[first == rows[:, last:]])
    lines = np.unique(np.concatenate(found))
    inner: Floats = lines[(lines > knots.min()) & (lines < knots.max())]
    return inner


def sample_places(rect: Floats, creases: tuple[Floats, Floats] | None = None) -> Floats:
    """Return samples (n, 25, 2) of cells ``rect (n, 4)``, u0 u1 v0 v1, in steps of a quarter; v varies fastest.

    creases : as :func:`crease_lines` gives them; if there are any, 24 samples per cell on them follow. Of several
        creases in one half of a cell only the one nearest to the middle of that half is sampled.
    """
    steps = np.arange(STEPS + 1) / STEPS
    along = [(1.0 - steps) * rect[:, k : k + 1] + steps * rect[:, k + 1 : k + 2] for k in (0, 2)]
    order = GRID_STEPS
    if creases is not None and any(len(lines) for lines in creases):
        along = [np.hstack([at, _crease_samples(at, lines)]) for at, lines in zip(along, creases, strict=True)]
        order = GRID_FIRST
    return np.stack([along[0][:, order[:, 0]], along[1][:, order[:, 1]]], axis=-1)


def _crease_samples(along: Floats, lines: Floats) -> Floats:
    """Return the coordinate (n, 2) of a crease in either half of cells with samples at ``along (n, 5)``.

    It is that of the half's middle if it has no crease.
    """
    middles, ends = along[:, 1::2], np.concatenate([[-np.inf], lines, [np.inf]])
    after = np.searchsorted(lines, middles) + 1
    below, above = ends[after - 1], ends[after]
    near = np.where(middles - below < above - middles, below, above)
    return np.where((near > along[:, :-1:2]) & (near < along[:, 2::2]), near, middles)


def measure_errors(surface: ControlPoints, uv: Floats, side: Ints, pattern: Ints) -> Floats:
    """Return the greatest distance (n,) of the surface from the triangles of each leaf, in units of the points.

    It includes a margin for what lies between samples; 0 where nothing is covered.

    uv, side : (n, k, 2) and (n, k), the samples of :func:`sample_places` and the limits they take.
    pattern : (n,) which triangles each leaf has, see :func:`surface.mesh.quadtree.patterns`.
    """
    worst = np.zeros(len(uv))
    for first in range(0, len(uv), BATCH_CELLS):
        part = slice(first, first + BATCH_CELLS)
        points = surface.sample(uv[part].reshape(-1, 2), side[part].reshape(-1))[2].reshape(*uv[part].shape[:2], 3)
        _worst_distances(points, pattern[part], TEMPLATES, NODE_SAMPLES, worst[part])
    return MARGIN * worst


@kernel
def _segment_square(px, py, pz, a, b):
    """Return the squared distance of a point from the segment between ``a`` and ``b``."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    px, py, pz = px - a[0], py - a[1], pz - a[2]
    length = x * x + y * y + z * z
    t = 0.0
    if length > 0.0:
        t = min(max((px * x + py * y + pz * z) / length, 0.0), 1.0)
    return (px - t * x) ** 2 + (py - t * y) ** 2 + (pz - t * z) ** 2


@kernel
def triangle_square(p, a, b, c):
    """Return the squared distance of ``p (3,)`` from a triangle, which may have no area.

    It is that from the projection on the triangle's plane, if that lies inside, otherwise from the nearest edge
    (Ericson, Real-Time Collision Detection, 5.1.5).
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    x, y, z = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    if square > 0.0:
        s = ((y * vz - z * vy) * nx + (z * vx - x * vz) * ny + (x * vy - y * vx) * nz) / square
        t = ((uy * z - uz * y) * nx + (uz * x - ux * z) * ny + (ux * y - uy * x) * nz) / square
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            return (x * nx + y * ny + z * nz) ** 2 / square
    best = min(_segment_square(p[0], p[1], p[2], a, b), _segment_square(p[0], p[1], p[2], b, c))
    return min(best, _segment_square(p[0], p[1], p[2], c, a))


@kernel
def _worst_distances(points, pattern, templates, nodes, out):
    """Write the greatest distance of ``points (n, k, 3)`` from their leaf's nearest triangle; skip NaN."""
    for i in range(points.shape[0]):
        worst = 0.0
        for k in range(points.shape[1]):
            nearest = np.inf
            for t in range(templates.shape[1]):
                x, y, z = templates[pattern[i], t]
                if x < 0:
                    break
                a, b, c = points[i, nodes[x]], points[i, nodes[y]], points[i, nodes[z]]
                square = triangle_square(points[i, k], a, b, c)
                if square < nearest:
                    nearest = square
            if worst < nearest < np.inf:
                worst = nearest
        out[i] = np.sqrt(worst)
