"""Group a mesh's vertices into cells that share one list of control points (paper, 2.4).

A cell is a branch of the quad tree, chosen so that applying its weights costs least: a large cell wastes weights
on points that reach only some of its vertices, a small one reads control points too often.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.spline.controlpoints import ControlPoints
from surface.spline.kernels import bounding_box, points_in
from surface.spline.weighing import mark_reaching

LANES = 8  # float32 numbers per vector operation
PER_POINT = 10.0  # cost of reading a control point, in weights
MOST = 4096  # vertices of the largest cell, so that a block's sums stay in the cache


@kernel
def morton(x, y):
    """(m,) int64: bits of x and y in turn, for 0 <= x, y < 2**24."""
    out = np.zeros(x.shape[0], dtype=np.int64)
    for s in range(x.shape[0]):
        for bit in range(24):
            out[s] |= ((x[s] >> bit) & 1) << (2 * bit)
            out[s] |= ((y[s] >> bit) & 1) << (2 * bit + 1)
    return out


@kernel
def least_codes(triangles, owner, leaf_code, code):
    """Lower ``code (m,)`` to the least code of the leaves whose triangles use a vertex."""
    for t in range(triangles.shape[0]):
        for k in range(3):
            vertex = triangles[t, k]
            code[vertex] = min(code[vertex], leaf_code[owner[t]])


@kernel
def unit_cross(a, b, out, bad):
    """Unit vectors along a x b; ``bad`` says where the product is too short to have a direction."""
    for s in range(a.shape[0]):
        x = a[s, 1] * b[s, 2] - a[s, 2] * b[s, 1]
        y = a[s, 2] * b[s, 0] - a[s, 0] * b[s, 2]
        z = a[s, 0] * b[s, 1] - a[s, 1] * b[s, 0]
        length = np.sqrt(x * x + y * y + z * z)
        size = np.sqrt(a[s, 0] ** 2 + a[s, 1] ** 2 + a[s, 2] ** 2) * np.sqrt(b[s, 0] ** 2 + b[s, 1] ** 2 + b[s, 2] ** 2)
        bad[s] = not length > 1e-12 * max(size, 1e-300)
        if not bad[s]:
            out[s, 0], out[s, 1], out[s, 2] = x / length, y / length, z / length


def group(code: Ints, depth: int, uv: Floats, surface: ControlPoints) -> Ints:
    """First vertices of the cells, (c + 1,) int64, for vertices ``uv (m, 2)`` that rise by ``code (m,)`` int64.

    The low ``2 * depth`` bits of a code are the Morton code of the leaf within its root.
    """
    start = np.zeros(len(code) + 1, dtype=np.int64)
    count = _group(code, depth, uv, *surface.arrays()[:2], *surface.bin_arrays(), start)
    start[count] = len(code)
    return start[: count + 1].copy()


@kernel
def count_points(boxes, knots_u, knots_v, grid, shape, start, ids, out):
    """Number of points whose support meets each of ``boxes (k, 4)``."""
    none = np.zeros(0, dtype=np.int32)
    for k in range(boxes.shape[0]):
        out[k] = points_in(boxes[k], knots_u, knots_v, grid, shape, start, ids, none)


@kernel
def _cost(uv, low, high, knots_u, knots_v, grid, shape, start, ids, box, none):
    bounding_box(uv, low, high, box)
    points = points_in(box, knots_u, knots_v, grid, shape, start, ids, none)
    return points * ((high - low + LANES - 1) // LANES * LANES + PER_POINT)


@kernel
def _next_edge(code, low, high, shift):
    """End of the run from ``low`` on with equal ``code >> shift``."""
    end = low + 1
    while end < high and (code[end] >> shift) == (code[low] >> shift):
        end += 1
    return end


@kernel
def _splits(code, uv, low, high, shift, knots_u, knots_v, grid, shape, start, ids, box, none):
    """Are the four parts of a branch cheaper than the whole?"""
    if shift == 0 or high - low <= LANES:
        return False
    if high - low > MOST or _next_edge(code, low, high, shift - 2) == high:
        return True
    parts, a = 0.0, low
    while a < high:
        b = _next_edge(code, a, high, shift - 2)
        parts += _cost(uv, a, b, knots_u, knots_v, grid, shape, start, ids, box, none)
        a = b
    return parts < _cost(uv, low, high, knots_u, knots_v, grid, shape, start, ids, box, none)


@kernel
def _group(code, depth, uv, knots_u, knots_v, grid, shape, start, ids, out):
    """Visit the branches in order: go down a level where that is cheaper, else take the branch as a cell."""
    box, none = np.zeros(4), np.zeros(0, dtype=np.int32)
    ends, shifts = np.zeros(depth + 2, dtype=np.int64), np.zeros(depth + 2, dtype=np.int64)
    count, low, top = 0, 0, -1
    while low < code.shape[0]:
        if top < 0:
            top, shifts[0] = 0, 2 * depth
            ends[0] = _next_edge(code, low, code.shape[0], 2 * depth)
        high, shift = ends[top], shifts[top]
        if _splits(code, uv, low, high, shift, knots_u, knots_v, grid, shape, start, ids, box, none):
            top += 1
            shifts[top], ends[top] = shift - 2, _next_edge(code, low, high, shift - 2)
            continue
        out[count] = low
        count, low = count + 1, high
        while top >= 0 and ends[top] == low:  # up to the first branch with a part left, then to that part
            top -= 1
        if top >= 0:
            top += 1
            ends[top] = _next_edge(code, low, ends[top - 1], shifts[top])
    return count


@kernel
def _fill_lists(cell_start, uv, knots_u, knots_v, grid, shape, start, ids, list_start, out):
    box = np.zeros(4)
    for c in range(cell_start.shape[0] - 1):
        bounding_box(uv, cell_start[c], cell_start[c + 1], box)
        room = out[list_start[c] :]
        list_start[c + 1] = list_start[c] + points_in(box, knots_u, knots_v, grid, shape, start, ids, room)


def point_lists(cell_start: Ints, uv: Floats, side: Ints, surface: ControlPoints) -> tuple[Ints, np.ndarray]:
    """Control points that reach a vertex of each cell: ``list_start (c + 1,)`` and ``list_ids (k,)``, rising per cell.

    A point counts that has a weight at a vertex, or a derivative of it, at the limit that the vertex takes (``side``).
    """
    start = np.zeros(len(cell_start), dtype=np.int64)
    arrays = (cell_start, uv, *surface.arrays()[:2], *surface.bin_arrays(), start)
    _fill_lists(*arrays, np.zeros(0, dtype=np.int32))
    ids = np.zeros(int(start[-1]), dtype=np.int32)
    _fill_lists(*arrays, ids)
    cell = np.repeat(np.arange(len(start) - 1), np.diff(start))
    ids, reach = ids[np.lexsort((ids, cell))], np.zeros(len(ids), dtype=np.bool_)
    mark_reaching(*surface.arrays()[:4], uv, side, cell_start, start, ids, reach)
    kept = np.bincount(cell[reach], minlength=len(start) - 1)
    return np.concatenate([[0], np.cumsum(kept)]), ids[reach]
