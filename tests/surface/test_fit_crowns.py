"""Crowns are wrapped by one patch each."""

import numpy as np

from surface.fit.crowns import crown_chart, split_teeth
from surface.fit.mesh import FitMesh
from surface.fit.refine import Wish, fit_chart
from surface.fit.solve import basis

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


def test_samples_lie_on_the_tooth_and_the_patch_follows():
    mesh = two_teeth()
    teeth = split_teeth(mesh, np.arange(len(mesh.faces)))
    chart, crowns = crown_chart(mesh, teeth, upper=True)
    centres = np.array([[-6.0, 0, 50], [6.0, 0, 50], [0, 0, 0]])
    local = crowns.vertices.reshape(3, -1, 3) - centres[:, None]
    off = np.abs(((local / RADII) ** 2).sum(axis=2) - 1)
    assert np.quantile(off, 0.97) < 0.06  # the egg is open at its root, where rays find nothing
    fit = fit_chart(crowns, chart, Wish(120, coarse=0.4, deepest=1, neutral_mm=0.1))
    assert np.sqrt((fit.error**2).mean()) < 0.25


def test_crowns_face_outwards():
    mesh = two_teeth()
    chart, crowns = crown_chart(mesh, split_teeth(mesh, np.arange(len(mesh.faces)))[:1], upper=True)
    net = fit_chart(crowns, chart, Wish(40, coarse=0.4, deepest=1))
    at, d = np.array([[0.5, 0.5]]), 1e-4
    steps = np.array([[d, 0]]), np.array([[0, d]])
    u, v = ((basis(net.net, at + s) - basis(net.net, at - s)) @ net.points for s in steps)
    assert np.cross(u, v)[0, 1] < 0  # the tip of an upper tooth points down
