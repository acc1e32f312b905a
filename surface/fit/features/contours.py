"""Trace lines of equal value in a picture, by marching squares (Lorensen and Cline, 1987, in two dimensions)."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats, Ints

SIMPLE = 0.35  # of a place: the simplified line is nowhere further from the one that was traced


def contours(picture: Floats, level: float) -> list[Floats]:
    """Closed lines (k, 2) around what is at least ``level`` in a picture (w, h), in its own steps.

    Its border must be below the level. Lines never cross: holes have their own; places that touch at a corner only are
    apart. Corners that lie on the line between their neighbours are left out.
    """
    after = _steps(picture >= level)
    edges = np.array(sorted(after), np.int64).reshape(-1, 3)
    place = dict(zip(map(tuple, edges.tolist()), _crossings(picture, level, edges), strict=True))
    lines = []
    while after:
        start, here = next(iter(after.items()))
        line = [start]
        del after[start]
        while here != start:
            line.append(here)
            here = after.pop(here)
        at = simplified(np.array([place[edge] for edge in line]))
        if len(at) >= 3:
            lines.append(at)
    return lines


_Edge = tuple[int, int, int]  # column, row, and 0 for the edge to the next column, 1 for that to the next row
# by which of a cell's corners are inside (1: low low, 2: high low, 4: high high, 8: low high): from which of its edges
# (0: low row, 1: high column, 2: high row, 3: low column) to which its lines run, with the inside on the left
_LINES = {
    1: [(0, 3)], 2: [(1, 0)], 3: [(1, 3)], 4: [(2, 1)], 5: [(0, 3), (2, 1)], 6: [(2, 0)], 7: [(2, 3)],
    8: [(3, 2)], 9: [(0, 2)], 10: [(1, 0), (3, 2)], 11: [(1, 2)], 12: [(3, 1)], 13: [(0, 1)], 14: [(3, 0)],
}  # fmt: skip
_EDGES = (0, 0, 0), (1, 0, 1), (0, 1, 0), (0, 0, 1)


def _steps(inside: np.ndarray) -> dict[_Edge, _Edge]:
    """From each edge of the grid that a line crosses to the next one on it."""
    bits = inside[:-1, :-1] + 2 * inside[1:, :-1] + 4 * inside[1:, 1:] + 8 * inside[:-1, 1:]
    after: dict[_Edge, _Edge] = {}
    for i, j in np.argwhere((bits > 0) & (bits < 15)).tolist():
        for start, stop in _LINES[int(bits[i, j])]:
            (a, b, c), (d, e, f) = _EDGES[start], _EDGES[stop]
            after[i + a, j + b, c] = (i + d, j + e, f)
    return after


def _crossings(picture: Floats, level: float, edges: Ints) -> Floats:
    """(k, 2) where the level is reached on edges (k, 3), linear between their ends."""
    i, j, along = edges.T
    a, b = picture[i, j], picture[i + (along == 0), j + (along == 1)]
    share = np.clip((level - a) / np.where(a == b, 1.0, b - a), 0.05, 0.95)
    return np.column_stack([i + share * (along == 0), j + share * (along == 1)])


def simplified(line: Floats) -> Floats:
    """A closed line (k, 2) with fewer corners, nowhere further than :data:`SIMPLE` from it (Douglas and Peucker)."""
    far = int(np.linalg.norm(line - line[0], axis=1).argmax())
    kept = np.zeros(len(line) + 1, bool)
    kept[[0, far, len(line)]] = True
    ring, left = np.vstack([line, line[:1]]), [(0, far), (far, len(line))]
    while left:
        a, b = left.pop()
        if b - a < 2:
            continue
        away = _away(ring[a + 1 : b], ring[a], ring[b])
        k = a + 1 + int(away.argmax())
        if away.max() > SIMPLE:
            kept[k] = True
            left += [(a, k), (k, b)]
    return ring[:-1][kept[:-1]]


def _away(points: Floats, a: Floats, b: Floats) -> Floats:
    """(m,) distances of points (m, 2) from the segment between two others."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-30), 0.0, 1.0)
    away: Floats = np.linalg.norm(points - a - share[:, None] * along, axis=1)
    return away
