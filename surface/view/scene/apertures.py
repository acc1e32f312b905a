"""The openings in the skin: lid margins and lips, found from the mesh's own boundary loops.

The eye's shader darkens the eyeball under the upper lid and draws the wet line on the lower one; the mouth's
shader lights teeth and tongue by what comes in between the lips. Both read the openings where they are now,
so blinks and gaze shade rightly without a shadow map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Points of one lid handed to the eye's shader.
LID_POINTS = 10
#: How far from the skin's edge a lid's margin may lie, and how wide a column it is looked for in, mm.
_MARGIN_MM = 7.0
_COLUMN_MM = 1.6


@dataclass(frozen=True)
class Aperture:
    """An opening in a part.

    Parameters
    ----------
    loop : (k,) vertex ids round the opening, in order, first = corner at least x.
    upper, lower : (LID_POINTS,) vertex ids along either edge, from the corner at least x to the other.
    """

    loop: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


def boundary_loops(triangles: np.ndarray) -> list[np.ndarray]:
    """Closed loops of the edges that one triangle uses.

    Parameters
    ----------
    triangles : (t, 3) vertex ids.

    Returns
    -------
    list of (k,) vertex ids in order; loops that meet themselves are left out.
    """
    following = _boundary_successors(np.asarray(triangles, np.int64))
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


def _boundary_successors(triangles: np.ndarray) -> dict[int, int]:
    """Vertex -> next vertex over the edges whose reverse no triangle has."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    size = int(triangles.max()) + 1 if len(triangles) else 0
    keys, reverse = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    open_edges = edges[~np.isin(keys, reverse)]
    return dict(zip(open_edges[:, 0].tolist(), open_edges[:, 1].tolist(), strict=True))


def aperture(loop: np.ndarray, vertices: np.ndarray) -> Aperture:
    """Split a boundary loop at its corners (least and greatest x) into upper and lower edge.

    Parameters
    ----------
    loop : (k,) vertex ids in order.
    vertices : (m, 3) positions at rest, head not turned.
    """
    loop = np.roll(loop, -int(np.argmin(vertices[loop, 0])))
    corner = int(np.argmax(vertices[loop, 0]))
    first, second = loop[: corner + 1], np.append(loop[corner:], loop[0])[::-1]
    if vertices[first, 1].mean() < vertices[second, 1].mean():
        first, second = second, first
    return Aperture(loop, _spread(first, vertices), _spread(second, vertices))


def _spread(path: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """LID_POINTS ids of `path` (k,), evenly spaced by length."""
    steps = np.linalg.norm(np.diff(vertices[path], axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, along[-1], LID_POINTS)
    return path[np.clip(np.searchsorted(along, wanted), 0, len(path) - 1)]


def leading_edge(
    path: np.ndarray, other: np.ndarray, vertices: np.ndarray, centre: np.ndarray, side: float
) -> np.ndarray:
    """The vertices of a lid that reach furthest over the eyeball, next to the skin's own edge.

    The skin ends behind the lid's margin, out of sight; the margin is what stands lowest (upper lid) or
    highest (lower lid) seen from the eyeball's centre.

    Parameters
    ----------
    path, other : (k,) vertex ids along the skin's edge, on this lid and on the other one.
    vertices : (m, 3) positions at rest.
    centre : (3,) the eyeball's.
    side : +1 for an upper, -1 for a lower lid.

    Returns
    -------
    (k,) vertex ids.
    """
    offset = vertices - centre
    slope = side * offset[:, 1] / np.maximum(offset[:, 2], 1e-6)
    middle = 0.5 * (_height(path, vertices) + _height(other, vertices))
    chosen = path.copy()
    for index, vertex in enumerate(path):
        near = np.linalg.norm(vertices - vertices[vertex], axis=1) < _MARGIN_MM
        near &= np.abs(vertices[:, 0] - vertices[vertex, 0]) < _COLUMN_MM
        near &= (offset[:, 2] > 0.0) & (side * (vertices[:, 1] - middle) > 0.0)
        ids = np.flatnonzero(near)
        if len(ids):
            chosen[index] = ids[np.argmin(slope[ids])]
    return chosen


def _height(path: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Height (m,) of the line along `path`, which runs towards greater x, at every vertex's x."""
    height: np.ndarray = np.interp(vertices[:, 0], vertices[path, 0], vertices[path, 1])
    return height


def nearest_loop(loops: list[np.ndarray], vertices: np.ndarray, point: np.ndarray, reach: float) -> np.ndarray | None:
    """The loop whose mean is nearest to `point` (3,), or None when none is within `reach` mm."""
    if not loops:
        return None
    means = np.array([vertices[loop].mean(axis=0) for loop in loops])
    distance = np.linalg.norm(means - point, axis=1)
    best = int(np.argmin(distance))
    return loops[best] if distance[best] <= reach else None


def vector_area(ring: np.ndarray) -> np.ndarray:
    """Vector area (3,) of a closed polygon (k, 3): half the sum of p_i x p_{i+1}, in mm^2."""
    before = np.asarray(ring - ring[0], np.float64)
    after = before[1:]
    # The sum of p x q is the antisymmetric part of the sum of p q^T.
    both = before[:-1].T @ after
    return 0.5 * np.array([both[1, 2] - both[2, 1], both[2, 0] - both[0, 2], both[0, 1] - both[1, 0]])
