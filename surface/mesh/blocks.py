"""Group a mesh's vertices into cells that share one list of control points (section 2.4 of the paper).

A cell is a node of the quad tree, at any level, with all vertices below it. Nodes are chosen so that applying their
weights is cheapest: a large cell stores weights of points that influence only some of its vertices, while small cells
read the same control points many times.
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
PER_POINT = 10.0  # cost of reading a control point, relative to that of applying one weight
MAX_VERTICES = 4096  # of a cell, so that its sums stay in the cache


@kernel
def morton(x, y):
    """Return the Morton codes (m,) int64, the interleaved bits of x and y (m,), for 0 <= x, y < 2**24."""
    out = np.zeros(x.shape[0], dtype=np.int64)
    for s in range(x.shape[0]):
        for bit in range(24):
            out[s] |= ((x[s] >> bit) & 1) << (2 * bit)
            out[s] |= ((y[s] >> bit) & 1) << (2 * bit + 1)
    return out


@kernel
def lower_codes(triangles, leaf, leaf_code, code):
    """Lower ``code (m,)`` of each vertex to the minimum code of the leaves whose triangles use it.

    ``leaf (t,)`` is the leaf of every triangle.
    """
    for t in range(triangles.shape[0]):
        for k in range(3):
            vertex = triangles[t, k]
            code[vertex] = min(code[vertex], leaf_code[leaf[t]])


@kernel
def unit_cross(a, b, out, bad):
    """Write unit vectors along a x b to ``out``, and to ``bad`` where the product is too short to have a direction."""
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
    """Return the first vertex of every cell and the number of vertices, (c + 1,) int64.

    Vertices ``uv (m, 2)`` are sorted by ``code (m,)`` int64, whose low ``2 * depth`` bits are the Morton code of
    the leaf within its root.
    """
    start = np.zeros(len(code) + 1, dtype=np.int64)
    count = _group(code, depth, uv, *surface.arrays()[:2], *surface.bin_arrays(), start)
    start[count] = len(code)
    return start[: count + 1].copy()


@kernel
def count_points(boxes, knots_u, knots_v, grid, shape, start, ids, out):
    """Write to ``out (k,)`` the number of points whose support meets each of ``boxes (k, 4)``."""
    no_ids = np.zeros(0, dtype=np.int32)
    for k in range(boxes.shape[0]):
        out[k] = points_in(boxes[k], knots_u, knots_v, grid, shape, start, ids, no_ids)


@kernel
def _cost(uv, low, high, knots_u, knots_v, grid, shape, start, ids, box, no_ids):
    """Return the cost of a cell of the vertices from ``low`` to below ``high``."""
    bounding_box(uv, low, high, box)
    points = points_in(box, knots_u, knots_v, grid, shape, start, ids, no_ids)
    return points * ((high - low + LANES - 1) // LANES * LANES + PER_POINT)


@kernel
def _run_end(code, low, high, shift):
    """Return the end of the run of vertices from ``low`` on with equal ``code >> shift``, which are one node's."""
    end = low + 1
    while end < high and (code[end] >> shift) == (code[low] >> shift):
        end += 1
    return end


@kernel
def _should_descend(code, uv, low, high, shift, knots_u, knots_v, grid, shape, start, ids, box, no_ids):
    """Whether to visit the children of a node, as they are cheaper than one cell, or the node has only one child.

    Nodes of too many vertices are always split, leaves and nodes of at most one vector of vertices never.
    """
    if shift == 0 or high - low <= LANES:
        return False
    if high - low > MAX_VERTICES or _run_end(code, low, high, shift - 2) == high:
        return True
    parts, a = 0.0, low
    while a < high:
        b = _run_end(code, a, high, shift - 2)
        parts += _cost(uv, a, b, knots_u, knots_v, grid, shape, start, ids, box, no_ids)
        a = b
    return parts < _cost(uv, low, high, knots_u, knots_v, grid, shape, start, ids, box, no_ids)


@kernel
def _group(code, depth, uv, knots_u, knots_v, grid, shape, start, ids, out):
    """Visit the nodes depth first; descend where that is cheaper, otherwise make the node a cell.

    Writes the first vertex of every cell to ``out``; returns the number of cells.
    """
    box, no_ids = np.zeros(4), np.zeros(0, dtype=np.int32)
    ends, shifts = np.zeros(depth + 2, dtype=np.int64), np.zeros(depth + 2, dtype=np.int64)
    count, low, top = 0, 0, -1
    while low < code.shape[0]:
        if top < 0:
            top, shifts[0] = 0, 2 * depth
            ends[0] = _run_end(code, low, code.shape[0], 2 * depth)
        high, shift = ends[top], shifts[top]
        if _should_descend(code, uv, low, high, shift, knots_u, knots_v, grid, shape, start, ids, box, no_ids):
            top += 1
            shifts[top], ends[top] = shift - 2, _run_end(code, low, high, shift - 2)
            continue
        out[count] = low
        count, low = count + 1, high
        while top >= 0 and ends[top] == low:  # go up to the nearest node with an unvisited child
            top -= 1
        if top >= 0:
            top += 1
            ends[top] = _run_end(code, low, ends[top - 1], shifts[top])
    return count


@kernel
def _fill_lists(cell_start, uv, knots_u, knots_v, grid, shape, start, ids, list_start, out):
    box = np.zeros(4)
    for c in range(cell_start.shape[0] - 1):
        bounding_box(uv, cell_start[c], cell_start[c + 1], box)
        room = out[list_start[c] :]
        list_start[c + 1] = list_start[c] + points_in(box, knots_u, knots_v, grid, shape, start, ids, room)


def point_lists(cell_start: Ints, uv: Floats, side: Ints, surface: ControlPoints) -> tuple[Ints, np.ndarray]:
    """Return the control points that influence a vertex of each cell: ``list_start (c + 1,)`` and ``list_ids (k,)``.

    Lists are ascending. A point is in the list if it has a weight at a vertex of the cell, or a derivative of it, at
    the limit that the vertex takes (``side``).
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
