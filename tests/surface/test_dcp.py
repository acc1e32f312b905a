"""Eq. (1): exact evaluation of scattered control points."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import DCPSurface
from tests.surface.shapes import scattered


def from_case(case: dict) -> DCPSurface:
    if case["kind"] == "nurbs":
        names = ("degree_u", "degree_v", "knots_u", "knots_v", "control_points", "weights")
        return DCPSurface.from_nurbs(*(case[name] for name in names))
    points = case["control_points"]
    return DCPSurface(*([p[name] for p in points] for name in ("point", "weight", "knots_u", "knots_v")))


@pytest.mark.parametrize("index", range(9))
def test_reference_cases(shared: Path, index: int) -> None:
    case = json.loads((shared / "data/nurbs/reference_cases.json").read_text())[index]
    surface = from_case(case)
    s, su, sv = surface.derivatives(case["uv"])
    scale = np.abs(case["S"]).max()
    assert np.abs(surface.evaluate(case["uv"]) - case["S"]).max() < 1e-12 * scale
    assert np.abs(s - case["S"]).max() < 1e-12 * scale
    if "Su" in case:
        for mine, theirs in ((su, case["Su"]), (sv, case["Sv"])):
            assert np.abs(mine - theirs).max() < 1e-9 * np.abs(theirs).max()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_affine_invariance_and_convex_hull(seed: int) -> None:
    surface = scattered(30, seed)
    rng = np.random.default_rng(seed)
    uv = rng.uniform(0, 1, (50, 2))
    matrix, offset = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = surface.with_points(surface.points @ matrix.T + offset)
    assert np.allclose(moved.evaluate(uv), surface.evaluate(uv) @ matrix.T + offset, rtol=0, atol=1e-12)
    direction = rng.normal(size=3)
    heights = surface.points @ direction
    inside = surface.evaluate(uv) @ direction
    assert heights.min() - 1e-12 <= inside.min()
    assert inside.max() <= heights.max() + 1e-12


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_a_move_changes_nothing_outside_the_subdomain(seed: int) -> None:
    surface = scattered(30, seed)
    uv = np.random.default_rng(seed).uniform(0, 1, (200, 2))
    points = surface.points.copy()
    i = seed % 30
    points[i] += 1.0
    changed = (surface.with_points(points).evaluate(uv) != surface.evaluate(uv)).any(axis=1)
    u0, u1, v0, v1 = surface.supports[i]
    within = (uv[:, 0] >= u0) & (uv[:, 0] <= u1) & (uv[:, 1] >= v0) & (uv[:, 1] <= v1)
    assert not (changed & ~within).any()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_basis_matrix_is_the_surface(seed: int) -> None:
    surface = scattered(30, seed)
    uv = np.random.default_rng(seed).uniform(0, 1, (60, 2))
    s, su, sv = surface.derivatives(uv)
    matrix = surface.basis_matrix(uv)
    assert np.allclose(matrix.sum(axis=1), 1, rtol=0, atol=1e-14)
    assert (matrix.data >= 0).all()
    assert np.allclose(matrix @ surface.points, s, rtol=0, atol=1e-12)
    for order, expected in (((1, 0), su), ((0, 1), sv)):
        scale = np.abs(expected).max()
        assert np.allclose(surface.basis_matrix(uv, order) @ surface.points, expected, atol=1e-10 * scale)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_derivatives_agree_with_differences(seed: int) -> None:
    surface = scattered(20, seed, degrees=(4, 9))
    uv = np.random.default_rng(seed).uniform(0.1, 0.9, (40, 2))
    h = 1e-5
    _, su, sv = surface.derivatives(uv)
    for axis, exact in ((0, su), (1, sv)):
        step = np.eye(2)[axis] * h
        numeric = (surface.evaluate(uv + step) - surface.evaluate(uv - step)) / (2 * h)
        assert np.allclose(numeric, exact, atol=1e-5 * max(1.0, np.abs(exact).max()))
    suu, suv, svv = surface.second_derivatives(uv)
    step = np.array([h, 0.0])
    ahead, behind = surface.derivatives(uv + step), surface.derivatives(uv - step)
    size = max(1.0, np.abs(suu).max(), np.abs(suv).max())
    assert np.allclose((ahead[1] - behind[1]) / (2 * h), suu, atol=1e-3 * size)
    assert np.allclose((ahead[2] - behind[2]) / (2 * h), suv, atol=1e-3 * size)
    assert svv.shape == (40, 3)


def test_uncovered_is_nan_and_masked() -> None:
    surface = DCPSurface([[1.0, 2.0, 3.0]], [2.0], [[0, 0, 1, 1]], [[0, 1, 2]])
    assert surface.covered([[1.5, 1.0]]).tolist() == [False]
    uv = [[0.5, 1.0], [0.0, 0.5], [1.0, 1.0], [0.5, 0.0]]
    assert surface.covered(uv).tolist() == [True, False, False, False]
    assert np.isnan(surface.evaluate(uv)).all(axis=1).tolist() == [False, True, True, True]
    assert np.isnan(surface.derivatives(uv)[1][1]).all()
    assert surface.basis_matrix(uv).sum(axis=1).ravel().tolist() == [[1, 0, 0, 0]]


def test_limits_from_both_sides_of_a_slit() -> None:
    flat = [0, 0, 1, 1, 1]
    surface = DCPSurface([[0, 0, 0], [0, 0, 5]], [1, 1], [flat, flat], [[0, 1, 1], [1, 1, 2]])
    at = [[0.5, 1.0]]
    assert surface.evaluate(at)[0, 2] == 5
    assert surface.evaluate(at, side=[2])[0, 2] == 0


BAD = {
    "points: empty": (np.zeros((0, 3)), [], [], []),
    r"points: shape \(2,\)": ([0, 1], [1], [[0, 1]], [[0, 1]]),
    r"points\[1\]: must be finite": ([[0, 0, 0], [0, np.nan, 0]], [1, 1], [[0, 1]] * 2, [[0, 1]] * 2),
    r"weights\[1\]: must be positive": (np.zeros((2, 3)), [1, 0], [[0, 1]] * 2, [[0, 1]] * 2),
    "weights: 1 weights for 2": (np.zeros((2, 3)), [1], [[0, 1]] * 2, [[0, 1]] * 2),
    r"knots_u\[1\]: knots decrease at knot 2": (np.zeros((2, 3)), [1, 1], [[0, 1], [0, 2, 1]], [[0, 1]] * 2),
    r"knots_v\[0\]: fewer than two": (np.zeros((1, 3)), [1], [[0, 1]], [[3, 3, 3]]),
    r"knots_v\[0\]: knots must be finite": (np.zeros((1, 3)), [1], [[0, 1]], [[3, np.inf, np.inf]]),
    r"knots_u\[0\]: 1 knots": (np.zeros((1, 3)), [1], [[0]], [[3, 4]]),
    r"knots_u\[0\]: 12 knots": (np.zeros((1, 3)), [1], [range(12)], [[3, 4]]),
    "knots_u: 1 knot vectors for 2": (np.zeros((2, 3)), [1, 1], [[0, 1]], [[0, 1]] * 2),
    r"knots_u\[0\]: not a flat sequence": (np.zeros((1, 3)), [1], [3], [[0, 1]]),
    r"knots_u\[1\]: must be numbers, got \[0, 'x'\]": (np.zeros((2, 3)), [1, 1], [[0, 1], [0, "x"]], [[0, 1]] * 2),
    "knots_u: not 1 sequences of knots but None": (np.zeros((1, 3)), [1], None, [[0, 1]]),
    r"points\[0\]: must be numbers": ([["a", 0, 0]], [1], [[0, 1]], [[0, 1]]),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_arguments_are_named(message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DCPSurface(*BAD[message])


@pytest.mark.parametrize("name", ["evaluate", "derivatives", "second_derivatives", "curvatures", "basis_matrix"])
def test_places_outside_the_domain_and_wrong_samples_are_named(name: str) -> None:
    surface = scattered(20, 1)
    call = getattr(surface, name)
    u0, u1, v0, v1 = surface.rect
    assert not surface.covered([[u1 + 1, v0]]).any()
    call([[u0, v0], [u1, v1]])
    for uv, message in (
        ([[u0, v0], [u1 + 1e-9, v0]], r"uv\[1\]: u = .* is outside the domain"),
        ([[u0, v0 - 1]], r"uv\[0\]: v = .* is outside the domain"),
        ([[u0, v0], [np.nan, v0]], r"uv\[1\]: must be finite"),
        ([[u0, v0], [u0]], r"uv\[1\]: shape \(1,\), expected \(2,\)"),
        ([u0, v0], r"uv: shape \(2,\)"),
    ):
        with pytest.raises(ValueError, match=message):
            call(uv)
    for side, message in (([4], r"side\[0\]: must be 0, 1, 2 or 3, not 4"), ([0, 0], r"side: shape \(2,\)")):
        with pytest.raises(ValueError, match=message):
            call([[u0, v0]], side=side)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"degree_u": 10}, "degree_u: must be a whole number from 0 to 9"),
        ({"degree_v": 1.5}, "degree_v: must be a whole number"),
        ({"knots_u": [0, 0, 2, 1]}, r"knots_u\[3\]: 1.0 after 2.0"),
        ({"knots_v": [0, np.nan, 1, 1]}, r"knots_v\[1\]: nan after 0.0"),
        ({"knots_v": [0, 1]}, r"knots_v: shape \(2,\), expected \(4,\)"),
        ({"knots_v": [1, 1, 1, 1]}, r"knots_v\[0\]: fewer than two distinct"),
        ({"control_points": [[[0, 0, 0], [0, np.inf, 0]]] * 2}, r"control_points\[0, 1\]: must be finite"),
        ({"control_points": np.zeros((0, 2, 3)), "knots_u": [0, 1]}, "control_points: empty"),
        ({"weights": [[1, 1], [0, 1]]}, r"weights\[1, 0\]: must be positive and finite, got 0.0"),
        ({"weights": [1, 1]}, r"weights: shape \(2,\), expected \(2, 2\)"),
    ],
)
def test_bad_nets_are_named(change: dict, message: str) -> None:
    good = {"degree_u": 1, "degree_v": 1, "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 1, 1]}
    net = {"control_points": np.zeros((2, 2, 3)), "weights": np.ones((2, 2))}
    with pytest.raises(ValueError, match=message):
        DCPSurface.from_nurbs(**(good | net | change))


def test_published_arrays_are_read_only() -> None:
    surface = scattered(3, 0)
    for array in (surface.points, surface.weights, surface.knots_u[0], surface.padded[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_padded_round_trip() -> None:
    surface = scattered(12, 3)
    again = DCPSurface.from_padded(surface.points, surface.weights, *surface.padded, *surface.degrees)
    uv = np.random.default_rng(0).uniform(0, 1, (20, 2))
    assert np.array_equal(again.evaluate(uv), surface.evaluate(uv))


def test_importing_the_room_loads_neither_scipy_nor_numba(root: Path) -> None:
    code = "import sys, surface; sys.exit(any(m in sys.modules for m in ('scipy', 'numba', 'moderngl')))"
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["points", "weights", "knots_u", "knots_v"]),
    st.integers(0, 5),
    st.sampled_from([np.nan, np.inf, -np.inf, None, "x", [1, 2], {}]),
    st.booleans(),
)
def test_whatever_stands_for_a_number_is_named(name: str, index: int, bad: object, whole: bool) -> None:
    surface = scattered(5, 2)
    given_ = {
        "points": surface.points.tolist(),
        "weights": surface.weights.tolist(),
        "knots_u": [k.tolist() for k in surface.knots_u],
        "knots_v": [k.tolist() for k in surface.knots_v],
    }
    if whole or name == "weights":
        given_[name][index] = bad
    else:
        given_[name][index][1] = bad
    if name != "weights" and whole and bad == [1, 2] and name.startswith("knots"):
        return  # two knots that rise are a knot vector
    with pytest.raises(ValueError, match=rf"^{name}\[{index}\]: "):
        DCPSurface(**given_)
