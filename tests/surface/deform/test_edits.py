"""Lists after changes of knots are those of new lists."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapes

from surface import DCPSurface, Domain, blending
from surface.deform import edits
from surface.deform.edits import change_weights
from surface.deform.lists import Lists, build_lists
from surface.deform.storage import expand


def rows(lists: Lists) -> dict[tuple[int, int], np.ndarray]:
    """b w of every pair of cell and point that is not all zero, from the blocks."""
    x, out = lists, {}
    for c in range(len(x.rows)):
        tiles = int(x.tile_start[c + 1] - x.tile_start[c])
        block = x.value[x.at[c] :][: tiles * x.room[c] * 8].reshape(tiles, int(x.room[c]), 8)
        for row in range(int(x.rows[c])):
            out[c, int(x.ids[x.ids_at[c] + row])] = block[:, row].ravel()
    return out


def test_rows_after_many_changes_are_blending_functions_times_weights() -> None:
    surface = shapes.scattered(40, 7)
    mesh = surface.tessellate(chord_error=0.1, max_depth=4, domain=Domain((0, 1, 0, 1)))
    assert not mesh.side.any()
    deformation, rng = surface.deformation(mesh), np.random.default_rng(3)
    for k in range(60):
        low = rng.uniform(-0.3, 0.8, 2)
        knots = [np.sort(rng.uniform(x, x + rng.uniform(0.05, 0.7), int(rng.integers(3, 8)))) for x in low]
        deformation.set_knots(k % 40, *knots)  # point 40 covers everything and stays
    expand(deformation.lists, deformation.storage, np.arange(len(deformation.lists.rows)))
    mine, now, cells = rows(deformation.lists), deformation.surface, deformation.mesh.cell_start
    for i, (knots_u, knots_v) in enumerate(zip(now.knots_u, now.knots_v, strict=True)):
        share = blending(knots_u, mesh.uv[:, 0]) * blending(knots_v, mesh.uv[:, 1]) * now.weights[i]
        for c, (first, last) in enumerate(pairwise(cells)):
            row = mine.get((c, i), np.zeros(8 * -(-(last - first) // 8)))
            assert np.allclose(row[: last - first], share[first:last], rtol=1e-6, atol=1e-12)
    assert np.abs(deformation.vertices - now.evaluate(mesh.uv)).max() < 1e-4


def test_back_lists_agree_with_lists() -> None:
    surface = shapes.hills(10)
    deformation = surface.deformation(surface.tessellate(chord_error=0.2))
    for i in (33, 44, 55, 33):
        deformation.set_knots(i, [0.1, 0.2, 0.5, 0.6, 0.9], [0.2, 0.3, 0.4, 0.8, 0.85])
    x = deformation.lists
    pairs = {(c, int(x.ids[x.ids_at[c] + row])) for c in range(len(x.rows)) for row in range(int(x.rows[c]))}
    for i in range(len(x.point_start)):
        for e in range(int(x.point_start[i]), int(x.point_start[i] + x.point_count[i])):
            c, row = int(x.point_cell[e]), int(x.point_row[e])
            assert x.ids[x.ids_at[c] + row] == i
            pairs.remove((c, i))
    assert not pairs


def test_a_refused_change_leaves_everything() -> None:
    surface = shapes.hills(8)
    deformation = surface.deformation(surface.tessellate(chord_error=1.0))
    before = deformation.lists.value.copy()
    with pytest.raises(ValueError, match="uncovered"):
        deformation.set_knots(0, [0.5, 0.6, 0.7], [0.5, 0.6, 0.7])
    assert np.array_equal(before, deformation.lists.value)


def test_arrays_hold_at_most_twice_of_what_is_used() -> None:
    surface = shapes.scattered(40, 7)
    mesh = surface.tessellate(chord_error=0.1, max_depth=4, domain=Domain((0, 1, 0, 1)))
    deformation, rng = surface.deformation(mesh), np.random.default_rng(2)
    before, compacted, with_gaps = 0, 0, 0
    for k in range(150):
        low = rng.uniform(-0.3, 0.8, 2)
        deformation.set_knots(k % 40, *(np.sort(rng.uniform(x, x + 0.6, 5)) for x in low))
        x = deformation.lists
        live = int((x.rows * np.diff(x.tile_start))[x.room > 0].sum()) * 8  # others have no block yet
        assert live <= x.used <= 2 * live
        assert x.used <= len(x.value) and 2 * x.used <= len(x.slope)
        assert x.point_used <= 2 * x.point_count.sum() + 1024
        assert (x.rows <= x.room)[x.room > 0].all() and (x.point_count <= x.point_room).all()
        compacted += x.used < before
        with_gaps += x.used > live
        before = x.used
    assert compacted and with_gaps > 100  # they are not copied each time
    assert np.abs(deformation.vertices - deformation.surface.evaluate(deformation.mesh.uv)).max() < 1e-4


def test_changed_weights_name_the_cells_that_they_reach() -> None:
    surface = shapes.hills(10)
    mesh = surface.tessellate(chord_error=0.2)
    deformation = surface.deformation(mesh)
    cells = change_weights(
        deformation.basis, deformation.lists, deformation.storage, deformation.mesh,
        np.array([33, 34]), np.array([2.0, 3.0]),
    )  # fmt: skip
    reached = surface.basis_matrix(mesh.uv)[:, [33, 34]].toarray().any(axis=1)
    assert np.array_equal(cells, np.unique(deformation.mesh.cell[reached]))
    assert deformation.basis.weights[[33, 34]].tolist() == [2, 3]
    none = change_weights(
        deformation.basis,
        deformation.lists,
        deformation.storage,
        deformation.mesh,
        np.zeros(0, dtype=np.int64),
        np.zeros(0),
    )
    assert none.shape == (0,)


def test_vertices_that_only_one_point_covers_are_found() -> None:
    """Ten points over the unit square, drawn where anything covers it: many vertices have only one point."""
    rng = np.random.default_rng(4)
    low = rng.uniform(0.0, 0.6, (10, 2))
    knots = [np.linspace(low[:, k], low[:, k] + 0.4, 4, axis=1) for k in range(2)]
    surface = DCPSurface(rng.normal(size=(10, 3)), np.ones(10), *knots)
    mesh = surface.tessellate(min_depth=5, max_depth=5, roots=(1, 1), chord_error=1e9)
    lists = build_lists(surface, mesh, False)
    covering = surface.basis_matrix(mesh.uv, side=mesh.side).toarray() > 0
    away = [np.array([5.0, 6.0, 7.0])] * 2
    alone = 0
    for i in range(10):
        found = np.zeros(len(mesh.uv), dtype=np.int64)
        entries = lists.entries_of(i)
        count = edits._list_only_covered(
            *entries, lists.cell_start, lists.rows, lists.room, lists.at, lists.value, found
        )
        wanted = np.flatnonzero(covering[:, i] & (covering.sum(axis=1) == 1))
        assert sorted(found[:count].tolist()) == wanted.tolist()
        assert edits._first_uncovered(lists, mesh, i, away) == (found[0] if count else -1)
        assert edits._first_uncovered(lists, mesh, i, [row[i] for row in knots]) == -1  # it reaches them as before
        alone += count
    assert alone > 50
