"""Samples evaluated in runs equal those evaluated one by one, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.spline.kernels import RUN


@pytest.mark.parametrize("order", ["rows", "random"])
@pytest.mark.parametrize("seed", range(3))
def test_runs_equal_single_samples(seed: int, order: str) -> None:
    surface = shapes.scattered(60, seed)
    u, v = np.meshgrid(np.linspace(-0.6, 1.7, 23), np.linspace(-0.6, 1.7, 29), indexing="ij")
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    if order == "random":
        uv = np.random.default_rng(seed).permutation(uv)
    assert len(uv) > 2 * RUN
    side = np.random.default_rng(seed).integers(0, 4, len(uv))
    taken, out = surface.sample_derivatives(uv, side, second=True)
    points = surface.sample(uv, side)[2]
    for k in range(0, len(uv), 7):
        alone, single = surface.sample_derivatives(uv[k : k + 1], side[k : k + 1], second=True)
        assert alone[0] == taken[k]
        assert np.array_equal(single[0], out[k], equal_nan=True)
        assert np.array_equal(surface.sample(uv[k : k + 1], side[k : k + 1])[2][0], points[k], equal_nan=True)
    assert (taken < 0).any()
    assert (taken >= 0).any()


def test_a_fine_run_on_a_net_is_the_same_as_single_samples() -> None:
    surface = shapes.hills(12)
    u, v = np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 33), indexing="ij")
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    together = surface.evaluate(uv)
    alone = np.concatenate([surface.evaluate(row[None]) for row in uv])
    assert np.array_equal(together, alone)


def test_slopes_of_rational_surfaces_are_those_of_differences() -> None:
    """Third-degree net with uneven weights, against central differences of evaluated places."""
    n, random = 7, np.random.default_rng(4)
    knots = np.concatenate([[0] * 4, np.linspace(0, 1, n - 2)[1:-1], [1] * 4])
    surface = DCPSurface.from_nurbs(
        3, 3, knots, knots, random.uniform(-10, 10, (n, n, 3)), random.uniform(0.3, 3.0, (n, n))
    )
    uv, h = random.uniform(0.05, 0.95, (40, 2)), 1e-5
    uv = uv[np.abs(uv[:, :, None] - knots).min(axis=(1, 2)) > 3 * h]
    _, su, sv = surface.derivatives(uv)
    suu, suv, svv = surface.second_derivatives(uv)
    for step, first, seconds in (([h, 0.0], su, (suu, suv)), ([0.0, h], sv, (suv, svv))):
        difference = (surface.evaluate(uv + step) - surface.evaluate(uv - step)) / (2 * h)
        np.testing.assert_allclose(difference, first, rtol=1e-4, atol=1e-3)
        ahead, behind = surface.derivatives(uv + step)[1:], surface.derivatives(uv - step)[1:]
        for second, a, b in zip(seconds, ahead, behind, strict=True):
            np.testing.assert_allclose((a - b) / (2 * h), second, rtol=1e-3, atol=5e-2)
