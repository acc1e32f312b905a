"""Curvatures of surfaces whose curvature is known."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import DCPSurface

H = np.sqrt(0.5)
ARC = np.array([[1, 0], [1, 1], [0, 1]], dtype=float)
ARC_WEIGHTS = np.array([1, H, 1])
CLAMPED = [0, 0, 0, 1, 1, 1]


def turned(profile: np.ndarray, weights: np.ndarray, degree: int, knots: list) -> DCPSurface:
    """A quarter turn about z of a profile (k, 2) of radius and height, exactly."""
    net = np.zeros((3, len(profile), 3))
    net[:, :, :2] = ARC[:, None] * profile[None, :, :1]
    net[:, :, 2] = profile[:, 1]
    return DCPSurface.from_nurbs(2, degree, CLAMPED, knots, net, np.outer(ARC_WEIGHTS, weights))


def test_sphere() -> None:
    radius = 3.0
    sphere = turned(radius * np.array([[1, 0], [1, 1], [0, 1]]), ARC_WEIGHTS, 2, CLAMPED)
    uv = np.random.default_rng(0).uniform(0.05, 0.95, (40, 2))
    assert np.allclose(np.linalg.norm(sphere.evaluate(uv), axis=1), radius, rtol=1e-13)
    gaussian, mean = sphere.curvatures(uv)
    assert np.allclose(gaussian, 1 / radius**2, rtol=1e-10)
    assert np.allclose(np.abs(mean), 1 / radius, rtol=1e-10)


def test_cylinder_and_plane() -> None:
    uv = np.random.default_rng(1).uniform(0, 1, (40, 2))
    cylinder = turned(np.array([[2.0, 0], [2.0, 5]]), np.ones(2), 1, [0, 0, 1, 1])
    gaussian, mean = cylinder.curvatures(uv)
    assert np.allclose(gaussian, 0, atol=1e-12)
    assert np.allclose(np.abs(mean), 0.25, rtol=1e-10)
    plane = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]])
    assert np.allclose(plane.curvatures(uv), 0, atol=1e-14)


def test_saddle_point_and_sides() -> None:
    x, y = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], indexing="ij")
    # z = (x - 1/2)^2 - (y - 1/2)^2 as a Bezier patch: blossoms of the two squares
    square = np.array([0.25, -0.25, 0.25])
    z = square[:, None] - square[None, :]
    saddle = DCPSurface.from_nurbs(2, 2, CLAMPED, CLAMPED, np.stack([x, y, z], axis=-1))
    gaussian, mean = saddle.curvatures([[0.5, 0.5]])
    assert np.isclose(gaussian[0], -4, rtol=1e-12)
    assert np.isclose(mean[0], 0, atol=1e-12)


def test_uncovered_is_nan() -> None:
    apart = [[0, 0, 1, 1], [3, 3, 4, 4]]
    single = DCPSurface([[0, 0, 0], [0, 0, 1]], [1, 1], apart, [[0, 0, 1, 1]] * 2)
    gaussian, mean = single.curvatures([[2.0, 0.5], [0.5, 0.5]])
    assert np.isnan(gaussian).all()
    assert np.isnan(mean).all()


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_curvatures_agree_with_differences_of_normals(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 1, 7), indexing="ij")
    knots = np.concatenate([[0.0] * 5, [0.3, 0.6], [1.0] * 5])
    net = np.stack([x, y, 0.3 * rng.normal(size=(7, 7))], axis=-1)
    surface = DCPSurface.from_nurbs(4, 4, knots, knots, net, rng.uniform(0.5, 2, (7, 7)))
    uv, h = rng.uniform(0.1, 0.9, (20, 2)), 1e-5
    _, su, sv = surface.derivatives(uv)

    def normal(at: np.ndarray) -> np.ndarray:
        _, a, b = surface.derivatives(at)
        product = np.cross(a, b)
        return product / np.linalg.norm(product, axis=1)[:, None]

    slopes = [(normal(uv + step) - normal(uv - step)) / (2 * h) for step in (np.array([h, 0]), np.array([0, h]))]
    first = np.array([[(a * b).sum(axis=1) for b in (su, sv)] for a in (su, sv)]).transpose(2, 0, 1)
    second = -np.array([[(a * b).sum(axis=1) for b in (su, sv)] for a in slopes]).transpose(2, 0, 1)
    shape = np.linalg.solve(first, second)  # the shape operator: its determinant and half its trace
    gaussian, mean = surface.curvatures(uv)
    size = np.abs(shape).max()
    assert np.allclose(gaussian, np.linalg.det(shape), rtol=1e-5, atol=1e-6 * size**2)
    assert np.allclose(mean, np.trace(shape, axis1=1, axis2=2) / 2, rtol=1e-5, atol=1e-6 * size)
