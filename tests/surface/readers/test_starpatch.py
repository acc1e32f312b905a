"""Catmull and Clark's subdivision, its limit and the patches fitted to it, against published figures and splines."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from surface.readers.starpatch import (
    COUNT,
    SPANS,
    Sampled,
    _basis,
    _correct_sides,
    _fill,
    _project_to_limit,
    _subdivide,
    fit_patch,
)

CUBE = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def grid(count: int) -> tuple[list[list[int]], np.ndarray]:
    """Faces and places of a flat lattice of count x count vertices."""
    faces = [
        [i * count + j, (i + 1) * count + j, (i + 1) * count + j + 1, i * count + j + 1]
        for i in range(count - 1)
        for j in range(count - 1)
    ]
    return faces, np.array([[i, j] for i in range(count) for j in range(count)], float)


def places(count: int) -> np.ndarray:
    return np.full((count, 2), np.nan)


def test_a_step_of_the_cube_is_that_of_the_paper() -> None:
    """Corners at 5/9, edges at 3/4 and faces at 1, as the rules of 1978 give by hand."""
    _, x, _ = _subdivide(CUBE, CORNERS, places(8))
    assert_allclose(x[:8], CORNERS * 5 / 9)
    edges, faces = np.abs(x[8:20]), np.abs(x[20:])
    assert_allclose(np.sort(edges, axis=1), np.tile([0.0, 0.75, 0.75], (12, 1)))
    assert_allclose(np.sort(faces, axis=1), np.tile([0.0, 0.0, 1.0], (6, 1)))


def test_the_limit_is_where_many_steps_lead() -> None:
    at_once = _project_to_limit(CUBE, CORNERS)
    faces, x, where = CUBE, CORNERS, places(8)
    for _ in range(5):
        faces, x, where = _subdivide(faces, x, where)
    stepwise = _project_to_limit(faces, x)[:8]
    assert_allclose(at_once, stepwise, atol=1e-12)  # the limit of a vertex does not depend on when it is asked for
    assert_allclose(x[:8], at_once, atol=2e-3)


def test_on_a_lattice_the_limit_is_the_uniform_cubic_spline() -> None:
    faces, flat = grid(7)
    heights = np.random.default_rng(7).normal(size=49)
    x = np.column_stack([flat, heights])
    limit = _project_to_limit(faces, x).reshape(7, 7, 3)
    share = BSpline.basis_element(np.arange(5.0))([1.0, 2.0, 3.0])
    net = heights.reshape(7, 7)
    for i, j in ((2, 2), (3, 4), (4, 3)):
        assert_allclose(limit[i, j, 2], share @ net[i - 1 : i + 2, j - 1 : j + 2] @ share, atol=1e-14)


def test_shares_of_every_place_add_up_to_one() -> None:
    faces, x, where = CUBE, np.eye(8), places(8)
    for _ in range(2):
        faces, x, where = _subdivide(faces, x, where)
    assert_allclose(_project_to_limit(faces, x).sum(axis=1), 1.0)


def test_places_without_samples_lie_on_the_lines_through_their_neighbours() -> None:
    t = np.arange(COUNT, dtype=float)
    plane = (2.0 * t[:, None] - 3.0 * t[None] + 1.0)[..., None]
    gaps = plane.copy()
    gaps[4, 3] = gaps[0, 5] = np.nan
    assert_allclose(_fill(gaps), plane)


def test_a_corner_without_a_sample_is_the_sample_next_to_it() -> None:
    lattice = np.ones((COUNT, COUNT, 1))
    lattice[-1, :] = lattice[:, -1] = np.nan
    lattice[-1, 0] = 3.0
    filled = _fill(lattice)
    assert filled[-1, -1] == 1.0
    assert np.isfinite(filled).all() and (filled >= 1.0).all()


def test_a_patch_of_samples_of_a_spline_is_that_spline() -> None:
    shares = np.random.default_rng(3).normal(size=(SPANS + 3, SPANS + 3, 4))
    basis = _basis(np.linspace(0.0, 1.0, COUNT))
    samples = np.einsum("ia,jb,abg->ijg", basis, basis, shares)
    sampled = Sampled([0, 1, 2, 3], (1.0, 1.0), samples, samples)
    patch = fit_patch(sampled)
    assert_allclose(patch.shares, shares, atol=1e-10)
    assert patch.deviation(sampled, np.eye(4)[:, :3]) < 1e-12


def test_the_basis_is_that_of_scipy() -> None:
    knots = np.r_[[0.0] * 3, np.linspace(0.0, 1.0, SPANS + 1), [1.0] * 3]
    t = np.linspace(0.0, 1.0, 33)[:-1]
    assert_allclose(_basis(t), BSpline.design_matrix(t, knots, 3).toarray(), atol=1e-14)


def test_sides_that_are_known_are_met_and_the_others_stay() -> None:
    """A Coons patch meets the sides that are given; a side that nobody knows is moved along a straight line only."""
    limit = np.zeros((COUNT, COUNT, 1))
    t = np.linspace(0.0, 1.0, COUNT)
    below, right = np.sin(3 * t)[:, None], np.sin(3.0) * (1 - t)[:, None]
    moved = _correct_sides(limit, [below, right, None, None])
    assert_allclose(moved[:, 0], below, atol=1e-14)
    assert_allclose(moved[-1], right, atol=1e-14)
    assert_allclose(moved[:, -1], 0.0, atol=1e-14)
    assert_allclose(moved[0], 0.0, atol=1e-14)
