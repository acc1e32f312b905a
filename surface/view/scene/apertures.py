"""Openings in the skin: lid margins and lips, found from the boundary loops of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.mesh.borders import border_edges

#: Points of one lid that the eye's shader gets.
LID_POINTS = 10
#: How far from the skin's edge a lid's margin may lie, and the width of the column that is searched for it, mm.
_MARGIN_MM = 7.0
_COLUMN_MM = 1.6


@dataclass(frozen=True)
class Aperture:
    """An opening in a part.

    Parameters
    ----------
    loop : (k,) vertex ids around the opening, in order, first = corner with the least x.
    upper, lower : (LID_POINTS,) vertex ids along either edge, from the corner with the least x to the other.
    """

    loop: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


def boundary_loops(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed loops (k,) of vertex ids along the edges that only one of `triangles` (t, 3) has.

    Loops that meet themselves are not found.
    """
    following = dict(border_edges(np.asarray(triangles)).tolist())
    loops = []
    while following:
        start, current = following.popitem()
        loop = [start]
        while current != start and current in following:
            loop.append(current)
            current = following.pop(current)
        if current == start and len(loop) >= 6:
            loops.append(np.array(loop, np.int64))
    return loops


def aperture(loop: np.ndarray, vertices: np.ndarray) -> Aperture:
    """Split a boundary loop (k,) at its corners (least and greatest x) into upper and lower edge.

    `vertices` (m, 3) are positions at rest, head not turned.
    """
    loop = np.roll(loop, -int(np.argmin(vertices[loop, 0])))
    corner = int(np.argmax(vertices[loop, 0]))
    first, second = loop[: corner + 1], np.append(loop[corner:], loop[0])[::-1]
    if vertices[first, 1].mean() < vertices[second, 1].mean():
        first, second = second, first
    return Aperture(loop, _evenly_spaced(first, vertices), _evenly_spaced(second, vertices))


def _evenly_spaced(path: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """LID_POINTS ids of `path` (k,), evenly spaced by length."""
    steps = np.linalg.norm(np.diff(vertices[path], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.searchsorted(along, np.linspace(0.0, along[-1], LID_POINTS))
    return path[np.clip(at, 0, len(path) - 1)]


def leading_edge(
    path: np.ndarray, other: np.ndarray, vertices: np.ndarray, centre: np.ndarray, side: float
) -> np.ndarray:
    """The vertices (k,) of a lid that reach furthest over the eyeball, next to the skin's own edge.

    The skin ends behind the lid's margin, out of sight; the margin is lowest (upper lid) or highest (lower lid) seen
    from the eyeball's centre.

    Parameters
    ----------
    path, other : (k,) vertex ids along the skin's edge, on this lid and on the other one.
    vertices : (m, 3) positions at rest.
    centre : (3,) of the eyeball.
    side : +1 for an upper, -1 for a lower lid.
    """
    offset = vertices - centre
    slope = side * offset[:, 1] / np.maximum(offset[:, 2], 1e-6)
    heights = [np.interp(vertices[:, 0], vertices[edge, 0], vertices[edge, 1]) for edge in (path, other)]
    middle = 0.5 * (heights[0] + heights[1])
    chosen = path.copy()
    for index, vertex in enumerate(path):
        near = np.linalg.norm(vertices - vertices[vertex], axis=1) < _MARGIN_MM
        near &= np.abs(vertices[:, 0] - vertices[vertex, 0]) < _COLUMN_MM
        near &= (offset[:, 2] > 0.0) & (side * (vertices[:, 1] - middle) > 0.0)
        ids = np.flatnonzero(near)
        if len(ids):
            chosen[index] = ids[np.argmin(slope[ids])]
    return chosen


def nearest_loop(loops: list[np.ndarray], vertices: np.ndarray, point: np.ndarray, reach: float) -> np.ndarray | None:
    """The loop whose mean is nearest to `point` (3,), or None if none is within `reach` mm."""
    if not loops:
        return None
    means = np.array([vertices[loop].mean(axis=0) for loop in loops])
    distance = np.linalg.norm(means - point, axis=1)
    best = int(np.argmin(distance))
    return loops[best] if distance[best] <= reach else None


def vector_area(ring: np.ndarray) -> np.ndarray:
    """Vector area (3,) of a closed polygon (k, 3): half the sum of p_i x p_{i+1}, in mm^2."""
    points = np.asarray(ring - ring[0], np.float64)
    # The sum of p x q is the antisymmetric part of the sum of p q^T.
    both = points[:-1].T @ points[1:]
    return 0.5 * np.array([both[1, 2] - both[2, 1], both[2, 0] - both[0, 2], both[0, 1] - both[1, 0]])
