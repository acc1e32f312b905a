"""What Eq. (2) refuses, and that it never drifts: other meshes, and numbers beyond those of 32 bits."""

from __future__ import annotations

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
    with pytest.raises(ValueError, match=r"(delta|xyz)\[1\]: must be (finite, got|within the range of 32-bit numbers)"):
        change([5, 6], [[1.0, 0, 0], [0, bad, 0]])
    assert np.array_equal(deformation.points, points) and deformation.changed == ranges
    assert np.array_equal(deformation.vertices, before)
    deformation.refresh()
    assert np.allclose(deformation.vertices, before, rtol=0, atol=1e-5)


def test_moves_that_lead_beyond_32_bit_numbers_are_refused_one_by_one(sheet: tuple[DCPSurface, Mesh]) -> None:
    deformation = sheet[0].deformation(sheet[1])
    deformation.move([30], [[2e38, 0, 0]])
    with pytest.raises(ValueError, match=r"delta\[0\]"):
        deformation.move([30], [[2e38, 0, 0]])
    assert deformation.points[30, 0] == pytest.approx(2e38)
    deformation.set_points(sheet[0].points)
    assert off(deformation) < 1e-6 and np.isfinite(deformation.normals).all()


@settings(max_examples=12, deadline=None, derandomize=True)  # weights of 5 at 1e38 overflow float32: seed 5597
@given(st.integers(0, 10_000))
@example(66)  # everything is put back from 1e38 at once
def test_no_history_of_moves_leaves_a_trace(sheet: tuple[DCPSurface, Mesh], seed: int) -> None:
    surface, mesh = sheet
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    for _ in range(25):
        some = rng.choice(surface.n, int(rng.integers(1, 9)), replace=False)
        far = 10.0 ** rng.choice([-3, 0, 2, 7.08, 20, 38])
        kind = int(rng.integers(4))
        if kind == 0:
            deformation.set_positions(some, rng.uniform(-far, far, (len(some), 3)))
        elif kind == 1:
            deformation.set_positions(some, surface.points[some])
        elif kind == 2:
            deformation.set_weights(some, rng.uniform(0.2, 5.0, len(some)))
        else:
            deformation.move(some, np.clip(rng.normal(0, min(far, 1e37), (len(some), 3)), -5e37, 5e37))
        assert off(deformation) < 1e-6
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
