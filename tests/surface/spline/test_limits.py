"""The ends of what a surface may be: the highest degrees, against scipy, and numbers too small to compute with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from surface import DCPSurface, blending
from surface.readers import NamedSurface, read_surface, write_surfaces


def high(degree_u: int, degree_v: int) -> tuple[DCPSurface, list[np.ndarray], np.ndarray, np.ndarray]:
    """A rational net with inner knots, its knot vectors, control points and weights."""
    rng, nets = np.random.default_rng(degree_u), (degree_u + 4, degree_v + 3)
    knots = [
        np.concatenate([[0.0] * (p + 1), np.sort(rng.uniform(0.1, 0.9, n - p - 1)), [1.0] * (p + 1)])
        for p, n in zip((degree_u, degree_v), nets, strict=True)
    ]
    net, weights = rng.normal(size=(*nets, 3)), rng.uniform(0.5, 2.0, nets)
    return DCPSurface.from_nurbs(degree_u, degree_v, *knots, net, weights), knots, net, weights


@pytest.mark.parametrize("degree", [7, 8, 9])
def test_blending_functions_of_high_degree_are_those_of_scipy(degree: int) -> None:
    knots = np.cumsum(np.random.default_rng(degree).uniform(0.1, 1.0, degree + 2))
    x = np.linspace(knots[0], knots[-1], 60)[1:-1]
    element = BSpline.basis_element(knots, extrapolate=False)
    for order in range(3):
        expected = element.derivative(order)(x) if order else element(x)
        assert np.allclose(blending(knots, x, order), expected, rtol=0, atol=1e-11 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize(("degree_u", "degree_v"), [(9, 8), (4, 9)])
def test_surfaces_of_high_degree_are_those_of_scipy_everywhere(degree_u: int, degree_v: int, tmp_path: Path) -> None:
    surface, knots, net, weights = high(degree_u, degree_v)
    uv = np.random.default_rng(1).uniform(size=(200, 2))

    def expected(at: np.ndarray) -> np.ndarray:
        rows = [
            BSpline.design_matrix(x, t, p).toarray() for x, t, p in zip(at.T, knots, (degree_u, degree_v), strict=True)
        ]
        sums = np.einsum("mi,mj,ijc->mc", *rows, np.dstack([net * weights[..., None], weights]))
        return sums[:, :3] / sums[:, 3:]

    assert np.allclose(surface.evaluate(uv), expected(uv), rtol=0, atol=1e-13)
    mesh = surface.tessellate(chord_error=0.1, max_depth=4)
    moving = surface.deformation(mesh)
    assert np.allclose(moving.vertices, expected(mesh.uv), rtol=0, atol=2e-6)
    moving.set_knots(0, surface.knots_u[0] * 0.9, surface.knots_v[0])
    moving.move([3, 40], [[0.5, 0.0, -0.25], [0.1, 0.2, 0.3]])
    assert np.allclose(moving.vertices, moving.surface.evaluate(mesh.uv), rtol=0, atol=2e-6)
    write_surfaces(tmp_path / "high.json", [NamedSurface("high", surface)])
    again = read_surface(tmp_path / "high.json")[0].surface
    assert np.array_equal(again.evaluate(uv), surface.evaluate(uv))
    finer = surface.refine((0.2, 0.6, 0.1, 0.5)).surface
    assert finer.n > surface.n and np.allclose(finer.evaluate(uv), expected(uv), rtol=0, atol=1e-12)


SQUARE = [[0.0, 0.0, 1.0, 1.0]] * 4
POINTS = [[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]


@pytest.mark.parametrize(
    ("weights", "knots", "message"),
    [
        ([1, 1e-31, 1, 1], SQUARE, r"weights\[1\]: must be between 1e-30 and 1e\+30 .*got 1e-31"),
        ([1, 1, 1, 1.1e30], SQUARE, r"weights\[3\]: must be between"),
        (
            [1, 1, 1, 1],
            [[0, 0, 1e-31, 1], *SQUARE[1:]],
            r"knots_u\[0\]: knots 1 and 2 are 0.0 and 1e-31; make them equal",
        ),
        ([1, 1, 1, 1], [[0, 5e-324, 5e-324, 1e-323], *SQUARE[1:]], r"knots_u\[0\]: knots 0 and 1 are 0.0 and 5e-324"),
        (
            [1, 1, 1, 1],
            [SQUARE[0], [0, 0, 1, 1.1e30], *SQUARE[2:]],
            r"knots_u\[1\]: knots 2 and 3 are 1.0 and 1.1e\+30",
        ),
        ([1, 1, 1, 1], [*SQUARE[:3], [-1.1e30, -1e30, 1, 1]], r"knots_u\[3\]: knots 0 and 1 are -1.1e\+30"),
    ],
)
def test_numbers_too_small_or_large_to_compute_with_are_refused(weights: list, knots: list, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DCPSurface(POINTS, weights, knots, SQUARE)


def test_the_smallest_and_largest_numbers_that_are_taken_are_computed_with() -> None:
    for scale in (1e-30, 1e30):
        surface = DCPSurface(POINTS, [scale] * 4, SQUARE, SQUARE)
        other = DCPSurface(POINTS, [1] * 4, SQUARE, SQUARE)
        assert np.allclose(surface.evaluate([[0.25, 0.75]]), other.evaluate([[0.25, 0.75]]), rtol=1e-14, atol=0)
    steep = np.array([[0.0, 2e-30, 4e-30, 6e-30, 8e-30], [0.0, 1e-30, 0.5, 1.0, 1.0]])
    for row, x in ((steep[0], 3e-30), (steep[1], 0.25)):
        assert np.isfinite([blending(row, [x], order)[0] for order in range(3)]).all()
    assert blending(steep[0], [4e-30])[0] == pytest.approx(2 / 3)
