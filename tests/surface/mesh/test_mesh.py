"""What a mesh promises about its arrays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapes

from surface import Mesh
from surface.mesh.mesh import border_edges


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    return shapes.hills().tessellate(chord_error=0.3)


def test_arrays_are_read_only_and_the_mesh_is_frozen(mesh: Mesh) -> None:
    for field in dataclasses.fields(mesh):
        value = getattr(mesh, field.name)
        if isinstance(value, np.ndarray):
            assert not value.flags.writeable, field.name
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.flip = True  # type: ignore[misc]


def test_vertices_of_a_cell_stand_together(mesh: Mesh) -> None:
    assert np.array_equal(np.repeat(np.arange(len(mesh.cell_start) - 1), np.diff(mesh.cell_start)), mesh.cell)
    assert len(mesh.list_start) == len(mesh.cell_start)
    assert mesh.list_start[-1] == len(mesh.list_ids)


def test_points_of_a_cell_are_its_part_of_the_list(mesh: Mesh) -> None:
    every = np.concatenate([mesh.points_of(c) for c in range(len(mesh.cell_start) - 1)])
    assert np.array_equal(every, mesh.list_ids)
    assert (np.diff(mesh.points_of(3)) > 0).all()


def test_triangles_turn_as_the_normals_point(mesh: Mesh) -> None:
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * mesh.normals[mesh.triangles[:, 0]]).sum(axis=1) > 0).all()


def test_the_border_is_what_one_triangle_has_in_its_direction() -> None:
    triangles = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4]], np.int32)
    assert border_edges(triangles).tolist() == [[0, 1], [2, 0], [1, 3], [3, 4], [4, 2]]
    closed = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]], np.int32)
    assert len(border_edges(closed)) == 0 and len(border_edges(triangles[:0])) == 0
    wrong = np.array([[0, 1, 2], [0, 1, 3]], np.int32)  # twice in one direction: no triangle has it back
    assert len(border_edges(wrong)) == 6


def test_boxes_of_cells_are_those_of_their_vertices(mesh: Mesh) -> None:
    boxes, _ = mesh.cell_boxes
    for cell in (0, 3, len(mesh.cell_start) - 2):
        own = mesh.uv[mesh.cell == cell]
        (u0, v0), (u1, v1) = own.min(axis=0), own.max(axis=0)
        assert boxes[cell].tolist() == [u0, u1, v0, v1]
    assert len(boxes) == len(mesh.cell_start) - 1
