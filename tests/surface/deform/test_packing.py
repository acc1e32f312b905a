"""Packed weights are those of the blocks they were made from, and take up fewer zeros."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface, Domain
from surface.deform import packing
from surface.deform.deformation import Deformation
from surface.deform.fixed import take_all
from surface.deform.lists import LANES, Lists, build_lists
from surface.mesh.mesh import Mesh


def body(count: int = 60) -> tuple[DCPSurface, Mesh]:
    """Points at random places, each of which reaches a part of a cell only."""
    surface = shapes.scattered(count, 2)
    return surface, surface.tessellate(chord_error=0.1, max_depth=4, domain=Domain((0, 1, 0, 1)))


def packed(lists: Lists) -> tuple[packing.Order, packing.Packed]:
    order = packing.order_vertices(lists)
    points = np.random.default_rng(5).normal(size=(int(lists.ids.max()) + 1, 3))
    return order, packing.pack(lists, order, np.ones(len(lists.rows), np.bool_), points)


@pytest.mark.parametrize("normals", [True, False])
def test_unpacked_blocks_are_the_blocks_that_were_packed(normals: bool) -> None:
    lists = build_lists(*body(), normals)
    _, made = packed(lists)
    held = np.flatnonzero(made.packed_at >= 0)
    assert len(held) > 3 and (made.order_at[held] >= 0).any()
    for c in held:
        blocks = packing.unpack_cell(lists, made, int(c))
        size = lists.rows[c] * (lists.tile_start[c + 1] - lists.tile_start[c]) * LANES
        missed = np.abs(blocks[0].ravel() - lists.value[lists.at[c] :][:size]).reshape(blocks[0].shape)
        assert (missed <= 2.0**-23 * blocks[0].max(axis=1, keepdims=True)).all()  # of each vertex's greatest weight
        assert len(blocks) == 1 + normals
        if normals:
            slopes = lists.slope[2 * lists.at[c] :][: 2 * size].reshape(-1, 2, LANES)
            steps = made.slope_step[made.packed_at[c] :][: lists.tile_start[c + 1] - lists.tile_start[c]].max(axis=0)
            assert (np.abs(blocks[1].reshape(slopes.shape) - slopes) <= 1.01 * steps[:, None]).all()


def missed_derivatives(lists: Lists, surface: DCPSurface) -> np.ndarray:
    """(k,) how far the derivatives of the surface at vertices of packed cells are off, in u and in v."""
    order = packing.order_vertices(lists)
    made, out = packing.pack(lists, order, np.ones(len(lists.rows), np.bool_), surface.points), []
    for c in np.flatnonzero(made.packed_at >= 0):
        weights, slopes = packing.unpack_cell(lists, made, int(c))
        wanted = lists.slope[2 * lists.at[c] :][: slopes.size].reshape(*slopes.shape[:2], 2, LANES)
        errors = slopes.reshape(wanted.shape) - wanted
        places = surface.points[lists.ids[lists.ids_at[c] :][: lists.rows[c]]]
        vertices = np.einsum("trl,rc->tlc", weights, places) / weights.sum(axis=1)[..., None].clip(1e-30)
        away = places[None, :, None] - vertices[:, None]  # (t, r, l, c)
        out.append(np.linalg.norm(np.einsum("trql,trlc->tqlc", errors, away), axis=-1).ravel())
    return np.concatenate(out)


def test_derivatives_are_rounded_so_that_those_of_the_surface_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, mesh = body()
    lists = build_lists(surface, mesh, True)
    chosen = missed_derivatives(lists, surface)
    monkeypatch.setattr(packing, "_round_slopes", lambda *_: None)  # each to the nearest step
    nearest = missed_derivatives(lists, surface)
    assert np.sqrt((chosen**2).mean()) < 0.7 * np.sqrt((nearest**2).mean()) > 0.0
    assert (chosen <= nearest + 1e-12).all()


def test_the_largest_derivatives_stay_within_16_bits_whichever_way_they_are_rounded() -> None:
    lists, rng = one_cell(), np.random.default_rng(3)
    lists.value[:32] = 1.0  # of the second tile no point reaches a vertex: nothing is divided by nothing
    lists.slope = rng.uniform(-1, 1, 128).astype(np.float32)
    lists.slope[::3] = np.float32(1.0)
    lists.slope[64:80] = 0.0  # a row of zeros, without which the cell would keep its block
    for scale in (1.0, 1e-32):
        lists.slope *= np.float32(scale)
        _, made = packed(lists)
        assert np.abs(made.packed_slope.astype(int)).max() == (packing.MAX_STEPS if scale == 1.0 else 0)


def test_no_entry_is_all_zero_and_every_row_knows_its_entries() -> None:
    lists = build_lists(*body(), False)
    order, made = packed(lists)
    weights, held = take_all(made.packed, 0, len(made.entry_row)), np.repeat(made.packed_at >= 0, sizes(lists))
    assert len(weights) == sum(order.entries[made.packed_at >= 0])
    few = np.count_nonzero(lists.value[held]) - np.count_nonzero(weights)  # less than half a step
    assert 0 <= few <= np.count_nonzero((lists.value[held] > 0.0) & (lists.value[held] < 2.0**-23 * lists.value.max()))
    for c in np.flatnonzero(made.packed_at >= 0):
        tiles = int(lists.tile_start[c + 1] - lists.tile_start[c])
        starts = made.tile_entry[made.packed_at[c] :][: tiles + 1]
        assert starts[-1] - starts[0] == order.entries[c]
        places = made.places[made.places_at[c] :][: lists.rows[c] * tiles].reshape(-1, tiles).astype(np.int64)
        row, tile = np.nonzero(places)
        entries = starts[tile] + places[row, tile] - 1
        assert np.array_equal(made.entry_row[entries], row)
        assert sorted(entries.tolist()) == list(range(starts[0], starts[-1]))


def sizes(lists: Lists) -> np.ndarray:
    return lists.rows * np.diff(lists.tile_start) * LANES


def one_cell() -> Lists:
    """A cell of 16 vertices and four points without weights."""
    cell, row = np.zeros(4, np.int32), np.arange(4, dtype=np.int32)
    return Lists(
        np.array([0, 16]), np.array([0, 2]), np.array([4]), np.array([4]), np.array([0]), np.array([0]),
        row, np.zeros(64, np.float32), np.zeros(0, np.float32), np.arange(4), np.ones(4, np.int64), cell, row,
    )  # fmt: skip


def test_vertices_are_put_where_they_share_points() -> None:
    """Two families of vertices in turn, each reached by two of four points: half of every tile is zero in order."""
    lists = one_cell()
    block = lists.value.reshape(2, 4, 8)
    block[:, :2, ::2], block[:, 2:, 1::2] = 1.0, 2.0
    order, made = packed(lists)
    assert order.moved.tolist() == [True] and order.entries.tolist() == [4]
    assert order.order.tolist() == [*range(0, 16, 2), *range(1, 16, 2)]
    assert (take_all(made.packed, 0, len(made.entry_row)) != 0).all()


def test_cells_without_zeros_keep_blocks() -> None:
    lists = one_cell()
    lists.value[:] = 1.0
    order, made = packed(lists)
    assert order.entries.tolist() == [8] and made.packed_at.tolist() == [packing.PLAIN] == made.order_at.tolist()
    lists.value[:8] = 0.0
    order, made = packed(lists)
    assert order.entries.tolist() == [7] and made.packed_at.tolist() == [0] and not order.moved.any()
    none = packing.pack(lists, order, np.zeros(1, np.bool_), np.zeros((4, 3)))
    assert none.packed_at.tolist() == [packing.PLAIN] and none.nbytes == 3 * 8


@pytest.mark.parametrize("normals", [True, False])
def test_updates_of_packed_cells_agree_with_a_new_evaluation(normals: bool) -> None:
    surface, mesh = body(120)
    deformation, rng = Deformation(surface, mesh, normals=normals), np.random.default_rng(1)
    made = deformation.storage.packed
    assert (made.packed_at >= 0).any() and (made.order_at >= 0).any()

    def check() -> None:
        points, su, sv = deformation.surface.derivatives(mesh.uv, mesh.side)
        assert np.abs(deformation.vertices - points).max() < 1e-6 * np.ptp(deformation.points, axis=0).max()
        if normals:
            wanted = np.cross(su, sv)
            length = np.linalg.norm(wanted, axis=1)[:, None]
            assert (np.abs(deformation.normals - wanted / length) * length).max() < 1e-4 * length.max()

    check()
    for _ in range(4):  # the first stores numerators, those after it add differences
        deformation.move([30], 0.1 * rng.normal(size=3))
        check()
    deformation.move([30, 31, 90], 0.1 * rng.normal(size=(3, 3)))
    check()
    before = (made.packed_at >= 0).sum()
    deformation.set_weights([40], [3.0])
    assert (made.packed_at >= 0).sum() < before  # their weights are kept one by one now
    check()
    deformation.move([40, 41], 0.1 * rng.normal(size=3))
    check()


def test_a_refused_change_leaves_packed_cells() -> None:
    surface, mesh = shapes.hills(8), shapes.hills(8).tessellate(chord_error=0.2)
    deformation = surface.deformation(mesh)
    made = deformation.storage.packed
    before, order, used = made.packed_at.copy(), made.order_at.copy(), deformation.lists.used
    assert (before >= 0).any()
    with pytest.raises(ValueError, match="uncovered"):
        deformation.set_knots(0, [0.5, 0.6, 0.7], [0.5, 0.6, 0.7])
    assert np.array_equal(before, made.packed_at) and np.array_equal(order, made.order_at)
    assert deformation.lists.used == used
    deformation.move([0, 1], [0.0, 0.0, 1.0])
    assert np.abs(deformation.vertices - deformation.surface.evaluate(mesh.uv)).max() < 2e-5


def test_a_tile_of_eight_vertices_starts_with_the_first_one_left() -> None:
    """The first eight share a point; of the others, the second would fit them, but starts no tile."""
    masks = np.array([[1]] * 8 + [[2], [1], [2]], np.uint64)
    order, left, union = np.zeros(11, np.int64), np.zeros(11, np.int64), np.zeros(1, np.uint64)
    packing._arrange(11, masks, 5, union, left, order)
    assert order.tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 9]
    mixed = np.array([[1], [2], [1], [2], [4]], np.uint64)
    packing._arrange(5, mixed, 5, union, left, order)
    assert order[:5].tolist() == [0, 2, 1, 3, 4]
    packing._arrange(5, mixed, 1, union, left, order)  # only the next one is looked at
    assert order[:5].tolist() == [0, 1, 2, 3, 4]
