"""NURBS nets become control points with local knots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import DCPSurface
from surface.spline.nurbs import nurbs_arrays


def clamped(degree: int, count: int, rng: np.random.Generator) -> np.ndarray:
    inner = np.sort(rng.uniform(0.05, 0.95, count - degree - 1))
    return np.concatenate([[0.0] * (degree + 1), inner, [1.0] * (degree + 1)])


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 7), st.integers(1, 7), st.integers(0, 10_000))
def test_a_net_is_a_surface_of_the_same_corners_and_hull(p: int, q: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    nu, nv = p + int(rng.integers(1, 5)), q + int(rng.integers(1, 5))
    net, weights = rng.normal(size=(nu, nv, 3)), rng.uniform(0.3, 3, (nu, nv))
    surface = DCPSurface.from_nurbs(p, q, clamped(p, nu, rng), clamped(q, nv, rng), net, weights)
    corners = surface.evaluate([[0, 0], [0, 1], [1, 0], [1, 1]])
    assert np.allclose(corners, net[[0, 0, -1, -1], [0, -1, 0, -1]], rtol=0, atol=1e-12)
    uv = rng.uniform(0, 1, (60, 2))
    assert np.allclose(surface.basis_matrix(uv).sum(axis=1), 1)
    flat = surface.with_points(np.hstack([surface.points[:, :2], np.full((surface.n, 1), 4.0)]))
    assert np.allclose(flat.evaluate(uv)[:, 2], 4, rtol=0, atol=1e-12)


def test_order_of_points() -> None:
    net = np.arange(18.0).reshape(2, 3, 3)
    points, weights, ku, kv = nurbs_arrays(1, 2, [0, 0, 1, 1], [0, 0, 0, 1, 1, 1], net)
    assert np.array_equal(points[1 * 3 + 2], net[1, 2])
    assert ku[4].tolist() == [0, 1, 1]
    assert kv[4].tolist() == [0, 0, 1, 1]
    assert weights.tolist() == [1.0] * 6


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"net": np.zeros((2, 3))}, "control_points"),
        ({"ku": [0, 0, 1]}, "knots_u"),
        ({"weights": np.ones(6)}, "weights"),
    ],
)
def test_wrong_shapes_are_named(changes: dict, message: str) -> None:
    good = {"net": np.zeros((2, 3, 3)), "ku": [0, 0, 1, 1], "weights": None} | changes
    with pytest.raises(ValueError, match=message):
        nurbs_arrays(1, 2, good["ku"], [0, 0, 0, 1, 1, 1], good["net"], good["weights"])


def cox_de_boor(knots: np.ndarray, degree: int, i: int, x: float) -> float:
    """One B-spline by the textbook's recursion (Piegl and Tiller, Eq. 2.5), 0/0 taken as 0."""
    if degree == 0:
        return float(knots[i] <= x < knots[i + 1])
    total = 0.0
    if knots[i + degree] > knots[i]:
        total += (x - knots[i]) / (knots[i + degree] - knots[i]) * cox_de_boor(knots, degree - 1, i, x)
    if knots[i + degree + 1] > knots[i + 1]:
        rest = (knots[i + degree + 1] - x) / (knots[i + degree + 1] - knots[i + 1])
        total += rest * cox_de_boor(knots, degree - 1, i + 1, x)
    return total


@settings(max_examples=10, deadline=None)
@given(st.integers(1, 7), st.integers(1, 7), st.integers(0, 10_000))
def test_a_net_is_the_rational_sum_of_the_textbook(p: int, q: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    nu, nv = p + int(rng.integers(1, 4)), q + int(rng.integers(1, 4))
    ku, kv = clamped(p, nu, rng), clamped(q, nv, rng)
    net, weights = rng.normal(size=(nu, nv, 3)), rng.uniform(0.3, 3, (nu, nv))
    surface = DCPSurface.from_nurbs(p, q, ku, kv, net, weights)
    uv = rng.uniform(0, 1, (4, 2))
    for (u, v), point in zip(uv, surface.evaluate(uv), strict=True):
        along_u = np.array([cox_de_boor(ku, p, i, u) for i in range(nu)])
        along_v = np.array([cox_de_boor(kv, q, j, v) for j in range(nv)])
        share = np.outer(along_u, along_v) * weights
        assert np.allclose(point, np.einsum("ij,ijc->c", share, net) / share.sum(), rtol=0, atol=1e-12)


@pytest.mark.parametrize(("axis", "row", "told"), [
    ("u", [0, 0, 0.5, 0.2, 1], r"knots_u\[3\]: 0.2 after 0.5"), ("v", [0, 0, 0.5, 1, np.nan], r"knots_v\[4\]"),
    ("v", [1, 0, 0.5, 1, 1], r"knots_v\[1\]: 0.0 after 1.0"),
])  # fmt: skip
def test_a_knot_that_falls_is_named_with_the_one_before(axis: str, row: list[float], told: str) -> None:
    knots = {"u": [0.0, 0, 0.5, 1, 1], "v": [0.0, 0, 0.5, 1, 1], axis: row}
    with pytest.raises(ValueError, match=told):
        nurbs_arrays(1, 1, knots["u"], knots["v"], np.zeros((3, 3, 3)))


def test_a_knot_vector_of_another_length_is_refused_with_the_right_one() -> None:
    with pytest.raises(ValueError, match=r"knots_u: shape \(3,\), expected \(4,\): 2 points of degree 1"):
        nurbs_arrays(1, 2, [0, 0, 1], [0, 0, 0, 1, 1, 1], np.zeros((2, 3, 3)))
