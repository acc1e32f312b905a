"""Cells of a mesh: branches of the tree with complete lists of control points."""

from __future__ import annotations

import itertools

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
    assert np.diff(mesh.cell_start).max() <= blocks.MAX_VERTICES
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
    assert blocks.MAX_VERTICES == 4096
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


def cheapest_cells(code: np.ndarray, depth: int, uv: np.ndarray, supports: np.ndarray) -> list[int]:
    """First vertices of cells: a branch is cut into its quarters where these cost less, by the docstring's rule."""

    def cost(low: int, high: int) -> float:
        (u0, v0), (u1, v1) = uv[low:high].min(axis=0), uv[low:high].max(axis=0)
        a, b, c, d = supports.T
        points = ((a <= u1) & (b >= u0) & (c <= v1) & (d >= v0)).sum()
        return float(points * (8 * np.ceil((high - low) / 8) + 10))

    def edges(low: int, high: int, level: int) -> list[tuple[int, int]]:
        first = np.unique(code[low:high] >> (2 * level), return_index=True)[1]
        return list(zip(low + first, [*(low + first[1:]), high], strict=True))

    def cut(low: int, high: int, level: int) -> list[int]:
        if level == 0 or high - low <= 8:
            return [low]
        quarters = edges(low, high, level - 1)
        forced = high - low > 4096 or len(quarters) == 1
        if not forced and sum(cost(a, b) for a, b in quarters) >= cost(low, high):
            return [low]
        return [cell for a, b in quarters for cell in cut(a, b, level - 1)]

    return [cell for a, b in edges(0, len(code), depth) for cell in cut(a, b, depth)] + [len(code)]


@pytest.mark.parametrize(
    ("count", "control", "depth", "spread"),
    [(700, 300, 4, (1, 1)), (700, 300, 4, (0.1, 0.1)), (300, 60, 5, (1, 0.03)), (300, 60, 5, (0.02, 1)),
     (90, 400, 3, (1, 1)), (300, 8, 5, (1, 0.03)), (300, 8, 5, (0.02, 1)), (6000, 8, 5, (1, 1))],
)  # fmt: skip
def test_a_branch_is_cut_where_its_quarters_cost_less(
    count: int, control: int, depth: int, spread: tuple[float, float]
) -> None:
    """Vertices of two roots side by side, all over them, or most in one corner or along one side."""
    surface, rng = shapes.scattered(control, 3), np.random.default_rng(count)
    at = rng.random((count, 2))
    at[: -count // 9] *= spread
    whole = np.clip((at * [2, 1] * 2**depth).astype(np.int64), 0, [2 * 2**depth - 1, 2**depth - 1])
    root, inner = whole[:, 0] >> depth, whole & [2**depth - 1, 2**depth - 1]
    code = (root << (2 * depth)) | blocks.morton(inner[:, 0].copy(), inner[:, 1].copy())
    order = np.argsort(code, kind="stable")
    code, uv = code[order], np.ascontiguousarray(at[order])
    found = blocks.group(code, depth, uv, surface)
    assert 3 < len(found) < count
    assert found.tolist() == cheapest_cells(code, depth, uv, surface.supports)


def test_a_vertex_belongs_to_the_first_of_the_leaves_around_it() -> None:
    triangles = np.array([[0, 1, 2], [2, 1, 3], [3, 4, 2]])
    code = np.full(5, 99)
    blocks.lower_codes(triangles, np.array([1, 0, 2]), np.array([7, 5, 3]), code)
    assert code.tolist() == [5, 5, 3, 3, 3]


def test_morton_codes_have_room_for_twenty_four_bits() -> None:
    top = np.array([2**23, 0, 2**24 - 1])
    assert blocks.morton(top, top[::-1].copy()).tolist() == [
        2**46 + sum(2 ** (2 * k + 1) for k in range(24)), 0, sum(4**k for k in range(24)) + 2**47,
    ]  # fmt: skip


@pytest.mark.parametrize("seed", range(2))
def test_lists_are_those_points_that_reach_a_vertex_of_the_cell(seed: int) -> None:
    surface = shapes.scattered(60, seed)
    rng = np.random.default_rng(seed)
    uv, start = rng.random((40, 2)), np.array([0, 3, 4, 20, 40])
    reaches = surface.basis_matrix(uv).toarray() > 0
    list_start, ids = blocks.point_lists(start, uv, np.zeros(len(uv), np.int64), surface)
    for cell, (low, high) in enumerate(itertools.pairwise(start)):
        expected = np.flatnonzero(reaches[low:high].any(axis=0))
        assert ids[list_start[cell] : list_start[cell + 1]].tolist() == expected.tolist()
