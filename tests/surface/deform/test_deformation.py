"""Eq. (2): a mesh that follows its control points, the same as a fresh evaluation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surface import DCPSurface, Domain, Mesh, Slit
from surface.deform.deformation import Deformation
from tests.surface import shapes

SIZE = 100.0


def fresh(deformation: Deformation[DCPSurface]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, normals and sizes of S_u x S_v of the deformation's surface at the moment, in float64."""
    mesh, surface = deformation.mesh, deformation.surface
    points, su, sv = surface.derivatives(mesh.uv, side=mesh.side)
    normals = np.cross(su, sv)
    size = np.linalg.norm(normals, axis=1)
    return points, normals / size[:, None] * (-1 if mesh.flip else 1), size


def check(deformation: Deformation[DCPSurface]) -> None:
    points, normals, size = fresh(deformation)
    assert np.abs(deformation.vertices - points).max() < 1e-6 * SIZE
    error = np.abs(deformation.normals - normals).max(axis=1)
    assert (error * np.minimum(1, size / np.median(size))).max() < 2e-4  # random moves fold the sheet here and there


def interior(surface: DCPSurface, i: int) -> int:
    """A point near i that is not the only one at a rim of the sheet."""
    side = int(np.sqrt(surface.n))
    row, column = np.clip([i // side, i % side], 1, side - 2)
    return int(row * side + column)


@pytest.fixture(scope="module")
def sheet() -> tuple[DCPSurface, Mesh]:
    surface = shapes.hills()
    return surface, surface.tessellate(chord_error=0.1)


@pytest.mark.parametrize("flip", [False, True])
def test_starts_as_the_mesh(flip: bool) -> None:
    surface = shapes.hills()
    mesh = surface.tessellate(chord_error=0.3, flip=flip)
    deformation = surface.deformation(mesh)
    assert np.allclose(deformation.vertices, mesh.vertices, rtol=0, atol=1e-6 * SIZE)
    assert np.allclose(deformation.normals, mesh.normals, rtol=0, atol=1e-4)
    assert deformation.changed == [(0, len(mesh.vertices))]


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000))
def test_random_updates_of_every_kind_equal_a_fresh_evaluation(sheet: tuple[DCPSurface, Mesh], seed: int) -> None:
    surface, mesh = sheet
    rng, deformation = np.random.default_rng(seed), surface.deformation(mesh)
    for _ in range(30):
        before = deformation.vertices.copy()
        some = rng.choice(surface.n, int(rng.integers(1, 40)), replace=False)
        kind = rng.integers(4)
        if kind == 0:
            deformation.move(some, rng.normal(size=(len(some), 3)))
        elif kind == 1:
            deformation.set_positions(some, surface.points[some] + rng.normal(size=(len(some), 3)))
        elif kind == 2:
            deformation.set_weights(some, rng.uniform(0.3, 3, len(some)))
        else:
            a, b = rng.uniform(0, 0.7, 2)
            knots = [np.sort(rng.uniform(x, x + 0.3, rng.integers(4, 8))) for x in (a, b)]
            deformation.set_knots(interior(surface, int(some[0])), *knots)
        touched = np.zeros(len(before), dtype=bool)
        for start, stop in deformation.changed:
            touched[start:stop] = True
        assert np.array_equal(before[~touched], deformation.vertices[~touched])
    check(deformation)


def test_many_small_moves_do_not_drift(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    rng, deformation = np.random.default_rng(0), surface.deformation(mesh)
    ids, steps = rng.integers(0, surface.n, 30_000), rng.normal(0, 0.05, (30_000, 3))
    for k in range(30_000):
        deformation.move(ids[k : k + 1], steps[k : k + 1])
    points = surface.points.copy()
    np.add.at(points, ids, steps)
    assert np.allclose(deformation.points, points, rtol=0, atol=1e-9)
    check(deformation)


@pytest.mark.parametrize("far", [1e3, 1.2e5, 1e9, 1e30])
@pytest.mark.parametrize("absolute", [False, True])
def test_a_point_far_away_and_back_leaves_nothing(sheet: tuple[DCPSurface, Mesh], far: float, absolute: bool) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.move([200], [[0.0, 0.0, 0.1]])  # its cells keep their numerators
    home = deformation.points[200].copy()
    for _ in range(3):
        deformation.move([200], [[far * SIZE, 0.0, -far * SIZE]])
        assert np.abs(deformation.vertices - fresh(deformation)[0]).max() < 1e-6 * far * SIZE
        if absolute:
            deformation.set_positions([200], [home])
        else:
            deformation.move([200], [[-far * SIZE, 0.0, far * SIZE]])
            deformation.move([200], [home - deformation.points[200]])
    check(deformation)


def test_points_that_wander_by_large_steps_never_drift(sheet: tuple[DCPSurface, Mesh]) -> None:
    """One after the other, always in the same few cells and the same way: rounding errors add up the worst."""
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    for k in range(400):
        deformation.move([200 + k % 3], [[0.37 * SIZE, 0.11 * SIZE, 0.05 * SIZE * (-1) ** k]])
        if k % 20 == 19:
            size = np.ptp(deformation.points, axis=0).max()
            assert np.abs(deformation.vertices - fresh(deformation)[0]).max() < 1e-6 * size
            assert np.isfinite(deformation.normals).all()
    for k in range(400):
        deformation.move([200 + k % 3], [[-0.37 * SIZE, -0.11 * SIZE, 0.05 * SIZE * (-1) ** k]])
    check(deformation)


def test_a_surface_that_shrinks_point_by_point_stays_exact_for_its_new_size(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    target = 1e-3 * surface.points
    for i in range(surface.n):
        deformation.set_positions([i], [target[i]])
    error = np.abs(deformation.vertices - fresh(deformation)[0]).max()
    assert error < 1e-6 * 1e-3 * SIZE


def test_moving_everything_and_back(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    start = deformation.vertices.copy()
    deformation.set_points(surface.points + np.array([1.0, 2.0, 3.0]))
    assert np.allclose(deformation.vertices, start + np.array([1, 2, 3], "f4"), rtol=0, atol=1e-6 * SIZE)
    assert deformation.changed == [(0, len(mesh.vertices))]
    deformation.set_points(surface.points)
    assert np.array_equal(deformation.vertices, start)
    deformation.set_points(surface.points)
    assert deformation.changed == []


def test_vertices_may_be_kept_in_arrays_of_the_callers(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation, twin = surface.deformation(mesh), surface.deformation(mesh)
    deformation.move([200], [[0.0, 0.0, 1.0]])
    own = np.full((2, len(mesh.vertices) + 5, 3), 9.0, np.float32)
    deformation.write_to(own[0, :-5], own[1, :-5])
    for d in (deformation, twin):
        d.set_positions([200, 210], surface.points[[200, 210]] + 1.0)
    np.testing.assert_allclose(own[0, :-5], twin.vertices, atol=1e-6 * SIZE)
    assert np.shares_memory(deformation.vertices, own) and np.shares_memory(deformation.normals, own)
    assert not deformation.vertices.flags.writeable and (own[:, -5:] == 9.0).all()
    check(deformation)
    for bad in (own[0], own[0, :-5].astype(float), own[0, :-5].T):
        with pytest.raises(ValueError, match="vertices: must be contiguous float32 of shape"):
            deformation.write_to(bad, own[1, :-5])


def test_a_move_touches_its_own_cells_only(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.move([300], [[0.0, 0.0, 5.0]])
    reached = surface.basis_matrix(mesh.uv)[:, 300].toarray().ravel() > 0
    touched = np.zeros(len(reached), dtype=bool)
    for start, stop in deformation.changed:
        touched[start:stop] = True
    assert (touched | ~reached).all()
    assert touched.mean() < 0.3


def test_a_slit_opens_on_one_side_only() -> None:
    surface = shapes.torn()
    slit = Slit("u", 0.5, 0.25, 0.75)
    mesh = surface.tessellate(min_depth=3, domain=Domain((0, 1, 0, 1), slits=[slit]))
    deformation = surface.deformation(mesh)
    before = deformation.vertices.copy()
    half = surface.n // 2
    deformation.move(np.arange(half), [0.0, -5.0, 0.0])
    moved = deformation.vertices[:, 1] - before[:, 1]
    on, low = slit.holds(mesh.uv), mesh.side == 2
    assert np.allclose(moved[on & low], -5, atol=1e-4)
    assert (moved[on & ~low] == 0).all()


def test_without_normals(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    full, decimated = surface.deformation(mesh), surface.deformation(mesh, normals=False)
    for deformation in (full, decimated):
        deformation.move([10, 20], [[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]])
    assert np.allclose(full.vertices, decimated.vertices, rtol=0, atol=1e-6 * SIZE)
    assert decimated.normals.shape == (0, 3)
    for deformation, held in ((full, True), (decimated, False)):
        tables = deformation.lists.slope, deformation.storage.packed.packed_slope, deformation.storage.packed.slope_step
        assert any(len(table) for table in tables) == held


def test_ids_that_stand_twice_move_twice(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    deformation.move([7, 7], [[1.0, 0, 0], [2.0, 0, 0]])
    assert np.allclose(deformation.points[7], surface.points[7] + np.array([3, 0, 0]))


BAD = {
    r"ids\[1\]: 576 is not": lambda d: d.move([0, 576], np.zeros((2, 3))),
    r"ids\[0\]: -1 is not": lambda d: d.set_positions([-1], np.zeros((1, 3))),
    "ids: needs a flat sequence of integers": lambda d: d.move([0.5], np.zeros((1, 3))),
    r"delta: shape \(2, 3\), expected \(1, 3\)": lambda d: d.move([1], np.zeros((2, 3))),
    r"delta: shape \(1, 4\), expected \(1, 3\)": lambda d: d.move([1], np.zeros((1, 4))),
    r"xyz: shape \(2,\), expected \(2, 3\)": lambda d: d.set_positions([1, 2], np.zeros(2)),
    r"delta\[1\]: shape \(1,\), expected \(3,\)": lambda d: d.move([1, 2], [[0, 0, 0], [0]]),
    r"delta\[0\]: must be numbers": lambda d: d.move([1], [["up", 0, 0]]),
    r"ids: needs a flat sequence of integers, got \[\[1": lambda d: d.move([[1], [1, 2]], np.zeros((2, 3))),
    r"weights\[0\]: must be numbers": lambda d: d.set_weights([1], ["a"]),
    r"knots_v\[0\]: not a flat sequence": lambda d: d.set_knots(3, [0, 1, 2], None),
    r"ids\[0\]: 999 is not": lambda d: d.set_knots(999, [0, 1, 2], [0, 1, 2]),
    r"xyz\[0\]: must be finite": lambda d: d.set_positions([1], [[0, np.nan, 0]]),
    r"weights\[1\]: must be positive": lambda d: d.set_weights([1, 2], [1, 0]),
    r"weights: shape \(1,\)": lambda d: d.set_weights([1, 2], [1]),
    r"knots_u\[0\]: knots decrease": lambda d: d.set_knots(3, [0, 1, 0], [0, 1, 2]),
    "would leave vertex": lambda d: d.set_knots(0, [0.5, 0.6, 0.7], [0.5, 0.6, 0.7]),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_updates_change_nothing(sheet: tuple[DCPSurface, Mesh], message: str) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    before = deformation.vertices.copy()
    with pytest.raises(ValueError, match=message):
        BAD[message](deformation)
    deformation.refresh()
    assert np.array_equal(deformation.vertices, before)
    assert np.array_equal(deformation.points, surface.points)


def test_a_mesh_without_vertices() -> None:
    surface = DCPSurface([[0.0, 0, 0]], [1], [[0, 1, 2]], [[0, 1, 2]])
    mesh = surface.tessellate(max_points=5, domain=Domain((5, 6, 5, 6)))
    deformation = surface.deformation(mesh)
    deformation.move([0], [[1.0, 0, 0]])
    assert deformation.vertices.shape == deformation.normals.shape == (0, 3)
    assert mesh.triangles.shape == (0, 3)


def test_two_threads_give_the_same(sheet: tuple[DCPSurface, Mesh], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.deform.deformation.SMALL", 0)
    surface, mesh = sheet
    one, two = surface.deformation(mesh), surface.deformation(mesh, threads=2)
    for deformation in (one, two):
        deformation.set_points(surface.points * 1.5)
    assert np.array_equal(one.vertices, two.vertices)
    assert np.array_equal(one.normals, two.normals)
    with pytest.raises(ValueError, match="threads"):
        surface.deformation(mesh, threads=0)


def test_a_mesh_of_a_larger_surface_is_refused(sheet: tuple[DCPSurface, Mesh]) -> None:
    with pytest.raises(ValueError, match="mesh: was made from another surface: this one has 16 points"):
        shapes.hills(4).deformation(sheet[1])
    whole = sheet[0]
    one_less = DCPSurface(whole.points[:-1], whole.weights[:-1], whole.knots_u[:-1], whole.knots_v[:-1])
    assert sheet[1].list_ids.max() == whole.n - 1 == one_less.n
    with pytest.raises(ValueError, match="this one has 575 points"):
        one_less.deformation(sheet[1])


def test_published_arrays_are_read_only(sheet: tuple[DCPSurface, Mesh]) -> None:
    deformation = sheet[0].deformation(sheet[1])
    for array in (deformation.vertices, deformation.normals, deformation.points, sheet[1].uv):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_more_ids_than_points_the_last_position_counts_and_moves_add_up(sheet: tuple[DCPSurface, Mesh]) -> None:
    surface, mesh = sheet
    deformation = surface.deformation(mesh)
    ids = np.append(np.arange(surface.n), [5, 5])
    places = np.vstack([surface.points + 0.5, np.full((2, 3), [[1.0], [2.0]])])
    deformation.set_positions(ids, places)
    assert deformation.points[5].tolist() == [2, 2, 2]
    others = np.arange(surface.n) != 5
    assert np.array_equal(deformation.points[others], (surface.points + 0.5)[others])
    deformation.set_positions(ids[:-2], surface.points)
    deformation.set_positions([5], [[2.0, 2.0, 2.0]])
    deformation.move(ids, np.ones((len(ids), 3)))
    assert deformation.points[5].tolist() == [5, 5, 5]
    assert np.allclose(deformation.points[6], surface.points[6] + 1)
    for bad, message in ((surface.n, rf"ids\[{len(ids)}\]: {surface.n} is not"), (-1, rf"ids\[{len(ids)}\]: -1")):
        with pytest.raises(ValueError, match=message):
            deformation.move(np.append(ids, bad), np.ones((len(ids) + 1, 3)))
    check(deformation)


def test_one_delta_moves_all_and_integers_are_numbers(sheet: tuple[DCPSurface, Mesh]) -> None:
    deformation = sheet[0].deformation(sheet[1])
    deformation.move([1, 2], [1, 2, 3])
    deformation.set_positions([4], np.array([[7, 8, 9]]))
    assert np.allclose(deformation.points[[1, 2]] - sheet[0].points[[1, 2]], [1, 2, 3])
    assert deformation.points[4].tolist() == [7, 8, 9]
    assert deformation.surface.points[4].tolist() == [7, 8, 9]
    assert sheet[0].points[4].tolist() != [7, 8, 9]


def test_the_mesh_of_as_many_copies_as_the_surface_has() -> None:
    ring = shapes.torus()
    mesh = ring.tessellate(chord_error=1.0)
    assert mesh.list_ids.max() >= ring.n  # copies
    assert ring.deformation(mesh, normals=False).nbytes > 0


@pytest.mark.parametrize("closed", [(True, False), (False, True), (True, True)])
def test_a_surface_that_is_closed_follows_on_both_sides_of_its_line(closed: tuple[bool, bool]) -> None:
    ring, ends = shapes.torus(), ((0.0, 1.0), (0.0, 1.0))
    sides = {f"closed_{name}": end for name, end, on in zip("uv", ends, closed, strict=True) if on}
    surface = DCPSurface(ring.points, ring.weights, ring.knots_u, ring.knots_v, **sides)
    domain = Domain(tuple(x for on in closed for x in ((0.0, 1.0) if on else (0.3, 0.7))))  # type: ignore[arg-type]
    deformation = surface.deformation(surface.tessellate(chord_error=1.0, domain=domain))
    rng, first = np.random.default_rng(1), np.arange(surface.n)
    deformation.move(first[:20], rng.normal(size=(20, 3)))
    deformation.set_positions(first[::3], surface.points[::3] + rng.normal(size=(len(first[::3]), 3)))
    check(deformation)
