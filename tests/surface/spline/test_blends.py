"""Blending functions against scipy's B-splines, from both sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from surface.spline import blends

REPEATED = [
    [0, 0, 1], [0, 1, 1], [0, 0, 1, 2], [0, 1, 1, 2], [0, 0, 1, 1], [0, 0, 0, 1, 2], [0, 0, 1, 2, 2], [0, 1, 1, 2, 3],
    [0, 1, 2, 2, 2], [0, 0, 0, 0, 1], [0, 1, 1, 1, 1], [0, 0, 0.5, 1, 1], [0, 0.5, 0.5, 0.5, 1], [0, 0, 1, 1, 2, 3],
    [0, 1, 1, 2, 2, 2],
]  # fmt: skip


def knot_vectors() -> list[list[float]]:
    """Random knots of every degree, and repeated ones."""
    rng = np.random.default_rng(0)
    return [np.cumsum(rng.uniform(0.2, 1, p + 2)).tolist() for p in range(8) for _ in range(2)] + REPEATED


def limits(knots: np.ndarray, x: np.ndarray, order: int) -> np.ndarray:
    """Right limits of scipy's basis element, zero outside."""
    element = BSpline.basis_element(knots, extrapolate=True)
    return np.where((x >= knots[0]) & (x < knots[-1]), element(x, order), 0.0)


@pytest.mark.parametrize("knots", knot_vectors(), ids=str)
@pytest.mark.parametrize("left", [False, True])
def test_values_and_derivatives_are_scipys(knots: list[float], left: bool) -> None:
    row = np.array(knots, dtype=float)
    p = len(row) - 2
    x = np.concatenate([np.linspace(row[0], row[-1], 23)[1:-1], np.unique(row), [row[0] - 0.3, row[-1] + 0.3]])
    padded = np.vstack([row + 50, row])  # not the first row
    padded = np.hstack([padded, np.repeat(padded[:, -1:], 3, axis=1)])
    work = np.zeros(12)
    found = np.array([blends.blend2(padded, 1, p, at, left, work) for at in x])
    for order in range(min(p, 2) + 1):
        # A mirrored function has the same values from the other side.
        expected = (-1) ** order * limits(-row[::-1], -x, order) if left else limits(row, x, order)
        scale = max(1.0, np.abs(expected).max())
        assert np.allclose(found[:, order], expected, rtol=0, atol=1e-11 * scale), order
    assert (found[:, p + 1 :] == 0).all()
    one = np.array([blends.blend1(padded, 1, p, at, left, work) for at in x])
    value = np.array([blends.blend(padded, 1, p, at, left, work) for at in x])
    assert np.allclose(one, found[:, :2], rtol=1e-12, atol=1e-13)
    assert np.allclose(value, found[:, 0], rtol=1e-12, atol=1e-13)
    out = np.zeros((len(x), 3))
    blends.blend_samples(row[None], p, x, left, out)
    assert np.array_equal(out, found)


def test_the_interval_of_a_place() -> None:
    knots = np.array([[0.0, 1, 1, 2, 2]])
    for x, left, expected in (
        (0.0, False, 0), (0.5, False, 0), (1.0, False, 2), (2.0, False, -1), (-0.1, False, -1),
        (0.0, True, -1), (1.0, True, 0), (1.5, True, 2), (2.0, True, 2), (2.1, True, -1),
    ):  # fmt: skip
        assert blends.span(knots, 0, 3, x, left) == expected, (x, left)
