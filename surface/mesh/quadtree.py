"""Quad trees over (u, v): a grid of root cells, quartering, 2:1 balance, conforming triangles (paper, section 2.3).

At level L the domain is a grid of ``roots * 2**L`` cells; cell (i, j) covers the lattice square from
``(i, j) * 2**(depth - L)`` on. Lattice lines at root borders have exactly the given (u, v).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Floats, Ints
from surface.base.jit import kernel
from surface.base.progress import Progress, no_progress


@dataclass(frozen=True)
class Lattice:
    """Integer coordinates over the domain.

    lines_u, lines_v : sorted borders of the root cells. depth : deepest level of a cell.
    joined : whether u, and v, are closed, so that the first and the last cells are neighbours.
    """

    lines_u: Floats
    lines_v: Floats
    depth: int
    joined: tuple[bool, bool] = (False, False)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of root cells along u and v."""
        return len(self.lines_u) - 1, len(self.lines_v) - 1

    @property
    def roots(self) -> Ints:
        """Return the indices (n, 2) of the root cells."""
        return np.argwhere(np.ones(self.shape, dtype=bool))

    def uv(self, x: Ints, y: Ints) -> Floats:
        """Return the parameters (m, 2) of lattice points."""
        return np.stack([self._along(self.lines_u, x), self._along(self.lines_v, y)], axis=-1)

    def _along(self, lines: Floats, x: Ints) -> Floats:
        unit = 1 << self.depth
        root = np.minimum(x >> self.depth, len(lines) - 2)
        part = (x - root * unit) / unit
        places: Floats = np.where(part == 1.0, lines[root + 1], lines[root] + part * (lines[root + 1] - lines[root]))
        return places

    def key(self, x: Ints, y: Ints) -> Ints:
        """Return one integer (m,) per lattice point."""
        return y * ((self.shape[0] << self.depth) + 1) + x

    def point(self, key: Ints) -> tuple[Ints, Ints]:
        """Invert :meth:`key`."""
        width = (self.shape[0] << self.depth) + 1
        return key % width, key // width


@dataclass(frozen=True)
class Leaves:
    """The leaf cells of a tree: their levels (n,) int64, and indices i, j at that level (n, 2) int64."""

    level: Ints
    cell: Ints


SplitTest = Callable[[int, Ints], np.ndarray]
NEIGHBOURS = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])  # below, right, above, left: the order of edges


def grow(lattice: Lattice, split: SplitTest, progress: Progress = no_progress) -> tuple[Leaves, list[Ints]]:
    """Quarter the cells for which ``split(level, cells (n, 2))``, (n,) bool, is true, then balance 2:1 over edges.

    Returns the leaf cells and, per level, the sorted codes of cells that were split; see :func:`codes`. Progress
    assumes that every level takes twice as long as the one before.
    """
    cells = lattice.roots
    inner: list[Ints] = []
    for level in range(lattice.depth):
        progress("quad tree", 0.5 ** (lattice.depth - level))
        chosen = cells[split(level, cells)] if len(cells) else cells
        inner.append(chosen)
        cells = children(chosen)
    return _balance(lattice, inner)


def children(cells: Ints) -> Ints:
    """Return the four quarters of every cell, (4 n, 2)."""
    quarters = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    out: Ints = (2 * cells[:, None, :] + quarters).reshape(-1, 2)
    return out


def codes(lattice: Lattice, level: int, cells: Ints) -> Ints:
    """Return one integer (n,) per cell of a level; -1 for cells outside the domain."""
    size = np.array(lattice.shape) << level
    if any(lattice.joined):
        cells = np.where(lattice.joined, cells % size, cells)
    valid = ((cells >= 0) & (cells < size)).all(axis=1)
    return np.where(valid, cells[:, 1] * size[0] + cells[:, 0], -1)


def _decode(lattice: Lattice, level: int, code: Ints) -> Ints:
    width = lattice.shape[0] << level
    return np.stack([code % width, code // width], axis=1)


def contains(sorted_codes: Ints, code: Ints) -> np.ndarray:
    """Return which of ``code (n,)`` are in a sorted array, (n,) bool."""
    if not len(sorted_codes):
        return np.zeros(len(code), dtype=bool)
    at = np.minimum(np.searchsorted(sorted_codes, code), len(sorted_codes) - 1)
    held: np.ndarray = sorted_codes[at] == code
    return held


def _balance(lattice: Lattice, inner: list[Ints]) -> tuple[Leaves, list[Ints]]:
    """Split the parents of every split cell's edge neighbours, from the finest level up; then collect leaves."""
    split = [np.unique(codes(lattice, level, cells)) for level, cells in enumerate(inner)]
    for level in range(len(split) - 1, 0, -1):
        parents = codes(lattice, level - 1, _parents_around(_decode(lattice, level, split[level])))
        missing = np.unique(parents[(parents >= 0) & ~contains(split[level - 1], parents)])
        if len(missing):
            split[level - 1] = np.union1d(split[level - 1], missing)
    levels, found = [], []
    cells = lattice.roots
    for level in range(len(split) + 1):
        code = codes(lattice, level, cells)
        is_inner = contains(split[level], code) if level < len(split) else np.zeros(len(cells), dtype=bool)
        found.append(cells[~is_inner])
        levels.append(np.full(len(found[-1]), level))
        cells = children(cells[is_inner])
    return Leaves(np.concatenate(levels), np.concatenate(found)), split


def _parents_around(cells: Ints) -> Ints:
    """Return the parents (3 n, 2) of cells (n, 2) and of their edge neighbours.

    They are three per cell, since two of the neighbours have the cell's own parent.
    """
    own = cells // 2
    beside = 2 * (cells % 2) - 1  # towards the neighbours that have another one
    steps = beside[:, None, :] * np.array([[0, 0], [1, 0], [0, 1]])
    out: Ints = (own[:, None, :] + steps).reshape(-1, 2)
    return out


def quarter(lattice: Lattice, leaves: Leaves, inner: list[Ints], which: Ints) -> tuple[Leaves, list[Ints]]:
    """Quarter the leaves ``which (k,)``, too, and balance; ``inner`` and the results are as of :func:`grow`."""
    cells = [_decode(lattice, level, code) for level, code in enumerate(inner)]
    for level in np.unique(leaves.level[which]):
        more = leaves.cell[which[leaves.level[which] == level]]
        cells[level] = np.concatenate([cells[level], more])
    return _balance(lattice, cells)


def patterns(lattice: Lattice, leaves: Leaves, inner: list[Ints]) -> Ints:
    """Return the index (n,) in :data:`TEMPLATES` of the triangles of every leaf."""
    pattern = np.zeros(len(leaves.level), dtype=np.int64)
    for level in np.unique(leaves.level):
        if level >= len(inner):
            continue
        at = np.flatnonzero(leaves.level == level)
        for edge, step in enumerate(NEIGHBOURS):
            code = codes(lattice, int(level), leaves.cell[at] + step)
            pattern[at] |= contains(inner[level], code).astype(np.int64) << edge
    flat = pattern == 0
    pattern[flat] = 16 * (leaves.cell[flat].sum(axis=1) % 2)
    return pattern


def triangulate(lattice: Lattice, leaves: Leaves, inner: list[Ints]) -> tuple[Ints, Ints]:
    """Triangulate the leaves without cracks: an edge has a vertex in its middle if the neighbour is smaller.

    Returns lattice keys (t, 3) int64, counter-clockwise in (u, v), and the leaf of every triangle, (t,) int64.
    """
    pattern = patterns(lattice, leaves, inner)
    count = (TEMPLATES[:, :, 0] >= 0).sum(axis=1)[pattern]
    keys = np.zeros((int(count.sum()), 3), dtype=np.int64)
    _emit(leaves.level, leaves.cell, pattern, lattice.depth, (lattice.shape[0] << lattice.depth) + 1, TEMPLATES, keys)
    return keys, np.repeat(np.arange(len(leaves.level)), count)


@kernel
def _emit(level, cell, pattern, depth, width, templates, keys):  # type: ignore[no-untyped-def]
    """Write lattice keys of the triangles of every leaf to ``keys``; see :func:`_templates`."""
    x, y = np.array([0, 2, 2, 0, 1, 2, 1, 0]), np.array([0, 0, 2, 2, 0, 1, 2, 1])
    row = 0
    for leaf in range(level.shape[0]):
        step = 1 << (depth - level[leaf])
        for t in range(templates.shape[1]):
            for k in range(3):
                node = templates[pattern[leaf], t, k]
                if node < 0:
                    break
                across, up = cell[leaf, 0] * step + x[node] * step // 2, cell[leaf, 1] * step + y[node] * step // 2
                keys[row, k] = up * width + across
                row += k == 2


def _templates() -> Ints:
    """Return triangles (17, 6, 3) over corners 0-3 and middles 4-7, by pattern of smaller neighbours; -1 pads.

    Pattern bits: below, right, above, left. Pattern 16 is pattern 0 with the other diagonal.
    """
    base = {
        0b0001: [(0, 4, 3), (4, 2, 3), (4, 1, 2)],
        0b0011: [(4, 1, 5), (0, 4, 3), (4, 5, 3), (5, 2, 3)],
        0b0101: [(0, 4, 6), (0, 6, 3), (4, 1, 2), (4, 2, 6)],
        0b0111: [(4, 1, 5), (5, 2, 6), (4, 5, 6), (0, 4, 6), (0, 6, 3)],
        0b1111: [(4, 1, 5), (5, 2, 6), (6, 3, 7), (7, 0, 4), (4, 5, 6), (4, 6, 7)],
    }
    table = np.full((17, 6, 3), -1, dtype=np.int64)
    for pattern, triangles in base.items():
        for turn in range(4):
            turned = ((pattern << turn) | (pattern >> (4 - turn))) & 15
            for row, nodes in enumerate(triangles):
                table[turned, row] = [(n % 4 + turn) % 4 + n // 4 * 4 for n in nodes]
    table[0, :2] = [(0, 1, 2), (0, 2, 3)]
    table[16, :2] = [(0, 1, 3), (1, 2, 3)]
    return table


TEMPLATES = _templates()
