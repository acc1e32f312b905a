"""What Eq. (2) refuses, and that it never drifts: other meshes, and numbers beyond those of 32 bits."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from surface import DCPSurface, Domain, Mesh
from surface.deform.deformation import Deformation
from tests.surface import shapes


@pytest.fixture(scope="module")
def sheet() -> tuple[DCPSurface, Mesh]:
    surface = shapes.hills(12)
    return surface, surface.tessellate(chord_error=1.0)


def tilt(deformation: Deformation[DCPSurface]) -> float:
    """The greatest difference from normals by derivatives in float64, relative to each other to stay in its range."""
    mesh, surface = deformation.mesh, deformation.surface
    along = [d / np.abs(d).max(axis=1, keepdims=True) for d in surface.derivatives(mesh.uv, mesh.side)[1:]]
    cross = np.cross(*along)
    return float(np.abs(deformation.normals - cross / np.linalg.norm(cross, axis=1, keepdims=True)).max())


def off(deformation: Deformation[DCPSurface]) -> float:
    """The greatest distance from a fresh evaluation, as a part of the surface's size."""
    mesh, surface = deformation.mesh, deformation.surface
    size = float(np.ptp(surface.points, axis=0).max())
    return float(np.abs(deformation.vertices - surface.evaluate(mesh.uv, mesh.side)).max()) / size


def test_a_mesh_of_another_surface_with_as_many_points_is_refused(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    flat = shapes.hills(12, degree=2)
    assert flat.n == surface.n
    with pytest.raises(ValueError, match="mesh: was made from another surface, with other knots: tessellate this one"):
        flat.deformation(mesh)
    ring = DCPSurface(surface.points, surface.weights, surface.knots_u, surface.knots_v, closed_u=(0.0, 1.0))
    with pytest.raises(ValueError, match="another surface"):
        surface.deformation(ring.tessellate(chord_error=2.0))
    moved = surface.deformation(mesh)
    moved.set_knots(40, surface.knots_u[40] + 0.01, surface.knots_v[40])
    with pytest.raises(ValueError, match="another surface"):
        moved.surface.deformation(mesh)


def test_a_mesh_serves_surfaces_that_differ_in_points_and_weights_only(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    other = DCPSurface(surface.points[::-1], 2 + np.sin(np.arange(surface.n)), surface.knots_u, surface.knots_v)
    assert off(other.deformation(mesh)) < 1e-6
    wider = DCPSurface.from_padded(
        surface.points, surface.weights, *(np.hstack([k, k[:, -1:]]) for k in surface.padded), *surface.degrees
    )
    assert wider.structure == surface.structure
    wider.deformation(mesh)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e39, -1e308])
@pytest.mark.parametrize("relative", [True, False])
def test_places_that_32_bit_numbers_do_not_have_are_refused(
    sheet: tuple[DCPSurface, Mesh], bad: float, relative: bool
) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.move([3], [[0.0, 0.0, 1.0]])
    before, points, ranges = deformation.vertices.copy(), deformation.points.copy(), deformation.changed
    change = deformation.move if relative else deformation.set_positions
    with pytest.raises(ValueError, match=r"(delta|xyz)\[1\]: must be (finite, got|within .* range of 32-bit numbers)"):
        change([5, 6], [[1.0, 0, 0], [0, bad, 0]])
    assert np.array_equal(deformation.points, points) and deformation.changed == ranges
    assert np.array_equal(deformation.vertices, before)
    deformation.refresh()
    assert np.allclose(deformation.vertices, before, rtol=0, atol=1e-5)


def test_moves_that_lead_beyond_32_bit_numbers_are_refused_one_by_one(sheet: tuple[DCPSurface, Mesh]) -> None:
    deformation = sheet[0].deformation(sheet[1])
    deformation.move([30], [[2e31, 0, 0]])
    for further in (2e38, 2e34):
        with pytest.raises(ValueError, match=r"delta\[0\]: must be within [1-9][.\d]*e\+3[12], and lead"):
            deformation.move([30], [[further, 0, 0]])
    assert deformation.points[30, 0] == pytest.approx(2e31)
    assert off(deformation) < 1e-6
    deformation.set_points(sheet[0].points)
    assert off(deformation) < 1e-6 and np.isfinite(deformation.normals).all()


def test_weights_and_knots_that_lead_beyond_32_bit_numbers_are_refused_and_change_nothing(
    sheet: tuple[DCPSurface, Mesh],
) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.move([30], [[2e31, 0, 0]])
    before, farthest = deformation.vertices.copy(), r"points are up to 2e\+31 away from 0.* beyond [.\d]+e\+(2[6-9]|30)"
    with pytest.raises(ValueError, match="weights: " + farthest):
        deformation.set_weights([100], [1e7])
    u, at = surface.knots_u[100], mesh.uv[np.abs(mesh.uv[:, 0] - surface.knots_u[100][2]).argmin(), 0]
    steep = [at, at, at, at, at + 1e-9]
    with pytest.raises(ValueError, match="knots_u, knots_v: " + farthest):
        deformation.set_knots(100, steep, surface.knots_v[100])
    assert deformation.basis.weights[100] == 1.0 and np.array_equal(deformation.basis.knots[0][100, : len(u)], u)
    deformation.refresh()
    assert np.isfinite(deformation.vertices).all() and off(deformation) < 1e-6
    np.testing.assert_allclose(deformation.vertices, before, rtol=1e-6, atol=1e25)
    deformation.move([30], [[2e31, 0, 0]])
    with pytest.raises(ValueError, match=r"mesh: points are up to 3e\+38 away"):
        DCPSurface(surface.points + 3e38, surface.weights, surface.knots_u, surface.knots_v).deformation(mesh)


def test_normals_of_places_far_away_are_those_of_the_surface(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    for scale in (1.0, 1e5, 1e10, 1e25, 1e29):
        scaled = DCPSurface(scale * surface.points, surface.weights, surface.knots_u, surface.knots_v)
        assert tilt(scaled.deformation(mesh)) < 1e-4


def test_a_surface_keeps_its_digits_while_it_shrinks_slowly_and_when_it_comes_from_far_away(
    sheet: tuple[DCPSurface, Mesh],
) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.set_points(surface.points + 1e9 * np.arange(surface.n)[:, None])
    for step in range(45):  # to 0.6 of the size each time, and towards the place where it was
        deformation.set_points(surface.points + 1e9 * 0.6**step * np.arange(surface.n)[:, None])
        assert off(deformation) < 1e-6
    away = surface.points + 1e7
    deformation.set_points(away + 1e5 * np.arange(surface.n)[:, None])
    deformation.set_points(away)
    deformation.set_points(surface.points)
    assert off(deformation) < 1e-6
    other = DCPSurface(away, surface.weights, surface.knots_u, surface.knots_v)
    assert off(surface.deformation(other.tessellate(roots=(2, 2), max_depth=3))) < 1e-6


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1))
@example(66)  # everything is put back from far away at once
@example(5597)  # weights of 5 at 1e38 were beyond float32
def test_no_history_of_moves_leaves_a_trace(sheet: tuple[DCPSurface, Mesh], seed: int) -> None:
    surface, mesh = sheet
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    for _ in range(25):
        some = rng.choice(surface.n, int(rng.integers(1, 9)), replace=False)
        far = 10.0 ** rng.choice([-3, 0, 2, 7.08, 20, 34.5, 38])
        kind = int(rng.integers(4))
        with suppress(ValueError):  # too far away, or too heavy for how far points are: nothing changes then
            if kind == 0:
                deformation.set_positions(some, rng.uniform(-far, far, (len(some), 3)))
            elif kind == 1:
                deformation.set_positions(some, surface.points[some])
            elif kind == 2:
                deformation.set_weights(some, rng.uniform(0.2, 5.0, len(some)))
            else:
                deformation.move(some, rng.normal(0, far, (len(some), 3)))
        assert off(deformation) < 1e-6 and np.isfinite(deformation.normals).all()
    deformation.set_points(surface.points)
    assert off(deformation) < 1e-6


def test_changes_that_would_leave_nothing_at_a_vertex_are_refused_and_change_nothing() -> None:
    along, across = [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 2.0, 2.0]], [0.0, 0.5, 1.0, 1.5, 2.0]
    thin = DCPSurface([[0.0, 0, 0], [1, 0, 0]], [1, 1], along, [across] * 2)
    edge = Domain((0.0, 1.0, 0.0, 1 / 64))  # to where all weights end, at v = 0
    mesh = thin.tessellate(roots=(2, 2), min_depth=5, max_depth=5, domain=edge)
    moving = thin.deformation(mesh)
    moving.set_weights([0, 1], [1e-18, 2e-18])
    before, value = moving.vertices.copy(), np.sort(moving.lists.value[: moving.lists.used])
    message = r"at vertex \d+ of the mesh \(u = [\d.e+-]+, v = [\d.e+-]+\) the weights .* nearly nothing"
    with pytest.raises(ValueError, match="weights: " + message):
        moving.set_weights([1, 0, 0], [2e-30, 1.0, 1e-30])
    with pytest.raises(ValueError, match="mesh: " + message):
        DCPSurface(thin.points, [1e-30, 1e-30], along, [across] * 2).deformation(mesh)
    with pytest.raises(ValueError, match="knots_u, knots_v: " + message):  # alone at u = 0, where it now nearly ends
        moving.set_knots(0, [-2.0, -1.0, -0.5, 1e-9], across)
    assert moving.basis.weights.tolist() == [1e-18, 2e-18]
    assert np.array_equal(np.sort(moving.lists.value[: moving.lists.used]), value)
    moving.refresh()
    assert np.allclose(moving.vertices, before, rtol=0, atol=1e-6) and off(moving) < 1e-6
