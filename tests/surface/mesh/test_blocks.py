"""Cells of a mesh: branches of the tree with complete lists of control points."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface.mesh import blocks


def test_morton_mixes_bits() -> None:
    x, y = np.array([0, 1, 0, 1, 2, 5]), np.array([0, 0, 1, 1, 0, 3])
    assert blocks.morton(x, y).tolist() == [0, 1, 2, 3, 4, 0b011011]


@pytest.mark.parametrize("seed", range(3))
def test_lists_hold_every_point_with_weight(seed: int) -> None:
    surface = shapes.scattered(40, seed)
    mesh = surface.tessellate(chord_error=0.1, max_depth=5)
    assert mesh.cell_start[0] == 0
    assert mesh.cell_start[-1] == len(mesh.uv)
    assert (np.diff(mesh.cell_start) > 0).all()
    assert np.diff(mesh.cell_start).max() <= blocks.MOST
    matrix = surface.basis_matrix(mesh.uv, side=mesh.side)
    for cell, (first, last) in enumerate(zip(mesh.cell_start, mesh.cell_start[1:], strict=False)):
        used = np.unique(matrix[int(first) : int(last)].indices)
        assert np.isin(used, mesh.points_of(cell)).all()


def test_rectangles_count_the_points_that_meet_them() -> None:
    surface = shapes.scattered(40, 5)
    rng, s = np.random.default_rng(0), surface.supports
    low = np.vstack([rng.uniform(-0.4, 1.2, (49, 2)), s[7, [1, 3]]])  # the last one touches a corner of point 7
    high = low + rng.uniform(0.01, 0.5, (50, 2))
    rect = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    found = np.zeros(50, dtype=np.int64)
    blocks.count_points(rect, *surface.arrays()[:2], *surface.bin_arrays(), found)
    for box, count in zip(rect, found, strict=True):
        meets = (s[:, 0] <= box[1]) & (s[:, 1] >= box[0]) & (s[:, 2] <= box[3]) & (s[:, 3] >= box[2])
        assert meets.sum() == count


def test_unit_vectors_and_where_there_are_none() -> None:
    a = np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 2, 0]])
    b = np.array([[0.0, 3, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5]])
    out, bad = np.zeros((4, 3)), np.zeros(4, dtype=bool)
    blocks.unit_cross(a, b, out, bad)
    assert bad.tolist() == [False, True, True, False]
    assert out.tolist() == [[0, 0, 1], [0, 0, 0], [0, 0, 0], [1, 0, 0]]


def test_cells_are_as_large_as_one_list_is_cheaper_than_four_and_the_cache_allows() -> None:
    square = shapes.hills(4).tessellate(roots=(1, 1), min_depth=7, max_depth=7)  # 16 points that all reach everywhere
    sizes = np.diff(square.cell_start)
    assert len(square.vertices) == 129**2
    assert blocks.MOST == 4096
    assert sizes.max() <= 4096 and sizes.min() > 1000
    assert len(sizes) < 20
    spans = shapes.hills(19)  # 16 spans along a side: a cell of many spans would read points that reach little of it
    fine = spans.tessellate(roots=(16, 16), min_depth=3, max_depth=3)
    matrix = spans.basis_matrix(fine.uv, side=fine.side)
    for cell, (first, last) in enumerate(zip(fine.cell_start, fine.cell_start[1:], strict=False)):
        assert last - first <= 9 * 9
        assert len(fine.points_of(cell)) < 2 * matrix[int(first)].nnz + 24


def test_the_rectangle_of_every_cell_holds_its_vertices() -> None:
    mesh = shapes.hills(8).tessellate(chord_error=0.5)
    boxes, bins = mesh.cell_boxes
    for c, (u0, u1, v0, v1) in enumerate(boxes):
        uv = mesh.uv[mesh.cell_start[c] : mesh.cell_start[c + 1]]
        assert [u0, u1, v0, v1] == [uv[:, 0].min(), uv[:, 0].max(), uv[:, 1].min(), uv[:, 1].max()]
    assert set(bins.ids.tolist()) == set(range(len(boxes)))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("axis", range(3))
def test_directions_need_a_product_of_a_millionth_of_a_millionth_of_the_lengths(axis: int, scale: float) -> None:
    along, aside = np.roll([[1.0, 0, 0], [0, 1.0, 0]], axis, axis=1)
    angles = np.array([0.0, 0.9e-12, 1.1e-12, -0.5, np.pi / 2])
    a = np.tile(scale * along, (5, 1))
    b = 7.0 * scale * (along * np.cos(angles)[:, None] + aside * np.sin(angles)[:, None])
    for first, second, sign in ((a, b, 1.0), (b, a, -1.0)):
        out, bad = np.full((5, 3), 9.0), np.zeros(5, bool)
        blocks.unit_cross(first, second, out, bad)
        assert bad.tolist() == [True, True, False, False, False]
        assert (out[:2] == 9.0).all()
        wanted = sign * np.sign(angles[2:, None]) * np.roll([0.0, 0, 1], axis)
        np.testing.assert_allclose(out[2:], wanted, atol=1e-12)
