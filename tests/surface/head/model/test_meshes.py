"""The tessellation kept in a head file."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import part

from surface.head.model.data import Seam
from surface.head.model.meshes import pack, tessellate, unpack
from surface.head.posing.part import make_surface
from surface.mesh.mesh import border_edges

DATA = part("a", 0.0)
SURFACE = make_surface(DATA)
MESH = tessellate(DATA, SURFACE)
BUDGET = (0, 0.1, 4)


def test_it_comes_back():
    got = unpack(pack(MESH, BUDGET), SURFACE, BUDGET, rough=False)
    assert got is not None
    np.testing.assert_allclose(got.vertices, MESH.vertices, atol=1e-5)
    np.testing.assert_allclose(got.normals, MESH.normals, atol=1e-5)
    for key in ("triangles", "cell", "cell_start", "list_start", "list_ids"):
        np.testing.assert_array_equal(getattr(got, key), getattr(MESH, key))


def test_seams_end_at_vertices_of_the_border():
    line = np.array([[1.0, 0.31], [1.0, 0.5], [1.0, 0.77]])
    mesh = tessellate(DATA, SURFACE, [Seam("a", "b", line, line - [1, 0]), Seam("b", "c", line - 0.5, line)])
    assert np.linalg.norm(mesh.uv[:, None] - line[[0, 2]], axis=2).min(axis=0).max() < 1e-12
    ring = np.array([[0.0, 0.13], [1.0, 0.31], [1.0, 0.77], [0.0, 0.13]])
    np.testing.assert_array_equal(tessellate(DATA, SURFACE, [Seam("a", "b", ring, ring)]).uv, MESH.uv)


def test_rough_positions_are_near():
    got = unpack(pack(MESH, BUDGET), SURFACE, BUDGET, rough=True)
    assert got is not None and np.linalg.norm(got.vertices - MESH.vertices, axis=1).max() < 60


def test_another_budget_asks_for_another_mesh():
    assert unpack(pack(MESH, BUDGET), SURFACE, (0, 0.25, 3), rough=False) is None


@pytest.mark.parametrize(
    ("key", "value"),
    [("mesh_triangles", np.full((4, 3), 10**6)), ("mesh_list_ids", np.full(len(MESH.list_ids), 99)),
     ("mesh_cell_start", MESH.cell_start[:-1]), ("mesh_made", np.zeros(3))],
)  # fmt: skip
def test_a_mesh_that_does_not_fit_is_made_anew(key, value):
    assert unpack({**pack(MESH, BUDGET), key: value}, SURFACE, BUDGET, rough=False) is None


@pytest.mark.parametrize("key", ["mesh_cell_start", "mesh_list_start"])
def test_differences_of_unsigned_starts_do_not_wrap(key):
    arrays = changed(key, 1, 2**30)
    assert unpack({**arrays, key: arrays[key].astype(np.uint32)}, SURFACE, BUDGET, rough=True) is None
    sound = pack(MESH, BUDGET)
    assert unpack({**sound, key: sound[key].astype(np.uint32)}, SURFACE, BUDGET, rough=True) is not None


def test_an_absent_mesh_is_made_anew():
    assert unpack({}, SURFACE, BUDGET, rough=False) is None


def changed(key: str, at: int, value: int) -> dict[str, np.ndarray]:
    arrays = {k: a.copy() for k, a in pack(MESH, BUDGET).items()}
    arrays[key].reshape(-1)[at] = value
    return arrays


@pytest.mark.parametrize(
    ("key", "at", "bad", "good"),
    [
        ("mesh_triangles", 0, len(MESH.uv), len(MESH.uv) - 1), ("mesh_triangles", 0, -1, 0),
        ("mesh_list_ids", 0, SURFACE.n, SURFACE.n - 1), ("mesh_list_ids", 0, -1, 0),
        ("mesh_cell_start", 0, 1, 0), ("mesh_cell_start", -1, len(MESH.uv) - 1, len(MESH.uv)),
        ("mesh_list_start", 0, 1, 0), ("mesh_list_start", -1, len(MESH.list_ids) - 1, len(MESH.list_ids)),
        ("mesh_cell_start", 1, 0, MESH.cell_start[1]), ("mesh_list_start", 1, 0, MESH.list_start[1]),
    ],
)  # fmt: skip
def test_indices_are_checked_up_to_the_last_that_is_there(key, at, bad, good):
    assert unpack(changed(key, at, bad), SURFACE, BUDGET, rough=True) is None
    assert unpack(changed(key, at, good), SURFACE, BUDGET, rough=True) is not None


def test_normals_of_a_flipped_mesh_are_turned():
    arrays = pack(MESH, BUDGET)
    arrays["mesh_made"] = arrays["mesh_made"].copy()
    arrays["mesh_made"][4] = not MESH.flip
    assert unpack(arrays, SURFACE, BUDGET, rough=False, flip=MESH.flip) is None  # made for the other side
    got = unpack(arrays, SURFACE, BUDGET, rough=False, flip=not MESH.flip)
    assert got is not None and got.flip != MESH.flip and got.leaves == MESH.leaves
    np.testing.assert_allclose(got.normals, -MESH.normals, atol=1e-5)


@pytest.mark.parametrize("chord", [0.5, 2.0])
def test_borders_follow_their_loop_within_four_tenths_of_the_chord_error(chord: float):
    angle = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    loop = 0.5 + 0.45 * np.column_stack([np.cos(angle), np.sin(angle)])
    data = replace(DATA, loops=[loop], budget=(0, chord, 3))
    mesh = tessellate(data, SURFACE)
    a, b = (mesh.vertices[ends] for ends in border_edges(mesh.triangles).T)
    at = SURFACE.evaluate(loop)
    along = ((at[:, None] - a) * (b - a)).sum(axis=2) / ((b - a) ** 2).sum(axis=1)
    nearest = a + np.clip(along, 0, 1)[..., None] * (b - a)
    off = np.linalg.norm(at[:, None] - nearest, axis=2).min(axis=1).max()
    assert 0.05 * chord < off < 0.45 * chord
