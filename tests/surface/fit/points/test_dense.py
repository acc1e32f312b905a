"""Errors of a fitted chart between its samples, against the surface evaluated by itself, and spikes taken back."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from small_head import sheet

from surface.fit.points.dense import around, bounded, dense_errors, places_of
from surface.fit.points.net import Net
from surface.fit.source.chart import Places

RNG = np.random.default_rng(0)
SURFACE = sheet(0.0)
NET = Net(np.zeros((SURFACE.n, 4), np.int64), *SURFACE.padded)
UV = RNG.uniform(0, 1, (30, 2))
MIX = csr_matrix(RNG.dirichlet(np.ones(3), 30).ravel().repeat(1).reshape(30, 3) @ np.eye(3, 12))


def case(moves: int = 2, folded=()):
    """A mesh of twelve vertices that the first three mix, a chart with places between, and random displacements."""
    flags = np.zeros(30, bool)
    flags[list(folded)] = True
    mesh = SimpleNamespace(vertices=RNG.normal(size=(12, 3)) * 9, deltas=RNG.normal(size=(moves, 12, 3)))
    chart = SimpleNamespace(between=Places(UV, MIX, UV, flags))
    return mesh, chart, RNG.normal(size=(moves, SURFACE.n, 3))


def test_errors_are_distances_between_mesh_and_surface_and_the_worst_shape_is_named() -> None:
    mesh, chart, moves = case(3, folded=[4])
    found = dense_errors(mesh, chart, NET, SURFACE.points, moves)
    wanted = np.linalg.norm(SURFACE.evaluate(UV) - MIX @ mesh.vertices, axis=1)
    wanted[4] = 0.0
    np.testing.assert_allclose(found.neutral, wanted, atol=1e-9)
    rest = SURFACE.evaluate(UV)
    off = np.stack([
        np.linalg.norm(SURFACE.with_points(SURFACE.points + m).evaluate(UV) - rest - MIX @ d, axis=1)
        for m, d in zip(moves, mesh.deltas, strict=True)
    ])  # fmt: skip
    np.testing.assert_allclose(found.worst, off.max(axis=0), atol=1e-9)
    np.testing.assert_array_equal(found.shape, off.argmax(axis=0))
    assert found.most == pytest.approx(max(wanted.max(), off.max()))


def test_without_shapes_or_places_there_are_no_errors_of_them() -> None:
    mesh, chart, moves = case(0)
    found = dense_errors(mesh, chart, NET, SURFACE.points, moves)
    assert (found.worst == 0).all() and (found.shape == -1).all() and found.most == found.neutral.max()
    none = SimpleNamespace(between=None)
    assert places_of(none, mesh).mix.shape == (0, 12) and places_of(chart, mesh) is chart.between
    assert dense_errors(mesh, none, NET, SURFACE.points, moves).most == 0.0


def test_places_around_others_share_a_vertex_with_them() -> None:
    mix = csr_matrix(np.array([[0.5, 0.5, 0, 0], [0, 0.3, 0.7, 0], [0, 0, 0, 1.0]]))
    places = Places(np.zeros((3, 2)), mix, np.zeros((3, 2)), np.zeros(3, bool))
    assert around(places, mix[[0]]).tolist() == [True, True, False]
    still = dense_errors(*case(2)[:2], NET, SURFACE.points, np.zeros((0, SURFACE.n, 3)))
    assert (still.shape == -1).all()
    assert around(places, mix[[2]]).tolist() == [False, False, True]
    assert not around(places, mix[[0]][:0]).any()


def test_points_that_reach_a_stray_place_come_into_the_range_of_the_mesh_around_it() -> None:
    mesh, chart, moves = case(2)
    points = SURFACE.points.copy()
    reach = np.asarray(SURFACE.basis_matrix(UV).todense())
    spike = int((reach**2).sum(axis=0).argmin())
    points[spike] += [0.0, 0.0, 500.0]
    moves[:, spike] *= 200.0
    strays = np.arange(30) == reach[:, spike].argmax()
    assert reach[strays, spike] > 0
    new, new_moves = bounded(mesh, chart, NET, points, moves, strays)
    at, length = MIX @ mesh.vertices, np.stack([np.linalg.norm(MIX @ d, axis=1) for d in mesh.deltas])
    for i in range(SURFACE.n):
        rows = reach[:, i] > 0
        if not reach[strays, i].any():
            np.testing.assert_array_equal(new[i], points[i])
            np.testing.assert_array_equal(new_moves[:, i], moves[:, i])
            continue
        np.testing.assert_allclose(new[i], np.clip(points[i], at[rows].min(axis=0), at[rows].max(axis=0)))
        most, own = length[:, rows].max(axis=1), np.linalg.norm(moves[:, i], axis=1)
        np.testing.assert_allclose(np.linalg.norm(new_moves[:, i], axis=1), np.minimum(own, most))
        np.testing.assert_allclose(np.cross(new_moves[:, i], moves[:, i]), 0.0, atol=1e-9)
    assert points[spike, 2] > 400 and np.abs(moves[:, spike]).max() > 50  # what was given is not changed


def test_a_chart_without_shapes_is_bounded_too() -> None:
    mesh, chart, moves = case(0)
    new, none = bounded(mesh, chart, NET, SURFACE.points + 900.0, moves, np.ones(30, bool))
    assert none.shape == moves.shape and (new <= (MIX @ mesh.vertices).max(axis=0) + 1e-9).all()
