"""surface.view.scene.apertures"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import EYES, grid, skin

from surface.view.scene.apertures import LID_POINTS, aperture, boundary_loops, leading_edge, nearest_loop, vector_area


def sheet_with_hole() -> tuple[np.ndarray, np.ndarray]:
    uv, triangles = grid(11, 11)
    middle = uv[triangles].mean(axis=1)
    hole = (np.abs(middle - 0.5) < 0.2).all(axis=1)
    return np.column_stack([uv * 100, np.zeros(len(uv))]), triangles[~hole]


def test_a_sheet_with_a_hole_has_two_loops() -> None:
    points, triangles = sheet_with_hole()
    loops = sorted(boundary_loops(triangles), key=len)
    assert [len(loop) for loop in loops] == [16, 40]
    inner = points[loops[0], :2]
    assert np.allclose(np.abs(inner - 50).max(axis=1), 20)
    assert np.allclose(np.linalg.norm(np.diff(inner, axis=0), axis=1), 10)


def test_a_closed_surface_has_none() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    assert boundary_loops(tetrahedron) == []
    assert boundary_loops(np.zeros((0, 3), int)) == []


def test_aperture_tells_upper_from_lower_edge() -> None:
    points, triangles = sheet_with_hole()
    hole = aperture(min(boundary_loops(triangles), key=len), points)
    upper, lower = points[hole.upper], points[hole.lower]
    assert len(upper) == len(lower) == LID_POINTS
    assert upper[:, 1].mean() > 55 > 45 > lower[:, 1].mean()
    assert (np.diff(upper[:, 0]) >= 0).all()
    assert upper[0, 0] == pytest.approx(30)
    assert upper[-1, 0] == pytest.approx(70)


def test_nearest_loop_finds_each_eye_and_respects_its_reach() -> None:
    part = skin()
    loops = boundary_loops(part.triangles)
    found = [nearest_loop(loops, part.rest, centre, 30.0) for centre in EYES.values()]
    assert [np.sign(part.rest[loop, 0].mean()) for loop in found if loop is not None] == [1.0, -1.0]
    assert nearest_loop(loops, part.rest, np.array([0.0, 0.0, 400.0]), 30.0) is None
    assert nearest_loop([], part.rest, np.zeros(3), 30.0) is None


def test_vector_area_of_a_circle() -> None:
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    ring = np.column_stack([3 * np.cos(angle) + 100, 3 * np.sin(angle) - 20, np.full(720, 50.0)])
    assert vector_area(ring) == pytest.approx([0, 0, np.pi * 9], rel=1e-4, abs=1e-9)


def test_leading_edge_is_what_reaches_furthest_over_the_eyeball() -> None:
    x = np.linspace(-10, 10, LID_POINTS)
    rows = {"edge": (5.0, 12.0), "margin": (4.0, 13.5), "lid": (8.0, 13.0), "lower": (-5.0, 12.0)}
    vertices = np.concatenate([np.column_stack([x, np.full_like(x, y), np.full_like(x, z)]) for y, z in rows.values()])
    ids = dict(zip(rows, np.arange(4 * LID_POINTS).reshape(4, -1), strict=True))
    centre = np.zeros(3)
    assert (leading_edge(ids["edge"], ids["lower"], vertices, centre, 1.0) == ids["margin"]).all()
    assert (leading_edge(ids["lower"], ids["edge"], vertices, centre, -1.0) == ids["lower"]).all()
