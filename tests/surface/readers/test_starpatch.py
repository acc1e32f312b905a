"""Catmull and Clark's subdivision, its limit and the patches fitted to it, against published figures and splines."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from surface.readers.starpatch import (
    COUNT,
    SPANS,
    Sampled,
    _basis,
    _corner,
    _correct_sides,
    _fill,
    _project_to_limit,
    _rows,
    _side,
    _sides,
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


def test_a_step_at_the_outline_is_that_of_a_cubic_curve_and_corners_stay() -> None:
    faces, flat = grid(3)
    heights = np.random.default_rng(2).normal(size=9)
    x = np.column_stack([flat, heights])
    _, fine, where = _subdivide(faces, x, flat)
    assert_allclose(fine[[0, 2, 6, 8]], x[[0, 2, 6, 8]])  # in one face only
    assert_allclose(fine[1], 0.75 * x[1] + 0.125 * (x[0] + x[2]))
    assert_allclose(fine[3], 0.75 * x[3] + 0.125 * (x[0] + x[6]))
    centres = [x[face].mean(axis=0) for face in faces]
    middle = np.mean(centres, axis=0)  # (F + 2 R + (n - 3) P) / n with four faces
    ends = np.mean([0.5 * (x[4] + x[k]) for k in (1, 3, 5, 7)], axis=0)
    assert_allclose(fine[4], (middle + 2 * ends + x[4]) / 4)
    assert_allclose(where[:9], flat)
    first = fine[9 : 9 + 12]  # middles of the edges
    assert np.abs(first - 0.5 * (x[0] + x[1])).max(axis=1).min() < 1e-12  # on the outline
    inner = 0.25 * (x[4] + x[1]) + 0.25 * (centres[0] + centres[1])
    assert np.abs(first - inner).max(axis=1).min() < 1e-12
    assert_allclose(fine[21:], centres)
    limit = _project_to_limit(faces, x)
    assert_allclose(limit[[0, 2, 6, 8]], x[[0, 2, 6, 8]])
    assert_allclose(limit[1], (4 * x[1] + x[0] + x[2]) / 6)
    quad = 16 * x[4] + 4 * (x[1] + x[3] + x[5] + x[7]) + x[0] + x[2] + x[6] + x[8]
    assert_allclose(limit[4], quad / 36)


def test_every_quad_of_a_step_runs_as_its_face_does() -> None:
    faces, flat = grid(3)
    quads, _, where = _subdivide(faces, flat, flat)
    assert len(quads) == 16
    corner = where[np.array(quads)]
    x, y = corner[..., 0], corner[..., 1]
    areas = 0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
    assert_allclose(areas, 0.25)
    five = [[0, 1, 2, 3, 4]]
    _, _, where = _subdivide(five, np.eye(5), np.zeros((5, 2)))
    assert np.isnan(where[-1]).all() and (where[:-1] == 0).all()  # only the middle of a quad is a place


def test_the_missing_part_at_a_corner_is_the_mean_of_what_both_sides_lack() -> None:
    after, before = np.array([[2.0], [9.0]]), np.array([[9.0], [4.0]])
    assert [_corner(*pair).tolist() for pair in ((after, before), (after, None), (None, before), (None, None))] == [
        [3.0], [2.0], [4.0], [0.0],
    ]  # fmt: skip


def test_all_four_sides_are_met_in_their_order_round_the_face() -> None:
    rng = np.random.default_rng(5)
    limit = rng.normal(size=(COUNT, COUNT, 2))
    corners = rng.normal(size=(4, 2))
    t = np.linspace(0.0, 1.0, COUNT)[:, None]
    sides = [(1 - t) * corners[k] + t * corners[(k + 1) % 4] + t * (1 - t) * rng.normal(size=2) for k in range(4)]
    moved = _correct_sides(limit, sides)
    assert_allclose(moved[:, 0], sides[0], atol=1e-12)
    assert_allclose(moved[-1], sides[1], atol=1e-12)
    assert_allclose(moved[::-1, -1], sides[2], atol=1e-12)
    assert_allclose(moved[0, ::-1], sides[3], atol=1e-12)
    flat = _correct_sides(np.zeros((COUNT, COUNT, 2)), [None] * 4)
    assert not flat.any()
    raised = _correct_sides(np.zeros((COUNT, COUNT, 1)), [np.ones((COUNT, 1))] * 4)
    assert_allclose(raised, 1.0)


def star_mesh(lengths: list[float]) -> SimpleNamespace:
    """As much of a mesh as its sides are sampled by: link k lies on edge k, and its opposite has the number 100 + k."""
    links = {k: SimpleNamespace(edge=k, opposite=100 + k, turn=0) for k in range(len(lengths))}
    return SimpleNamespace(file=SimpleNamespace(links=links, edges=dict(enumerate(lengths))))


def test_a_side_of_several_links_is_sampled_by_their_lengths_against_their_opposites() -> None:
    mesh = star_mesh([1.0, 3.0])
    asked: list[tuple[int, int]] = []

    def along(link: int, count: int) -> list[dict[int, float]]:
        asked.append((link, count))
        return [{link: k / (count - 1)} for k in range(count)]

    found = _side(mesh, [0, 1], along)  # type: ignore[arg-type]
    assert asked == [(100, 129), (101, 129)] and found is not None
    t = np.linspace(0.0, 4.0, COUNT)
    wanted = [(100, 1.0 - x) if x < 1.0 else (101, 1.0 - (x - 1.0) / 3.0) for x in t]
    assert [next(iter(row)) for row in found] == [link for link, _ in wanted]
    assert_allclose([next(iter(row.values())) for row in found], [share for _, share in wanted], atol=0.5 / 128)
    assert _side(mesh, [0, 1], lambda link, count: None if link == 101 else along(link, count)) is None  # type: ignore[arg-type]


def test_shares_of_a_side_stand_in_the_columns_of_their_grips() -> None:
    found = _rows([{7: 0.25, 3: 0.75}, {3: 1.0}], {3: 0, 5: 1, 7: 2})
    assert found is not None and found.tolist() == [[0.75, 0.0, 0.25], [1.0, 0.0, 0.0]]
    assert _rows(None, {3: 0}) is None


def test_sides_begin_at_the_links_that_turn() -> None:
    mesh = star_mesh([1.0] * 5)
    mesh.file.links[2].turn = 1  # a T-junction within the second side
    mesh.loops = {9: [0, 1, 2, 3, 4]}
    found = _sides(mesh, 9, lambda link, count: [{link: 1.0}] * count)  # type: ignore[arg-type]
    assert [{grip for row in side or [] for grip in row} for side in found] == [{100}, {101, 102}, {103}, {104}]
