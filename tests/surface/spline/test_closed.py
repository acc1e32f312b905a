"""Closed directions: rings and tori without a seam."""

from __future__ import annotations

import numpy as np
import pytest

from surface import DCPSurface, Domain
from surface.spline.closed import check_closed, shifts_of, wrap
from tests.surface import shapes
from tests.surface.shapes import ROUND, torus, uniform


def neck() -> DCPSurface:
    """Closed around u, open along v."""
    a, heights = 2 * np.pi * np.arange(ROUND) / ROUND, np.linspace(0, 50, 6)
    points = np.stack(np.broadcast_arrays(20 * np.cos(a)[:, None], heights, 20 * np.sin(a)[:, None]), axis=-1)
    knots = np.lib.stride_tricks.sliding_window_view([0, 0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1, 1], 5)
    return DCPSurface(
        points.reshape(-1, 3),
        np.ones(ROUND * 6),
        np.repeat(uniform(ROUND), 6, axis=0),
        np.tile(knots, (ROUND, 1)),
        closed_u=(0, 1),
    )


def test_evaluation_goes_around() -> None:
    surface = torus()
    uv = np.random.default_rng(0).uniform(0, 1, (60, 2))
    for turn in ([1, 0], [0, -2], [3, 1]):
        assert np.allclose(surface.evaluate(uv + turn), surface.evaluate(uv), rtol=0, atol=1e-11)
    matrix = surface.basis_matrix(uv)
    assert matrix.shape == (60, surface.n)
    assert matrix.getnnz(axis=1).max() == 16
    assert np.allclose(matrix @ surface.points, surface.evaluate(uv), rtol=0, atol=1e-12)
    assert np.allclose(matrix.sum(axis=1), 1)


def test_the_seam_is_smooth() -> None:
    surface, h = torus(), 1e-9
    before, after = surface.derivatives([[1 - h, 0.3], [0.3, 1 - h]]), surface.derivatives([[0, 0.3], [0.3, 0]])
    for one, other in zip(before, after, strict=True):
        assert np.allclose(one, other, rtol=0, atol=1e-4)


@pytest.mark.parametrize("error", [1.0, 0.1])
def test_a_torus_has_no_border_and_one_handle(error: float) -> None:
    mesh = torus().tessellate(chord_error=error)
    shapes.check_manifold(mesh)
    edges, uses = shapes.edge_uses(mesh.triangles)
    assert (uses == 2).all()
    assert len(mesh.vertices) - len(edges) + len(mesh.triangles) == 0
    assert len(np.unique(np.round(mesh.vertices, 9), axis=0)) == len(mesh.vertices)


def test_a_neck_has_two_rims() -> None:
    mesh = neck().tessellate(chord_error=0.05)
    shapes.check_manifold(mesh)
    rim = shapes.border(mesh)
    assert np.isin(mesh.uv[rim][:, :, 1], [0, 1]).all()
    assert len(mesh.vertices) - len(shapes.edge_uses(mesh.triangles)[0]) + len(mesh.triangles) == 0
    radius = np.linalg.norm(mesh.vertices[:, [0, 2]], axis=1)
    assert np.ptp(radius) < 0.1


def test_a_part_of_a_ring_stays_open() -> None:
    mesh = neck().tessellate(chord_error=0.2, domain=Domain((0.1, 0.6, 0, 1)))
    assert len(shapes.border(mesh)) > 0
    assert len(mesh.vertices) - len(shapes.edge_uses(mesh.triangles)[0]) + len(mesh.triangles) == 1


def test_updates_act_on_both_sides_of_the_seam() -> None:
    surface = torus()
    mesh = surface.tessellate(chord_error=0.2)
    deformation = surface.deformation(mesh)
    rng = np.random.default_rng(1)
    for _ in range(10):
        deformation.move(rng.integers(0, surface.n, 5), rng.normal(size=(5, 3)))
    deformation.move([0], [[0.0, 0.0, 9.0]])
    deformation.set_weights([0, 3, 60], [2.0, 0.5, 3.0])
    deformation.set_knots(0, surface.knots_u[0] * 1.2, surface.knots_v[0])
    now = deformation.surface
    assert now.n == surface.n
    assert np.abs(deformation.vertices - now.evaluate(mesh.uv, side=mesh.side)).max() < 1e-4
    assert np.array_equal(deformation.points, now.points)
    moved = np.abs(deformation.vertices - mesh.vertices).max(axis=1) > 1
    assert (mesh.uv[moved, 0] > 0.9).any()
    assert (mesh.uv[moved, 0] < 0.1).any()
    with pytest.raises(ValueError, match=r"ids\[0\]"):
        deformation.move([surface.n], np.zeros((1, 3)))


def test_knots_put_in_across_the_seam() -> None:
    surface = torus()
    uv = np.random.default_rng(2).uniform(0, 1, (80, 2))
    for made in (surface.insert_knot("u", 0.01), surface.refine((0.95, 1.05, 0.4, 0.6))):
        assert made.surface.n > surface.n
        assert made.surface.closed == surface.closed
        assert np.allclose(made.surface.evaluate(uv), surface.evaluate(uv), rtol=0, atol=1e-11)


def test_wrapping() -> None:
    uv = np.array([[0.0, 5.0], [1.0, -3.0], [-0.25, 0.5], [2.5, 0.0]])
    assert wrap(uv, ((0.0, 1.0), None))[:, 0].tolist() == [0.0, 0.0, 0.75, 0.5]
    assert wrap(uv, (None, None)) is uv
    with pytest.raises(ValueError, match="closed_v"):
        DCPSurface([[0, 0, 0]], [1], [[0, 1]], [[0, 1]], closed_v=(1, 0))


@pytest.mark.parametrize("closed", [(0, 1e-3), (1000, 1001), (0,), "ab"])
def test_periods_that_fit_no_surface_are_refused(closed: object) -> None:
    with pytest.raises(ValueError, match=r"closed_u: (knots reach|needs)"):
        DCPSurface([[0, 0, 0]], [1], [[0, 1]], [[0, 1]], closed_u=closed)  # type: ignore[arg-type]


def test_shifts_cover_both_neighbours_and_as_many_periods_as_knots_reach() -> None:
    inside, far, behind = np.array([[0.2, 0.8]]), np.array([[0.2, 2.7], [1.5, 3.1]]), np.array([[-0.8, -0.2]])
    open_ = shifts_of((inside, inside), (None, None))
    assert open_.tolist() == [[0, 0]]
    assert shifts_of((inside, far), ((0.0, 1.0), None)).tolist() == [[0, 0], [-1, 0], [1, 0]]
    assert shifts_of((behind, inside), ((0.0, 1.0), None)).tolist() == [[0, 0], [-1, 0], [1, 0], [2, 0]]
    assert shifts_of((far - 0.2, inside), ((0.0, 1.0), None))[:, 0].tolist() == [0, -3, -2, -1, 1]
    assert shifts_of((far + 3, inside), ((3.0, 4.0), None))[:, 0].tolist() == [0, -4, -3, -2, -1, 1]
    both = shifts_of((inside, 2 * inside), ((0.0, 1.0), (0.0, 2.0)))
    assert both.tolist() == [[u, v] for u in (0, -1, 1) for v in (0, -2, 2)]


def test_knots_reach_over_a_limited_number_of_periods() -> None:
    row = np.array([[0.0, 16.0]])
    assert len(shifts_of((row, row), ((0.0, 1.0), None))) > 16
    with pytest.raises(ValueError, match=r"closed_v: knots reach over 16\.5, more than 16 periods of 1"):
        shifts_of((row, np.array([[-0.5, 16.0]])), (None, (0.0, 1.0)))


def test_samples_are_wrapped_into_the_interval() -> None:
    uv = np.array([[2.0, 5.0], [3.0, -5.0], [4.0, 0.0], [-1.5, 1.0]])
    assert wrap(uv, ((2.0, 4.0), None)).tolist() == [[2, 5], [3, -5], [2, 0], [2.5, 1]]
    assert wrap(uv, (None, None)) is uv
    assert wrap(np.array([[-1e-18, 0.0]]), ((0.0, 1.0), None))[0, 0] == 0  # rounded to the end, which is the start


@pytest.mark.parametrize(
    ("closed", "message"),
    [
        (((1.0, 1.0), None), r"closed_u: needs finite start < end"),
        ((None, (0.0, np.inf)), r"closed_v: needs finite start < end"),
        (((0.0, "x"), None), r"closed_u: needs \(start, end\)"),
        ((None, (1.0,)), r"closed_v: needs \(start, end\)"),
    ],
)
def test_bad_intervals_are_named(closed: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check_closed(closed)


def test_points_far_outside_the_interval_take_other_knots_with_all_copies() -> None:
    torus = torus_one_period_on()
    mesh = torus.tessellate(chord_error=0.5)
    deformation = torus.deformation(mesh)
    assert sorted(set(torus.shifts[:, 0].tolist())) == [-3, -2, -1, 0, 1]
    for i in (0, 60, torus.n - 1):
        deformation.set_knots(i, torus.knots_u[i] * 1.05, torus.knots_v[i] + 0.05)
        deformation.set_weights([i], [2.0])
        deformation.move([i], [[1.0, 2.0, 3.0]])
        expected = deformation.surface.evaluate(mesh.uv, side=mesh.side)
        assert np.abs(deformation.vertices - expected).max() < 1e-4


def torus_one_period_on() -> DCPSurface:
    """The torus with knots one period further in u: the copies that reach the interval lie on one side."""
    ring = torus()
    knots_u = [knots + 1 for knots in ring.knots_u]
    return DCPSurface(ring.points, ring.weights, knots_u, ring.knots_v, closed_u=(0, 1), closed_v=(0, 1))
