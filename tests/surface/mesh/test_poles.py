"""Where a border of (u, v) is one point in space, as at the poles of a ball, no triangle is without area."""

from __future__ import annotations

import numpy as np
import pytest

from surface import DCPSurface
from tests.surface import shapes


def ball(radius: float = 10.0) -> DCPSurface:
    """An exact ball: a half circle of degree 2 turned about its axis, nine points round (The NURBS Book, 8.5)."""
    half = np.array([[0, 0, -1], [1, 0, -1], [1, 0, 0], [1, 0, 1], [0, 0, 1]])
    turn = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    net = np.stack(
        [np.outer(turn[:, 0], half[:, 0]), np.outer(turn[:, 1], half[:, 0]), np.tile(half[:, 2], (9, 1))], -1
    )
    root = np.sqrt(0.5)
    weights = np.outer([1, root] * 4 + [1], [1, root, 1, root, 1])
    around, along = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 0, 1, 1, 2, 2, 2]
    return DCPSurface.from_nurbs(2, 2, around, along, radius * net, weights)


def areas(mesh: object) -> np.ndarray:
    """(t,) areas of a mesh's triangles."""
    corner = mesh.vertices[mesh.triangles]  # type: ignore[attr-defined]
    return np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2


@pytest.mark.parametrize("limits", [{"chord_error": 0.05}, {"max_points": 9, "min_depth": 2}])
def test_a_ball_has_triangles_with_area_only_and_no_hole_at_its_poles(limits: dict) -> None:
    mesh = ball().tessellate(**limits)
    assert areas(mesh).min() > 1e-4 * np.median(areas(mesh))
    corner = mesh.vertices[mesh.triangles]
    volume = np.einsum("tc,tc->t", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6
    assert abs(volume) == pytest.approx(4 / 3 * np.pi * 1000, rel=0.03 if "chord_error" in limits else 0.5)
    _, place = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
    edges = np.sort(place[mesh.triangles][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed, once equal places are one
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.triangles] = True
    assert used.all()


def test_only_edges_on_a_border_that_is_a_point_are_left_out() -> None:
    flat = shapes.hills(8)
    points = flat.points.reshape(8, 8, 3).copy()
    points[0] = points[0, 0]  # u = 0 is one point
    surface = flat.with_points(points.reshape(-1, 3))
    whole, pole = (s.tessellate(roots=(4, 4), min_depth=1, max_depth=1) for s in (flat, surface))
    assert len(whole.triangles) == 128 and len(pole.triangles) == 120
    lost = pole.uv[pole.triangles][:, :, 0] == 0
    assert (lost.sum(axis=1) < 2).all()
    points[:] = points[
        :, :1
    ]  # every line along v is a point: nothing has an area, but u = 0 and u = 1 alone are borders
    thread = flat.with_points(points.reshape(-1, 3)).tessellate(roots=(4, 4), min_depth=1, max_depth=1)
    assert len(thread.triangles) == 112
