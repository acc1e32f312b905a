"""What changes while control points move: their positions, kept numerators, vertices, normals, and scratch arrays."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from surface.base.arrays import Floats, Ints

MOST_MOVED = 0.75  # from this part of the points on, everything is computed anew
Parts = tuple[list[int], list[tuple[np.ndarray, np.ndarray]]]


class State:
    """One mesh on the move; belongs to one thread at a time.

    Parameters
    ----------
    points : (n, 3) float64, shifted copies included; copied
    vertices, cells, tiles : how many the mesh has
    normals : are normals kept?
    threads : how many compute everything anew

    Attributes
    ----------
    points : (n, 3) float64, as they stand now
    numerators : (t * 72,) or, without normals, (t * 24,) float32 by tile; see :mod:`surface.deform.apply`
    kept : (c,) int64, differences each cell has taken since it was computed anew; -1 without numerators
    vertices, normals : (3 m,) float32
    ranges : (c, 2) int64, of which the first ``count`` are the vertex ranges that the last update touched
    bound, local, parts : the table that the next two are made for, see :meth:`surface.deform.table.StencilTable.bind`
    addressed, addresses : the table for which, and where all arrays are
    """

    def __init__(
        self, points: Floats, vertices: int, cells: int, tiles: int, *, normals: bool = True, threads: int = 1
    ) -> None:
        self.points = points.copy()
        self.numerators = np.zeros(tiles * (72 if normals else 24), dtype=np.float32)
        self.kept = np.full(cells, -1, dtype=np.int64)
        self.vertices = np.zeros(3 * vertices, dtype=np.float32)
        self.normals = np.zeros(3 * vertices if normals else 0, dtype=np.float32)
        self.ranges, self.count = np.zeros((max(cells, 1), 2), dtype=np.int64), 0
        self.hits = np.zeros(cells, dtype=np.int64)
        self.touched, self.anew = np.zeros(cells, dtype=np.int32), np.zeros(cells, dtype=np.int32)
        self.changed_ids, self.delta = np.zeros(len(points), dtype=np.int64), np.zeros((len(points), 3))
        self.spare = np.zeros(24, dtype=np.float32)
        self.every, self.most = np.arange(cells, dtype=np.int32), int(MOST_MOVED * len(points))
        self.bound: object = None
        self.addressed: object = None
        self.addresses: Ints = np.zeros(0, dtype=np.int64)
        self.local = np.zeros((0, 3), dtype=np.float32)
        self.parts: Parts | None = None
        self.threads = threads
        self.pool: ThreadPoolExecutor | None = None  # started when first used
