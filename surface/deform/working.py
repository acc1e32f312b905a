"""The arrays of a mesh's vertices, control points and numerators that an update works on."""

from __future__ import annotations

from functools import partial

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.mesh.mesh import Mesh

from .updates import NOT_STORED


def work_arrays(mesh: Mesh, points: Floats, tiles: int, normals: bool) -> dict[str, np.ndarray]:
    """Return the arrays of an update that are not in the lists, by their names in :data:`.binding.NAMES`.

    origin : (c, 3) float64, which positions within a cell are relative to
    inv_w, dw, numerators : (8 t,), (16 t,) or (0,), (72 t,) or (24 t,) float32 by tile, see :mod:`.apply`
    points : (n, 3) float64, current, shifted copies included
    differences : (c,) int64, how many each cell has taken since it was computed again; -1 without numerators
    vertices, normals : (3 m,) float32, current
    ranges : (c, 2) int64, the vertex ranges that the last update touched
    heavy : (c,) float64, how much weights, or their derivatives, add up to at most at a vertex of every cell
    extent : (7,) float64, the surface's size and place, see :func:`.updates.measure`
        The others belong to :mod:`.updates`.
    """
    m, cells, n = len(mesh.vertices), len(mesh.cell_start) - 1, len(points)
    single, cell = partial(np.zeros, dtype=np.float32), partial(np.zeros, cells)
    return {
        "origin": with_room(middles(mesh.vertices, mesh.cell_start)), "points": with_room(points),
        "inv_w": single(8 * tiles),
        "dw": single(16 * tiles * normals), "numerators": single((72 if normals else 24) * tiles),
        "differences": np.full(cells, NOT_STORED), "touched": np.zeros(tiles, np.uint8),
        "vertices": single(3 * m), "normals": single(3 * m * normals), "ranges": np.zeros((max(cells, 1), 2), np.int64),
        "hits": cell(dtype=np.int64), "affected": cell(dtype=np.int32), "recomputed": cell(dtype=np.int32),
        "moved_ids": np.zeros(n, np.int64), "delta": np.zeros((n, 3)),
        "pull": cell(), "span": cell(), "drift": cell(), "heavy": cell(), "extent": np.zeros(7),
    }  # fmt: skip


def middles(vertices: np.ndarray, cell_start: Ints) -> Floats:
    """Return (c, 3): the middle of each cell's vertices (m, 3)."""
    if not len(vertices):
        return np.zeros((len(cell_start) - 1, 3))
    middles: Floats = np.add.reduceat(vertices, cell_start[:-1], dtype=np.float64) / np.diff(cell_start)[:, None]
    return middles


def with_room(rows: Floats) -> Floats:
    """Return a copy of ``rows (n, 3)``, with room behind it: kernels read four numbers of a row."""
    return np.concatenate([rows, np.zeros((1, 3))])[: len(rows)]
