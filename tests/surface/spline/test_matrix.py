"""Rational weights as sparse matrices against scipy's B-splines and the surface itself."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.interpolate import BSpline

from surface import DCPSurface
from surface.spline import matrix


def net(weights: np.ndarray) -> tuple[DCPSurface, np.ndarray]:
    knots = np.array([0.0, 0, 0, 0.3, 0.6, 1, 1, 1])
    points = np.random.default_rng(1).normal(size=(5, 5, 3))
    return DCPSurface.from_nurbs(2, 2, knots, knots, points, weights), knots


def test_rows_are_rational_weights_of_scipys_design_matrices() -> None:
    weights = np.random.default_rng(2).uniform(0.5, 2, (5, 5))
    surface, knots = net(weights)
    uv = np.random.default_rng(0).uniform(0, 1, (40, 2))
    along = [BSpline.design_matrix(uv[:, k], knots, 2).toarray() for k in range(2)]
    slopes = [BSpline(knots, np.eye(5), 2).derivative()(uv[:, k]) for k in range(2)]
    b, bu, bv = (
        np.einsum("mi,mj,ij->mij", a, c, weights).reshape(40, -1)
        for a, c in ((along[0], along[1]), (slopes[0], along[1]), (along[0], slopes[1]))
    )
    w = b.sum(axis=1, keepdims=True)
    value, du, dv = (m.toarray() for m in matrix.basis_matrices(surface, uv, [(0, 0), (1, 0), (0, 1)]))
    assert np.allclose(value, b / w, rtol=0, atol=1e-13)
    assert np.allclose(du, bu / w - b * bu.sum(axis=1, keepdims=True) / w**2, rtol=0, atol=1e-11)
    assert np.allclose(dv, bv / w - b * bv.sum(axis=1, keepdims=True) / w**2, rtol=0, atol=1e-11)


def test_more_samples_than_one_chunk() -> None:
    surface, _ = net(np.ones((5, 5)))
    uv = np.random.default_rng(0).uniform(0, 1, (matrix.CHUNK + 7, 2))
    found = matrix.basis_matrices(surface, uv, [(0, 0)])[0]
    assert found.shape == (len(uv), 25)
    assert np.allclose(found @ surface.points, surface.evaluate(uv), rtol=0, atol=1e-12)


def test_the_right_end_takes_the_limit_from_the_left_and_gaps_are_empty() -> None:
    surface, _ = net(np.ones((5, 5)))
    corner = matrix.basis_matrices(surface, [[1.0, 1.0]], [(0, 0)])[0].toarray()
    assert corner[0, -1] == 1 and corner.sum() == 1
    gap = DCPSurface([[0.0, 0, 0], [1, 0, 0]], [1, 1], [[0, 1], [2, 3]], [[0, 1]] * 2)
    found = matrix.basis_matrices(gap, [[0.5, 0.5], [1.5, 0.5], [2.5, 0.5]], [(0, 0)])[0]
    assert np.array_equal(found.toarray(), [[1, 0], [0, 0], [0, 1]])


def test_sides_choose_the_limit() -> None:
    surface = shapes.torn()
    half = surface.n // 2
    low = matrix.basis_matrices(surface, [[0.4, 0.5]], [(0, 0)], [2])[0].toarray()[0]
    high = matrix.basis_matrices(surface, [[0.4, 0.5]], [(0, 0)])[0].toarray()[0]
    assert low[:half].sum() == pytest.approx(1) and low[half:].sum() == 0
    assert high[half:].sum() == pytest.approx(1) and high[:half].sum() == 0


def test_copies_of_a_closed_surface_count_for_their_point() -> None:
    torus = shapes.torus()
    uv = np.array([[0.999, 0.5], [0.001, 0.999], [2.5, -0.25]])
    found = matrix.basis_matrices(torus, uv, [(0, 0)])[0]
    assert found.shape == (3, torus.n)
    assert found.has_canonical_format
    assert found.indices.max() < torus.n
    assert np.allclose(found @ torus.points, torus.evaluate(uv), rtol=0, atol=1e-12)


def test_an_unknown_derivative_is_named() -> None:
    with pytest.raises(ValueError, match=r"derivative: must be \(0, 0\), \(1, 0\) or \(0, 1\), not \(1, 1\)"):
        matrix.basis_matrices(shapes.torus(), [[0.5, 0.5]], [(0, 0), (1, 1)])


def test_rows_for_products_are_the_matrix_without_scipy() -> None:
    surface, _ = net(np.random.default_rng(3).uniform(0.5, 2, (5, 5)))
    uv = np.random.default_rng(0).uniform(0, 1, (40, 2))
    rows, sparse = matrix.basis_rows(surface, uv), matrix.basis_matrices(surface, uv, [(0, 0)])[0]
    for values in (surface.points, np.arange(25.0), np.ones((25, 2, 3))):
        wanted = (sparse @ values.reshape(25, -1)).reshape(40, *values.shape[1:])
        assert np.allclose(rows @ values, wanted, rtol=0, atol=1e-13)
    assert (matrix.basis_rows(surface, np.zeros((0, 2))) @ surface.points).shape == (0, 3)
