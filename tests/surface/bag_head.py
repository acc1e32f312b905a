"""A ball with a mouth and what lines it, without texture coordinates."""

from __future__ import annotations

import numpy as np
from ball_head import ball

from surface.fit.source.mesh import FitMesh


def mesh_of(points, faces, moves=None) -> FitMesh:
    faces = np.asarray(faces, np.int64)
    faces = faces if faces.shape[1] == 4 else np.pad(faces, ((0, 0), (0, 1)), constant_values=-1)
    deltas = np.zeros((0, len(points), 3)) if moves is None else moves[None]
    return FitMesh(np.asarray(points, float), faces, np.zeros((0, 2)), 0 * faces - 1, ("a",) * len(deltas), deltas)


def sphere(radius: float = 80.0, rows: int = 25, columns: int = 33) -> FitMesh:
    """A closed ball of quads and triangles."""
    points, _, tri = ball(radius, rows, columns)
    _, first, same = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    tri = same.ravel()[tri]
    return mesh_of(points[first], tri[(tri != np.roll(tri, 1, axis=1)).all(axis=1)])


def bag(depth: float = 60.0) -> FitMesh:
    """A ball with a round mouth, from which a lining goes back into it."""
    outer = sphere()
    middle = outer.vertices[outer.faces[:, :3]].mean(axis=1)
    hole = (middle[:, 2] > 0) & (np.hypot(middle[:, 0], middle[:, 1] + 30) < 22)
    kept = outer.faces[~hole]
    edges = kept[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    have = {tuple(e) for e in edges.tolist()}
    rim = {b: a for a, b in have if (b, a) not in have}
    loop = [next(iter(rim))]
    while (after := rim[loop[-1]]) != loop[0]:
        loop.append(after)
    points, faces, last = [outer.vertices], [kept], np.array(loop)
    count = len(outer.vertices)
    for k in (0.25, 0.5, 0.75, 1.0):
        points.append(outer.vertices[loop] * [1, 1, 1] - [0, 0, depth * k])
        new = count + np.arange(len(loop))
        count += len(loop)
        a, b, c, d = last, np.roll(last, -1), np.roll(new, -1), new
        faces += [np.column_stack([a, b, c, 0 * a - 1]), np.column_stack([a, c, d, 0 * a - 1])]
        last = new
    points.append(points[-1].mean(axis=0, keepdims=True))
    faces.append(np.column_stack([last, np.roll(last, -1), np.full(len(last), count), 0 * last - 1]))
    return mesh_of(np.vstack(points), np.vstack(faces))
