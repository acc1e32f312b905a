"""Kernels of cells against plain sums."""

from __future__ import annotations

import numpy as np
import shapes

from surface.deform import apply
from surface.deform.lists import build_lists


def test_ranges_join_over_small_gaps() -> None:
    start, out = np.array([0, 10, 20, 400, 410, 1000]), np.zeros((5, 2), dtype=np.int64)
    cells = np.array([0, 1, 3, 4])
    assert apply.join_ranges(cells, 4, start, 0, out) == 2
    assert out[:2].tolist() == [[0, 20], [400, 1000]]
    assert apply.join_ranges(np.array([0, 2, 4]), 3, start, 10, out) == 1
    assert out[0].tolist() == [0, 1000]
    assert apply.join_ranges(np.array([0, 2]), 2, start, 9, out) == 2
    assert apply.join_ranges(cells, 0, start, 9, out) == 0


def test_positions_and_normals_are_those_of_the_surface() -> None:
    surface = shapes.hills(16)
    mesh = surface.tessellate(chord_error=0.1, max_depth=5)
    deformation = surface.deformation(mesh)
    points, su, sv = surface.derivatives(mesh.uv, mesh.side)
    normals = np.cross(su, sv)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert np.abs(deformation.vertices - points).max() < 1e-4
    assert np.abs(deformation.normals - normals).max() < 1e-4  # derivatives are kept in 16 bits


def test_denominators_are_sums_of_weights() -> None:
    surface = shapes.scattered(30, 4)
    mesh = surface.tessellate(chord_error=0.3, max_depth=3)
    deformation = surface.deformation(mesh)
    lists, packed = build_lists(surface, deformation.mesh, False), deformation.storage.packed
    moved = 0
    for c in range(len(lists.rows)):
        first, size = lists.cell_start[c], lists.cell_start[c + 1] - lists.cell_start[c]
        block = lists.value[lists.at[c] :][: lists.rows[c] * (-(-size // 8)) * 8].reshape(-1, lists.rows[c], 8)
        total = block.sum(axis=1).ravel()[:size]
        mine = deformation._arrays["inv_w"][8 * lists.tile_start[c] :][:size]
        if packed.order_at[c] >= 0:
            total, moved = total[packed.order[packed.order_at[c] :][:size]], moved + 1
        if packed.packed_at[c] >= 0:
            mine = np.ldexp(mine, -packed.power[8 * packed.packed_at[c] :][:size])
        assert np.allclose(mine, 1 / total, rtol=1e-5), first
    assert moved
