"""How cells keep their weights, and that blocks come back before weights change."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface import DCPSurface
from surface.deform.lists import LANES, Basis, Lists, build_lists
from surface.deform.packing import PLAIN
from surface.deform.storage import Storage, compress, expand, make_restore
from surface.mesh.mesh import Mesh


@pytest.fixture(scope="module")
def body() -> tuple[DCPSurface, Mesh]:
    """Points at random places and with other weights over a net of splines: cells of all three kinds."""
    net, own = shapes.hills(12, 1.0), shapes.scattered(8, 3)
    surface = DCPSurface(
        np.vstack([net.points, own.points]), np.concatenate([net.weights, own.weights]),
        [*net.knots_u, *own.knots_u], [*net.knots_v, *own.knots_v],
    )  # fmt: skip
    return surface, surface.tessellate(chord_error=0.02, max_depth=5)


def compressed(body: tuple[DCPSurface, Mesh], normals: bool) -> tuple[Lists, Storage]:
    surface, mesh = body
    lists = build_lists(surface, mesh, normals)
    return lists, compress(Basis.of(surface), lists, mesh, surface.arrays()[4])


def blocks_of(lists: Lists, c: int) -> np.ndarray:
    """(points, 8 t, 1 or 3): the block of a cell, and its slopes, its points in rising order."""
    tiles, room, rows = int(np.diff(lists.tile_start)[c]), int(lists.room[c]), int(lists.rows[c])
    size, order = tiles * room * LANES, np.argsort(lists.ids[lists.ids_at[c] :][:rows])
    kinds = [lists.value[lists.at[c] :][:size].reshape(tiles, room, 1, LANES)]
    if len(lists.slope):
        kinds.append(lists.slope[2 * lists.at[c] :][: 2 * size].reshape(tiles, room, 2, LANES))
    whole = np.concatenate(kinds, axis=2)[:, :rows][:, order]
    return whole.transpose(1, 0, 3, 2).reshape(rows, tiles * LANES, -1)


@pytest.mark.parametrize("normals", [True, False])
def test_every_cell_keeps_its_weights_in_one_way(body: tuple[DCPSurface, Mesh], normals: bool) -> None:
    lists, storage = compressed(body, normals)
    plain = build_lists(*body, normals)
    factors, packed = storage.factors.rows_at >= 0, storage.packed.packed_at >= 0
    blocks = storage.blocks(np.arange(len(lists.rows)))
    assert (factors.astype(int) + packed + blocks == 1).all() and packed.any() and not blocks.all()
    tiles = np.diff(lists.tile_start)
    sizes = np.where(blocks, lists.rows * tiles * LANES, 0)
    assert len(lists.value) == lists.used == sizes.sum()
    assert len(lists.slope) == (2 * sizes.sum() if normals else 0)
    assert np.array_equal(lists.room, np.where(blocks, lists.rows, 0))
    for c in np.flatnonzero(blocks):
        assert np.array_equal(blocks_of(lists, c), blocks_of(plain, c)), c
    some = np.array([3, 0, 3])
    assert storage.blocks(some).tolist() == blocks[some].tolist()
    assert storage.nbytes == storage.factors.nbytes + storage.packed.nbytes > 0
    assert storage.arrays["rows_at"] is storage.factors.rows_at and storage.arrays["order"] is storage.packed.order


@pytest.mark.parametrize("normals", [True, False])
def test_blocks_come_back_as_they_were(body: tuple[DCPSurface, Mesh], normals: bool) -> None:
    lists, storage = compressed(body, normals)
    plain, cells = build_lists(*body, normals), np.arange(len(lists.rows))
    held = np.flatnonzero(~storage.blocks(cells))
    kept = {c: blocks_of(lists, c) for c in np.flatnonzero(storage.blocks(cells))}
    expand(lists, storage, held[::2])
    assert storage.blocks(held[::2]).all() and not storage.blocks(held[1::2]).any()
    expand(lists, storage, cells)  # those that have blocks already are left
    assert storage.blocks(cells).all()
    assert (storage.packed.order_at == PLAIN).all()
    assert lists.used == len(build_lists(*body, False).value) <= len(lists.value)
    for c in cells:
        found, wanted = blocks_of(lists, c), blocks_of(plain, c)
        assert np.abs(found - wanted)[..., 0].max() <= 4e-7 * np.abs(wanted).max(), c
        most = np.abs(wanted).max(axis=(0, 1))  # derivatives of packed cells are kept in 16 bits
        assert (np.abs(found - wanted).max(axis=(0, 1)) <= 4e-5 * most).all(), c
    for c, block in kept.items():
        assert np.array_equal(blocks_of(lists, c), block)


@pytest.mark.parametrize("normals", [True, False])
def test_what_is_expanded_can_be_taken_back(body: tuple[DCPSurface, Mesh], normals: bool) -> None:
    lists, storage = compressed(body, normals)
    names = ("at", "room", "value", "slope")
    before = [getattr(lists, name).copy() for name in names], [a.copy() for a in storage.arrays.values()
                                                               if isinstance(a, np.ndarray)]  # fmt: skip
    used = lists.used
    restore = make_restore(lists, storage)
    expand(lists, storage, np.arange(0, len(lists.rows), 2))
    assert lists.used > used
    restore()
    assert lists.used == used
    for name, old in zip(names, before[0], strict=True):
        assert np.array_equal(getattr(lists, name), old), name
    now = [a for a in storage.arrays.values() if isinstance(a, np.ndarray)]
    for array, old in zip(now, before[1], strict=True):
        assert np.array_equal(array, old)
