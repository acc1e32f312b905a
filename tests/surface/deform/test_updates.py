"""Which cells a move affects, when they take differences, and when they are computed again."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.deform import deformation as module
from surface.deform import updates
from surface.deform.deformation import LIMIT, RECOMPUTE_FRACTION, Deformation


def moved(normals: bool = True) -> Deformation[DCPSurface]:
    surface = shapes.hills(16)
    return surface.deformation(surface.tessellate(chord_error=0.5), normals=normals)


def error(deformation: Deformation[DCPSurface]) -> float:
    """Greatest distance of a vertex from a new evaluation in float64."""
    mesh = deformation.mesh
    return float(np.abs(deformation.vertices - deformation.surface.evaluate(mesh.uv, side=mesh.side)).max())


def test_a_cell_takes_at_most_the_limit_of_differences_and_is_then_computed_again() -> None:
    deformation = moved()
    cells, _ = deformation.lists.entries_of(100)
    counts = deformation._arrays["differences"]
    assert (counts == updates.NOT_STORED).all()
    assert LIMIT == 256
    deformation._arrays["extent"][0] = 1e6  # so large that the errors of 256 differences do not count
    for k in range(2 * LIMIT + 5):
        deformation.move([100], [[0.0, 0.0, 0.001]])
        assert (counts[cells] == k % 257).all(), k
    others = np.setdiff1d(np.arange(len(counts)), cells)
    assert (counts[others] == updates.NOT_STORED).all()


@pytest.mark.parametrize("normals", [True, False])
def test_drift_of_the_numerators_ends_at_the_limit(monkeypatch: pytest.MonkeyPatch, normals: bool) -> None:
    monkeypatch.setattr(module, "LIMIT", 3)
    deformation = moved(normals)
    step = [[0.0, 0.0, 0.01]]
    deformation.move([100], step)  # stores the numerators
    grown = np.float32(0.5 / np.median(deformation._arrays["inv_w"]))
    deformation._arrays["numerators"][:] += grown  # as if rounding errors had grown to that
    for _ in range(3):
        deformation.move([100], step)
        assert error(deformation) > 0.1
    deformation.move([100], step)
    assert error(deformation) < 1e-4
    again = deformation.vertices.copy()
    deformation.refresh()
    assert np.abs(deformation.vertices - again).max() < 1e-5


def test_several_points_of_a_cell_count_each() -> None:
    deformation = moved()
    first = deformation.lists.entries_of(100)[0]
    second = deformation.lists.entries_of(101)[0]
    counts = deformation._arrays["differences"]
    for _ in range(3):
        deformation.move([100, 101], np.full((2, 3), 0.01))
    both = np.intersect1d(first, second)
    assert len(both) and (counts[both] == 4).all()
    assert (counts[np.setxor1d(first, second)] == 2).all()
    assert error(deformation) < 1e-4


@pytest.mark.parametrize("few", [True, False])
def test_differences_are_taken_where_they_cost_less_than_all_rows(few: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    deformation = moved()
    cells, _ = deformation.lists.entries_of(100)
    rows = deformation.lists.rows[cells]
    monkeypatch.setattr(module, "BIAS", float(rows.min()) - (0.5 if few else 0.0))
    deformation.move([100], [[0.0, 0.0, 1.0]])
    counts = deformation._arrays["differences"][cells]
    assert (counts[rows == rows.min()] == (0 if few else updates.NOT_STORED)).all()
    assert error(deformation) < 1e-4


def test_cells_choose_by_limit_bias_and_what_is_stored() -> None:
    affected, hits = np.arange(6, dtype=np.int32), np.array([1, 1, 1, 2, 1, 1])
    counts, rows = np.array([9, 10, -1, 9, 3, -1]), np.array([7, 7, 7, 13, 6, 6])
    recomputed, none = np.zeros(6, dtype=np.int32), np.zeros(6)
    chosen = updates.choose_recomputed(
        6, affected, hits, none, counts, none.copy(), none.copy(), rows, np.full(6, -1), False, 10, 6.0, 1.0, recomputed
    )  # fmt: skip
    assert chosen == 2
    assert counts.tolist() == [10, updates.STORE, updates.STORE, updates.STORE, -1, -1]
    assert recomputed[:2].tolist() == [4, 5]
    assert (hits == 0).all()


def test_positions_of_cells_with_factors_are_joined_again_however_few_points_move() -> None:
    for slopes, again in ((False, [1]), (True, [])):
        affected, hits, rows = np.arange(2, dtype=np.int32), np.array([1, 1]), np.full(2, 50)
        counts, none, recomputed = np.array([4, 4]), np.zeros(2), np.full(2, -7, dtype=np.int32)
        chosen = updates.choose_recomputed(
            2, affected, hits, none, counts, none.copy(), none.copy(), rows, np.array([-1, 3]), slopes, 100, 6.0, 1.0,
            recomputed,
        )  # fmt: skip
        assert recomputed[:chosen].tolist() == again
        assert counts.tolist() == [5, 5 if slopes else updates.NOT_STORED]


def test_cells_are_computed_again_before_they_drift_too_far() -> None:
    """Each difference rounds by 6e-8 of all that the numerators are made of: the span, and the move itself."""
    affected, hits, rows = np.arange(3, dtype=np.int32), np.array([1, 2, 1]), np.full(3, 50)
    counts, pull = np.array([4, 4, 4]), np.array([2.0, 2.0, 2.0])
    span, drift = np.array([8.0, 8.0, 8.0]), np.array([4e-7, 0.0, 5e-7])
    updates.choose_recomputed(
        3, affected, hits, pull, counts, span, drift, rows, np.full(3, 9), True, 100, 6.0, 1.0001e-6,
        np.zeros(3, dtype=np.int32),
    )  # fmt: skip
    assert counts.tolist() == [5, updates.STORE, updates.STORE]
    assert span.tolist() == [10.0, 8.0, 8.0]
    np.testing.assert_allclose(drift, [1e-6, 0.0, 5e-7])


def test_affected_cells_rise_and_count_the_points_that_reach_them_and_how_far_these_move() -> None:
    start, count = np.array([0, 2, 3]), np.array([2, 1, 2])
    cells, hits, affected = np.array([4, 1, 0, 4, 2], dtype=np.int32), np.zeros(5, np.int64), np.zeros(5, np.int32)
    delta, pull = np.array([[1.0, -3.0, 2.0], [0.5, 0.25, -0.25]]), np.full(5, 9.0)
    found = updates.find_affected(np.array([0, 2, 1]), delta, 2, start, count, cells, hits, pull, affected)
    assert found == 3
    assert affected[:3].tolist() == [1, 2, 4]
    assert hits.tolist() == [0, 1, 1, 0, 2]
    assert pull.tolist() == [9.0, 3.0, 0.5, 9.0, 3.5]


def test_the_surface_is_measured_again_when_it_may_have_shrunk_to_half() -> None:
    points, extent = np.array([[0.0, 0, 0], [8, 1, 1]]), np.array([0.0, 1.0, 9.0, 1e30, 0.0, 0.0, 0.0])
    assert updates.measure(points, extent, True)
    assert extent.tolist() == [8.0, 0.0, 8.0, 1e30, 4.0, 0.5, 0.5]
    step = np.array([[0.0, -1.5, 0.0]])
    points[1, 0] = 3.0
    assert not updates.has_left(points, step, 1, extent)
    assert extent[:2].tolist() == [8.0, 1.5]
    assert updates.has_left(points, step, 1, extent)
    assert extent.tolist() == [3.0, 0.0, 3.0, 1e30, 1.5, 0.5, 0.5]
    points[1, 0] = 2.0
    assert not updates.has_left(points, step, 1, extent)
    assert extent.tolist() == [2.0, 0.0, 3.0, 1e30, 1.5, 0.5, 0.5]
    points[1, 0] = 1.4  # less than half of 3, though not of 2
    assert updates.has_left(points, step, 1, extent)
    assert extent[[0, 2]].tolist() == [1.4, 1.4]


def test_a_surface_that_moves_further_than_it_is_large_gets_other_origins() -> None:
    points, extent = np.array([[0.0, 0, 0], [8, 1, 1]]), np.zeros(7)
    updates.measure(points, extent, True)
    assert not updates.measure(points + np.array([0.0, 7.9, 0.0]), extent, False)
    assert updates.measure(points + np.array([0.0, 8.1, 0.0]), extent, False)
    assert extent.tolist() == [8.0, 0.0, 8.0, 0.0, 4.0, 8.6, 0.5]


def test_only_points_that_really_move_are_stored() -> None:
    points, ids = np.arange(12.0).reshape(4, 3), np.array([3, 1, 0])
    moved_ids, delta = np.zeros(4, np.int64), np.zeros((4, 3))
    rows = np.array([[9.0, 10, 12], [3, 4, 5], [0, -1, 2]])
    assert updates.store_positions(ids, rows, False, points, moved_ids, delta) == 2
    assert moved_ids[:2].tolist() == [3, 0]
    assert delta[:2].tolist() == [[0, 0, 1], [0, -2, 0]]
    assert points.tolist() == [[0, -1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 12]]
    steps = np.array([[0.0, 0, 0], [1, 2, 3], [0, 0, 0.5]])
    assert updates.store_positions(ids, steps, True, points, moved_ids, delta) == 2
    assert moved_ids[:2].tolist() == [1, 0]
    assert delta[:2].tolist() == [[1, 2, 3], [0, 0, 0.5]]
    assert points.tolist() == [[0, -1, 2.5], [4, 6, 8], [6, 7, 8], [9, 10, 12]]


def test_the_first_bad_row_is_found_ids_before_numbers() -> None:
    rows, points = np.zeros((3, 3)), np.zeros((5, 3))

    def first(ids: list[int], relative: bool = False) -> int:
        return int(updates.first_invalid(np.array(ids), rows, relative, points, 3e38))

    assert first([0, 4, 2]) == updates.VALID
    assert first([0, 5, 2]) == -2
    assert first([-1, 4, 2]) == -1
    rows[2, 1] = np.nan
    assert first([0, 4, 2]) == 2
    rows[0, 2] = np.inf
    assert first([0, 4, 7]) == -3
    assert first([0, 4, 2]) == 0


@pytest.mark.parametrize("axis", range(3))
def test_rows_that_lead_beyond_float32_are_found(axis: int) -> None:
    rows, points, ids = np.zeros((2, 3)), np.zeros((5, 3)), np.array([1, 4])
    rows[1, axis] = -3e38
    points[4, axis] = -1e37
    assert updates.first_invalid(ids, rows, False, points, 3e38) == updates.VALID
    assert updates.first_invalid(ids, rows, True, points, 3e38) == 1
    rows[1, axis] = 3.001e38
    assert updates.first_invalid(ids, rows, False, points, 3e38) == 1
    assert updates.first_invalid(ids, rows, True, points, 3e38) == updates.VALID


def test_from_some_part_of_the_points_on_everything_is_computed_again() -> None:
    deformation = moved()
    n = deformation.basis.n
    some = int(RECOMPUTE_FRACTION * n)
    deformation.move(np.arange(n), [0.0, 0.0, 0.5])  # a change of all leaves no numerators
    assert deformation.changed == [(0, len(deformation.vertices))]
    calls: list[int] = []
    whole = deformation.refresh
    deformation.refresh = lambda: (calls.append(1), whole())[1]  # type: ignore[method-assign, func-returns-value]
    deformation.move(np.arange(some), [0.0, 0.0, 0.5])
    assert not calls
    deformation.move(np.arange(some + 1), [0.0, 0.0, 0.5])
    assert calls == [1]
    assert error(deformation) < 1e-4


def test_a_closed_surface_moves_every_copy() -> None:
    torus = shapes.torus()
    deformation = torus.deformation(torus.tessellate(chord_error=0.5))
    for i in (0, 4, 60, torus.n - 1):
        deformation.move([i], [[1.0, 2.0, 3.0]])
        deformation.set_positions([i], [[5.0, 4.0, i]])
        assert error(deformation) < 1e-4
    deformation.set_weights([0, torus.n - 1], [3.0, 0.2])
    assert error(deformation) < 1e-4
    deformation.set_knots(0, torus.knots_u[0] * 1.1, torus.knots_v[0] * 0.9)
    deformation.move([0], [[1.0, 0.0, 0.0]])
    assert error(deformation) < 1e-4


def test_bad_moves_of_a_closed_surface_are_named() -> None:
    torus = shapes.torus()
    deformation = torus.deformation(torus.tessellate(chord_error=1.0))
    before = deformation.vertices.copy()
    with pytest.raises(ValueError, match=r"delta\[1\]: must be finite, got \[0.0, nan, 0.0\]"):
        deformation.move([3, 4], [[1.0, 0, 0], [0, np.nan, 0]])
    with pytest.raises(ValueError, match=rf"ids\[0\]: {torus.n} is not a control point \(0 to {torus.n - 1}\)"):
        deformation.set_positions([torus.n], [[1.0, 0, 0]])
    assert np.array_equal(deformation.vertices, before)
    assert np.array_equal(deformation.points, torus.points)
