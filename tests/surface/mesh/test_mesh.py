"""What a mesh promises about its arrays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapes

from surface import Mesh


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
