"""surface.mesh.collapse"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from surface.mesh.collapse import Collapse
from surface.mesh.mesh import border_edges


def sheet(side: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A flat square of side x side quads, 1 mm each, facing +z."""
    y, x = np.divmod(np.arange((side + 1) ** 2), side + 1)
    a = np.flatnonzero((x < side) & (y < side))
    b, c, d = a + 1, a + side + 1, a + side + 2
    triangles = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    return np.column_stack([x, y, 0 * x]).astype(float), triangles.astype(np.int32)


def test_a_plane_keeps_its_outline_alone() -> None:
    points, triangles = sheet(12)
    left = Collapse(points, triangles, np.zeros(len(points), bool)).run(1e-6)
    corner = points[left]
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    assert len(left) < 12
    assert (area > 0).all()
    assert np.isclose(area.sum(), 144.0)


def test_what_bends_in_another_pose_stays() -> None:
    points, triangles = sheet(12)
    bent = points.copy()
    bent[:, 2] = np.where(points[:, 0] == 6, 3.0, 0.0)
    left = Collapse(np.hstack([points, bent]), triangles, np.zeros(len(points), bool)).run(1e-3)
    assert len(left) < 0.5 * len(triangles)
    crossing = (bent[left, 0].min(axis=1) < 6) & (bent[left, 0].max(axis=1) > 6)
    assert not crossing.any()


def test_locked_vertices_stay_and_so_does_their_border() -> None:
    points, triangles = sheet(8)
    border = np.unique(border_edges(triangles))
    locked = np.isin(np.arange(len(points)), border)
    left = Collapse(points, triangles, locked).run(1.0)
    assert set(np.unique(border_edges(left))) == set(border)
    assert len(left) < len(triangles)


def test_no_triangle_turns_over_where_every_collapse_is_free() -> None:
    points, triangles = sheet(12)
    inner = ((points[:, :2] > 0) & (points[:, :2] < 12)).all(axis=1)
    points[inner, :2] += np.random.default_rng(3).uniform(-0.3, 0.3, (inner.sum(), 2))
    left = Collapse(points, triangles, np.random.default_rng(4).random(len(points)) < 0.2).run(1e-6)
    area = 0.5 * np.cross(points[left[:, 1]] - points[left[:, 0]], points[left[:, 2]] - points[left[:, 0]])[:, 2]
    assert len(left) < 0.6 * len(triangles)
    assert (area > 0).all()
