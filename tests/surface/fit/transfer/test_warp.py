"""Maps of space: thin-plate splines reproduce every affine map, whatever their stiffness."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from surface.fit.transfer.warp import Warp

LINEAR = np.array([[1.2, 0.1, 0.0], [-0.2, 0.9, 0.3], [0.1, 0.0, 1.1]])
SHIFT = np.array([5.0, -3.0, 7.0])
POINTS = np.random.default_rng(0).uniform(-50, 50, (40, 3))
AXES = np.vstack([np.eye(3), -np.eye(3), [[0.69, 0.7238, 0.0], [0.71, 0.0, 0.7042]]])


def bent(p: np.ndarray) -> np.ndarray:
    return p + np.column_stack([0.002 * p[:, 1] ** 2, 0 * p[:, 0], 0.003 * p[:, 0] * p[:, 1]])


@pytest.mark.parametrize("stiffness", [1.0, 30000.0])
def test_an_affine_map_is_found_exactly_with_its_derivatives_and_normals(stiffness: float) -> None:
    warp = Warp(POINTS, POINTS @ LINEAR.T + SHIFT, np.ones(40), stiffness)
    at = np.random.default_rng(1).uniform(-90, 90, (len(AXES), 3))
    np.testing.assert_allclose(warp(at), at @ LINEAR.T + SHIFT, atol=1e-6)
    np.testing.assert_allclose(warp.jacobians(at), np.tile(LINEAR, (len(at), 1, 1)), atol=1e-6)
    np.testing.assert_allclose(warp.jacobians(at, 3.0), np.tile(LINEAR, (len(at), 1, 1)), atol=1e-6)
    moved, normals = warp.turned(at, AXES)
    np.testing.assert_allclose(moved, warp(at), atol=1e-9)
    wanted = AXES @ np.linalg.inv(LINEAR)  # normals turn by the inverse's transpose
    np.testing.assert_allclose(normals, wanted / np.linalg.norm(wanted, axis=1, keepdims=True), atol=1e-6)


def test_derivatives_of_a_bent_map_are_those_between_two_places() -> None:
    grid = np.stack(np.meshgrid(*3 * [np.linspace(-30, 30, 6)]), axis=-1).reshape(-1, 3)
    warp = Warp(grid, bent(grid), np.ones(len(grid)), 1e-6)
    at, k = np.array([[3.0, -4.0, 5.0]]), 0.01
    there = np.stack([(warp(at + k * e) - warp(at - k * e)) / (2 * k) for e in np.eye(3)], axis=2)
    np.testing.assert_allclose(warp.jacobians(at), there, atol=2e-4)


def test_normals_of_a_bent_map_stand_on_what_was_beside_a_point() -> None:
    warp = Warp(POINTS, bent(POINTS), np.ones(40), 10.0)
    at = np.vstack([POINTS[:4], np.random.default_rng(4).uniform(-40, 40, (4, 3))])
    moved, normals = warp.turned(at, AXES)
    np.testing.assert_allclose(moved, warp(at), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
    for axis in np.eye(3):
        beside = 1e-3 * np.cross(AXES, axis)
        there = warp(at + beside) - warp(at - beside)
        assert np.abs((there * normals).sum(axis=1)).max() < 1e-4 * np.linalg.norm(there, axis=1).max()


@pytest.mark.parametrize("stiffness", [10.0, 3000.0])
def test_it_is_the_smoothing_spline_of_scipy(stiffness: float) -> None:
    weight = np.random.default_rng(2).uniform(0.1, 30.0, 40)
    spline = RBFInterpolator(POINTS, bent(POINTS) - POINTS, smoothing=stiffness / weight, kernel="thin_plate_spline")
    at = np.vstack([POINTS[:5], np.random.default_rng(3).uniform(-90, 90, (20, 3))])
    np.testing.assert_allclose(Warp(POINTS, bent(POINTS), weight, stiffness)(at), at + spline(at), atol=1e-8)


def test_what_weighs_more_is_followed_more_closely_and_what_weighs_nothing_hardly() -> None:
    goals, weight = POINTS.copy(), np.ones(40)
    goals[:3] += [0.0, 0.0, 4.0]
    weight[:3] = 1.0, 100.0, 0.0
    left = np.linalg.norm(Warp(POINTS, goals, weight, 2000.0)(POINTS) - goals, axis=1)
    assert left[1] < 0.2 * left[0] and left[2] > left[0]
    stiff, loose = (np.abs(Warp(POINTS, goals, np.ones(40), s)(POINTS) - goals)[:3].max() for s in (1e5, 10.0))
    assert loose < 0.3 * stiff
