"""Crowns are wrapped by one patch each."""

import numpy as np
import pytest

from surface.fit.features.crowns import GRID, crown_chart, split_teeth
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.fit.source.mesh import FitMesh

RADII = np.array([4.0, 6.0, 3.0])


def egg(centre: np.ndarray, start: int) -> tuple[np.ndarray, np.ndarray]:
    """An ellipsoid of triangles about ``centre``."""
    a, b = np.meshgrid(np.linspace(0.05, np.pi - 0.05, 14), np.linspace(0, 2 * np.pi, 24), indexing="ij")
    p = np.stack([np.sin(a) * np.cos(b), np.cos(a), np.sin(a) * np.sin(b)], axis=-1) * RADII + centre
    at = start + np.arange(14 * 24).reshape(14, 24)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    return p.reshape(-1, 3), quads


def two_teeth() -> FitMesh:
    one, faces_one = egg(np.array([-6.0, 0, 50]), 0)
    two, faces_two = egg(np.array([6.0, 0, 50]), len(one))
    back, faces_back = egg(np.array([0.0, 0, 0]), 2 * len(one))
    vertices = np.vstack([one, two, back])
    faces = np.vstack([faces_one, faces_two, faces_back])
    return FitMesh(vertices, faces, np.zeros((1, 2)), np.zeros_like(faces), (), np.zeros((0, len(vertices), 3)))


def test_pieces_are_told_apart():
    mesh = two_teeth()
    pieces = split_teeth(mesh, np.arange(len(mesh.faces)))
    assert sorted(len(p) for p in pieces) == [299, 299, 299]


@pytest.mark.slow
def test_samples_lie_on_the_tooth_and_the_patch_follows():
    mesh = two_teeth()
    teeth = split_teeth(mesh, np.arange(len(mesh.faces)))
    chart, crowns = crown_chart(mesh, teeth, upper=True)
    centres = np.array([[-6.0, 0, 50], [6.0, 0, 50], [0, 0, 0]])
    local = crowns.vertices.reshape(3, -1, 3) - centres[:, None]
    off = np.abs(((local / RADII) ** 2).sum(axis=2) - 1)
    assert np.quantile(off, 0.97) < 0.06  # the egg is open at its root, where rays find nothing
    fit = fit_chart(crowns, chart, FitRequest(120, coarse=0.4, deepest=1, neutral_mm=0.1))
    assert np.sqrt((fit.error**2).mean()) < 0.25


def test_crowns_face_outwards():
    mesh = two_teeth()
    chart, crowns = crown_chart(mesh, split_teeth(mesh, np.arange(len(mesh.faces)))[:1], upper=True)
    net = fit_chart(crowns, chart, FitRequest(40, coarse=0.4, deepest=1))
    at, d = np.array([[0.5, 0.5]]), 1e-4
    steps = np.array([[d, 0]]), np.array([[0, d]])
    u, v = ((basis(net.net, at + s) - basis(net.net, at - s)) @ net.points for s in steps)
    assert np.cross(u, v)[0, 1] < 0  # the tip of an upper tooth points down


def blade() -> tuple[np.ndarray, np.ndarray]:
    """An incisor: 8 mm wide, 5 mm thick at the root, 0.8 mm at its edge, 16 mm below."""
    outline = np.array([[-4.0, -1], [4, -1], [4, 1], [-4, 1]])
    rings = [
        np.column_stack([outline[:, 0], np.full(4, -y), outline[:, 1] * thick])
        for y, thick in zip(np.linspace(0, 16, 9), np.linspace(2.5, 0.4, 9), strict=True)
    ]
    sides = np.array([[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)])
    ends = np.array([[3, 2, 1, 0], [32, 33, 34, 35]])
    return np.vstack(rings), np.vstack([*(sides + 4 * k for k in range(8)), ends])


def test_samples_are_even_and_miss_no_thin_edge():
    vertices, faces = blade()
    mesh = FitMesh(vertices, faces, np.zeros((1, 2)), np.zeros_like(faces), (), np.zeros((0, len(vertices), 3)))
    chart, crowns = crown_chart(mesh, [np.arange(len(faces))], upper=True)
    grid = crowns.vertices.reshape(*GRID, 3)
    gaps = np.linalg.norm(np.diff(grid, axis=1), axis=2)
    assert gaps.max() < 1.2
    edge = np.column_stack([np.tile(np.linspace(-4, 4, 33), 2), np.full(66, -16.0), np.repeat([-0.4, 0.4], 33)])
    assert np.linalg.norm(grid.reshape(-1, 1, 3) - edge, axis=2).min(axis=0).max() < 0.6
    assert -8.0 < grid[..., 1].max() <= -6.0  # the crown ends 10 mm above its tip
    fit = fit_chart(crowns, chart, FitRequest(96, coarse=0.4, deepest=2, neutral_mm=0.08))
    assert np.quantile(fit.error, 0.99) < 0.5
