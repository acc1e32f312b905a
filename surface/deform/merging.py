"""Join neighbouring cells of a mesh: fewer points are read where cells share most of them.

The cells of a mesh are small enough that hardly a point of a list misses many of their vertices. Where tiles have lists
of their own (see :mod:`.packing`), larger cells waste no weights, and every control point is read less often.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Bools
from surface.base.jit import kernel
from surface.mesh.mesh import Mesh

PER_POINT = 45.0  # cost of a point in a cell's list, in weights (measured; that of the mesh's cells is 10)
MAX_VERTICES = 256  # vertices of a joined cell


def merge_cells(mesh: Mesh, per_point: float = PER_POINT, most: int = MAX_VERTICES) -> Mesh:
    """Return the mesh with cells joined where one list costs less than two; vertices keep their order."""
    cells, points = len(mesh.cell_start) - 1, int(mesh.list_ids.max(initial=-1)) + 1
    begins = np.zeros(cells, np.bool_)
    kept = np.zeros(len(mesh.list_ids), np.bool_)
    _join(mesh.cell_start, mesh.list_start, mesh.list_ids, per_point, most, np.full(points, -1), begins, kept)
    if begins.all():
        return mesh
    return _make_joined(mesh, begins, kept)


def _make_joined(mesh: Mesh, begins: Bools, kept: Bools) -> Mesh:
    """Return the mesh whose cells are those that ``begins (c,)`` says, each with the cells after it; ``kept (k,)`` says
    which of the listed points are the first of their kind in a new cell."""
    at = np.flatnonzero(begins)
    start = np.append(mesh.cell_start[at], mesh.cell_start[-1])
    total = np.concatenate([[0], np.cumsum(kept)])
    list_start = total[np.append(mesh.list_start[at], mesh.list_start[-1])]
    cell = np.repeat(np.arange(len(at), dtype=np.int32), np.diff(start))
    ids, owner = mesh.list_ids[kept], np.repeat(np.arange(len(at)), np.diff(list_start))
    return replace(mesh, cell=cell, cell_start=start, list_start=list_start, list_ids=ids[np.lexsort((ids, owner))])


@kernel
def _join(cell_start, list_start, list_ids, per_point, most, last_run, begins, kept):
    """Say which cells begin a joined one, and which listed points are new to theirs."""
    run, first, points = -1, 0, 0
    for c in range(begins.shape[0]):
        size, own, more = cell_start[c + 1] - cell_start[c], list_start[c + 1] - list_start[c], 0
        for q in range(list_start[c], list_start[c + 1]):
            more += last_run[list_ids[q]] != run
        whole = cell_start[c + 1] - first
        apart = points * (cell_start[c] - first + per_point) + own * (size + per_point)
        if run < 0 or whole > most or (points + more) * (whole + per_point) > apart:
            run, first, points, more = run + 1, cell_start[c], 0, own
            begins[c] = True
        points += more
        for q in range(list_start[c], list_start[c + 1]):
            kept[q] = last_run[list_ids[q]] != run
            last_run[list_ids[q]] = run
