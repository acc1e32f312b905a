"""Joined cells hold the same vertices and points."""

from __future__ import annotations

import numpy as np
import shapes

from surface import DCPSurface
from surface.deform.merging import MAX_VERTICES, PER_POINT, merge_cells
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh


def body() -> tuple[DCPSurface, Mesh]:
    surface = shapes.scattered(60, 2)
    return surface, surface.tessellate(chord_error=0.1, max_depth=5, domain=Domain((0, 1, 0, 1)))


def test_lists_of_joined_cells_are_those_of_their_parts() -> None:
    _, mesh = body()
    joined = merge_cells(mesh)
    assert len(joined.cell_start) < len(mesh.cell_start) and set(joined.cell_start) <= set(mesh.cell_start)
    assert joined.vertices is mesh.vertices and joined.uv is mesh.uv
    assert np.array_equal(joined.cell, np.repeat(np.arange(len(joined.cell_start) - 1), np.diff(joined.cell_start)))
    for c, (first, last) in enumerate(zip(joined.cell_start, joined.cell_start[1:], strict=False)):
        parts = np.unique(mesh.cell[first:last])
        assert joined.points_of(c).tolist() == np.unique(np.concatenate([mesh.points_of(k) for k in parts])).tolist()
        assert len(parts) == 1 or last - first <= MAX_VERTICES


def test_cells_are_joined_only_where_one_list_costs_less() -> None:
    _, mesh = body()

    def cost(own: Mesh) -> float:
        return float((np.diff(own.list_start) * (np.diff(own.cell_start) + PER_POINT)).sum())

    assert cost(merge_cells(mesh)) < cost(mesh)
    assert merge_cells(mesh, per_point=0.0, most=0) is mesh


def test_a_mesh_without_vertices_has_no_cells_to_join() -> None:
    surface, mesh = body()
    empty = Mesh(
        mesh.vertices[:0], mesh.normals[:0], mesh.triangles[:0], mesh.uv[:0], mesh.side[:0], mesh.cell[:0],
        np.zeros(1, np.int64), np.zeros(1, np.int64), mesh.list_ids[:0], 0, False,
    )  # fmt: skip
    assert merge_cells(empty) is empty
    assert len(surface.deformation(empty).vertices) == 0
