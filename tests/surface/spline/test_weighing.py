"""Weights by cell against scipy's B-splines, on closed surfaces too."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.interpolate import BSpline

from surface import DCPSurface, Domain, Mesh, Slit
from surface.deform.lists import Basis, Lists, build_lists, write_rows
from surface.spline import weighing
from surface.spline.blends import blend1


def weighted_torus() -> DCPSurface:
    """A torus whose control points all have other weights."""
    torus = shapes.torus()
    weights = np.random.default_rng(3).uniform(0.5, 2, torus.n)
    return DCPSurface(torus.points, weights, torus.knots_u, torus.knots_v, closed_u=(0, 1), closed_v=(0, 1))


def blending(knots: np.ndarray, x: np.ndarray, periods: range, order: int = 0) -> np.ndarray:
    """A B-spline of scipy, summed over shifts by whole periods of 1."""
    element = BSpline.basis_element(knots, extrapolate=True)
    total = np.zeros(len(x))
    for k in periods:
        at = x - k
        total += np.where((at >= knots[0]) & (at < knots[-1]), element(at, order), 0.0)
    return total


def dense(lists: Lists, n: int, vertices: int) -> np.ndarray:
    """(3, vertices, n): b w, b_u w and b_v w of all points, copies added to their points."""
    out = np.zeros((3, vertices, n))
    for c in range(len(lists.rows)):
        first, last = lists.cell_start[c], lists.cell_start[c + 1]
        room, at = int(lists.room[c]), int(lists.at[c])
        size = (lists.tile_start[c + 1] - lists.tile_start[c]) * room * 8
        value = lists.value[at : at + size].reshape(-1, room, 8)
        slope = lists.slope[2 * at : 2 * (at + size)].reshape(-1, room, 2, 8)
        for row in range(int(lists.rows[c])):
            i = int(lists.ids[lists.ids_at[c] + row]) % n
            kinds = (value[:, row], slope[:, row, 0], slope[:, row, 1])
            for kind, numbers in enumerate(kinds):
                assert (numbers.ravel()[last - first :] == 0).all()
                out[kind, first:last, i] += numbers.ravel()[: last - first]
    return out


def expected(surface: DCPSurface, mesh: Mesh, i: int, periods: range) -> list[np.ndarray]:
    u, v = mesh.uv.T
    a, b = surface.knots_u[i], surface.knots_v[i]
    orders = ((0, 0), (1, 0), (0, 1))
    return [surface.weights[i] * blending(a, u, periods, k) * blending(b, v, periods, m) for k, m in orders]


@pytest.mark.parametrize("name", ["closed", "open"])
def test_weights_are_products_of_scipys_splines(name: str) -> None:
    closed = name == "closed"
    surface = weighted_torus() if closed else shapes.scattered(30, 2, degrees=(2, 5))
    mesh = surface.tessellate(chord_error=0.5, max_depth=3, domain=Domain((0, 1, 0, 1)))
    assert not mesh.side.any()
    found = dense(build_lists(surface, mesh, True), surface.n, len(mesh.uv))
    for i in range(surface.n):
        for kind, numbers in enumerate(expected(surface, mesh, i, range(-3, 4) if closed else range(1))):
            scale = max(1.0, np.abs(numbers).max())
            assert np.allclose(found[kind, :, i], numbers, rtol=0, atol=1e-6 * scale), (i, kind)


def test_vertices_on_a_slit_take_their_own_side() -> None:
    surface = shapes.torn()
    mesh = surface.tessellate(min_depth=2, domain=Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, 0.25, 0.75)]))
    lists = build_lists(surface, mesh, True)
    found, half = dense(lists, surface.n, len(mesh.uv))[0], surface.n // 2
    on = (mesh.uv[:, 1] == 0.5) & (mesh.uv[:, 0] > 0.25) & (mesh.uv[:, 0] < 0.75)
    low, high = on & (mesh.side == 2), on & (mesh.side == 0)
    assert low.any() and high.any()
    assert np.allclose(found[low, :half].sum(axis=1), 1, atol=1e-6) and (found[low, half:] == 0).all()
    assert np.allclose(found[high, half:].sum(axis=1), 1, atol=1e-6) and (found[high, :half] == 0).all()


def test_rows_written_again_are_those_of_the_lists_and_say_where_they_vanish() -> None:
    surface = weighted_torus()
    mesh = surface.tessellate(chord_error=0.5, max_depth=3)
    lists, basis = build_lists(surface, mesh, True), Basis.of(surface)
    before = lists.value.copy(), lists.slope.copy()
    every = np.arange(len(lists.rows))
    for i in range(len(basis.weights)):
        cells, rows = lists.entries_of(i)
        assert write_rows(basis, lists, mesh, i, cells, rows).all()
        places = np.full(len(every), -1, dtype=np.int64)
        assert np.array_equal(write_rows(basis, lists, mesh, i, every, places), np.isin(every, cells))
    assert np.array_equal(lists.value, before[0]) and np.array_equal(lists.slope, before[1])
    basis.weights *= 2
    for i in range(len(basis.weights)):
        write_rows(basis, lists, mesh, i, *lists.entries_of(i))
    assert np.allclose(lists.value, 2 * before[0], rtol=1e-6) and np.allclose(lists.slope, 2 * before[1], rtol=1e-6)


@pytest.mark.parametrize("degree", [0, 1, 3, 9])
def test_what_surely_reaches_a_place_has_a_weight_there_however_uneven_its_knots_are(degree: int) -> None:
    """Knots that lie at either end but for one, and any number of them at each end."""
    for low in range(1, degree + 2):
        knots = np.array([[0.0] * low + [1.0] * (degree + 2 - low)])
        for x in (0.0, 2e-9, 0.3, 1.0 - 2e-9, 1.0):
            surely = weighing._surely_reaches(knots, knots, 0, np.array([[x, x]]))
            assert surely == (0.0 < x < 1.0)
            if surely:
                assert float(BSpline.basis_element(knots[0], extrapolate=False)(x)) > 1e-90
                assert blend1(knots, 0, degree, x, 0, np.zeros(12))[0] > 1e-90


def test_marks_are_those_of_the_weights_themselves() -> None:
    surface = shapes.scattered(60, 4, degrees=(1, 4))
    mesh = surface.tessellate(chord_error=0.5, max_depth=3, domain=Domain((0, 1, 0, 1)))
    cells = len(mesh.cell_start) - 1
    ids = np.tile(np.arange(surface.n, dtype=np.int32), cells)
    reach = np.zeros(len(ids), np.bool_)
    weighing.mark_reaching(
        *surface.arrays()[:4], mesh.uv.copy(), mesh.side.copy(), mesh.cell_start.copy(),
        surface.n * np.arange(cells + 1), ids, reach,
    )  # fmt: skip
    for i in range(surface.n):
        kinds = [np.abs(kind) > 0 for kind in expected(surface, mesh, i, range(1))]
        any_kind = np.logical_or.reduceat(kinds[0] | kinds[1] | kinds[2], mesh.cell_start[:-1])
        np.testing.assert_array_equal(reach.reshape(cells, -1)[:, i], any_kind)
