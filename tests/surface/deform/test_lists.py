"""Weights by cell are the blending functions times the weights, in the documented order."""

from __future__ import annotations

import numpy as np

from surface import Domain
from surface.deform.lists import LANES, build_lists, cells_by_point
from tests.surface import shapes


def test_blocks_hold_b_w_and_its_derivatives() -> None:
    surface = shapes.scattered(40, 1)
    mesh = surface.tessellate(chord_error=0.1, max_depth=5, domain=Domain((0, 1, 0, 1)))
    lists = build_lists(surface, mesh, normals=True)
    for c in range(0, len(lists.rows), 7):
        first, last = mesh.cell_start[c], mesh.cell_start[c + 1]
        tiles = -(-(last - first) // LANES)
        ids = lists.ids[lists.ids_at[c] : lists.ids_at[c] + lists.rows[c]]
        size = tiles * lists.room[c] * LANES
        value = lists.value[lists.at[c] : lists.at[c] + size].reshape(tiles, -1, LANES)
        by_point = value.transpose(1, 0, 2).reshape(len(ids), -1)
        assert (by_point[:, last - first :] == 0).all()
        rational = surface.basis_matrix(mesh.uv[first:last], side=mesh.side[first:last])[:, ids].toarray().T
        assert np.allclose(by_point[:, : last - first] / by_point[:, : last - first].sum(axis=0), rational, atol=1e-6)
        slope = lists.slope[2 * lists.at[c] : 2 * (lists.at[c] + size)].reshape(tiles, -1, 2, LANES)
        assert np.isfinite(slope).all()
        assert (np.abs(by_point).max(axis=1) + np.abs(slope).max(axis=(0, 2, 3)) > 0).all()


def test_back_lists_lead_back() -> None:
    ids, rows = np.array([3, 1, 2, 1, 3], dtype=np.int32), np.array([3, 0, 2])
    start, count, cell, row = cells_by_point(ids, rows, 5)
    assert count.tolist() == [0, 2, 1, 2, 0]
    found = {(i, cell[e], row[e]) for i in range(5) for e in range(start[i], start[i] + count[i])}
    assert found == {(3, 0, 0), (1, 0, 1), (2, 0, 2), (1, 2, 0), (3, 2, 1)}
