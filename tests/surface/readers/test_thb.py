"""surface.readers.thb: against B-splines of scipy and against truncation by its definition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from surface import DCPSurface
from surface.readers.thb import Hierarchy, Level, dyadic_refinement, knot_insertion

OPEN = np.array([0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1])
GRID = np.stack(np.meshgrid(np.linspace(0, 1, 23), np.linspace(0, 1, 19)), axis=-1).reshape(-1, 2)


def basis(knots: np.ndarray, degree: int, x: np.ndarray) -> np.ndarray:
    """(m, n) B-splines by scipy; the last one holds the right end."""
    return np.asarray(BSpline.design_matrix(x, knots, degree).todense())


def products(level: Level, xy: np.ndarray) -> np.ndarray:
    """(m, nu, nv) tensor-product B-splines."""
    u, v = (basis(level.knots[k], level.degrees[k], xy[:, k]) for k in range(2))
    return u[:, :, None] * v[:, None, :]


@pytest.mark.parametrize(
    ("coarse", "fine", "degree"),
    [
        (OPEN, np.sort(np.append(OPEN, [0.1, 0.6, 0.6])), 2),
        (np.array([0, 0, 1, 2, 2.0]), np.array([0, 0, 0.5, 1, 1.5, 2, 2]), 1),
        (np.array([0, 1, 2, 3.0]), np.array([0, 0.25, 1, 2, 2.5, 3]), 0),
    ],
)
def test_knot_insertion_keeps_every_function(coarse: np.ndarray, fine: np.ndarray, degree: int) -> None:
    x = np.linspace(coarse[degree], coarse[-degree - 1], 41)[:-1] + 1e-3
    matrix = knot_insertion(coarse, fine, degree)
    assert matrix.shape == (len(coarse) - degree - 1, len(fine) - degree - 1)
    assert (matrix >= 0).all()
    np.testing.assert_allclose(basis(fine, degree, x) @ matrix.T, basis(coarse, degree, x), atol=1e-14)


def test_refinement_halves_every_span_of_both_directions() -> None:
    level = dyadic_refinement(Level((2, 1), (OPEN, np.array([0, 0, 1, 3, 3.0]))))
    assert level.degrees == (2, 1)
    assert level.knots[0].tolist() == [0, 0, 0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1, 1, 1]
    assert level.knots[1].tolist() == [0, 0, 0.5, 1, 2, 3, 3]
    assert level.shape == (10, 5)
    assert level.local_knots(0, 2).tolist() == [0, 0.125, 0.25, 0.375]
    assert level.local_knots(1, 4).tolist() == [2, 3, 3]


def hierarchy(count: int = 3) -> Hierarchy:
    levels = [Level((2, 2), (OPEN, OPEN))]
    for _ in range(count - 1):
        levels.append(dyadic_refinement(levels[-1]))
    cells = 4 * 2 ** (count - 1)
    depth = np.zeros((cells, cells), dtype=np.int64)
    if count > 1:
        depth[: cells // 2, : cells * 3 // 4] = 1
    if count > 2:
        depth[: cells // 4, 4 : cells // 2 + 2] = 2
    return Hierarchy(levels, depth)


def evaluated(found: tuple, xy: np.ndarray) -> np.ndarray:
    return DCPSurface(*found).evaluate(xy)


def test_active_functions_have_their_support_in_their_region_alone() -> None:
    found = hierarchy()
    fine = found.levels[-1].knots[0]
    middles = (np.unique(fine)[1:] + np.unique(fine)[:-1]) / 2
    wanted = []
    for number, level in enumerate(found.levels):
        for j in range(level.shape[1]):
            for i in range(level.shape[0]):
                u, v = level.local_knots(0, i), level.local_knots(1, j)
                inside = np.outer((u[0] < middles) & (middles < u[-1]), (v[0] < middles) & (middles < v[-1]))
                if found.depth[inside].min() == number:
                    wanted.append((number, i, j))
    assert found.active.tolist() == [list(row) for row in wanted]
    assert set(found.active[:, 0]) == {0, 1, 2}


def truncated(found: Hierarchy, xy: np.ndarray) -> np.ndarray:
    """(m, n) the truncated basis by its definition: on each finer level, functions within its region are left out."""
    columns = []
    for number, i, j in found.active.tolist():
        share = np.zeros(found.levels[number].shape)
        share[i, j] = 1.0
        for finer in range(number + 1, len(found.levels)):
            u, v = (knot_insertion(found.levels[finer - 1].knots[k], found.levels[finer].knots[k], 2) for k in range(2))
            share = u.T @ share @ v
            lines = [np.unique(t) for t in found.levels[-1].knots]
            for a in range(share.shape[0]):
                for b in range(share.shape[1]):
                    ends = [found.levels[finer].local_knots(k, (a, b)[k])[[0, -1]] for k in range(2)]
                    (r, s), (t, w) = (np.searchsorted(lines[k], ends[k]) for k in range(2))
                    if found.depth[r:s, t:w].min() >= finer:
                        share[a, b] = 0.0
        columns.append(np.einsum("mij,ij->m", products(found.levels[-1], xy), share))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_control_points_are_the_truncated_basis(count: int) -> None:
    found = hierarchy(count)
    coefficients = np.random.default_rng(1).normal(size=(len(found.active), 3))
    points = found.control_points(coefficients)
    assert (points[1] > 0).all() and len(points[0]) == len(points[2]) == len(points[3])
    np.testing.assert_allclose(evaluated(points, GRID), truncated(found, GRID) @ coefficients, atol=1e-12)


def test_plain_coefficients_become_truncated_ones() -> None:
    found = hierarchy()
    coefficients = np.random.default_rng(2).normal(size=(len(found.active), 3))
    plain = np.zeros((len(GRID), 3))
    for (number, i, j), c in zip(found.active.tolist(), coefficients, strict=True):
        plain += products(found.levels[number], GRID)[:, i, j, None] * c
    given = found.to_truncated(coefficients)
    np.testing.assert_allclose(evaluated(found.control_points(given), GRID), plain, atol=1e-12)
    coarse = found.active[:, 0] == 0
    assert np.array_equal(given[coarse], coefficients[coarse])


def test_functions_that_no_region_cuts_stay_whole() -> None:
    found = hierarchy(2)
    points, weights, ku, _ = found.control_points(np.ones((len(found.active), 3)))
    spans = [round(1 / np.unique(np.diff(k)[np.diff(k) > 0])[0]) for k in ku]
    assert spans.count(4) > 5 and (weights[[s == 4 for s in spans]] == 1.0).all()
    assert np.allclose(points, 1.0)
