"""The arrays of an update have the sizes and first values that kernels rely on."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from surface.deform.binding import NAMES
from surface.deform.lists import Lists
from surface.deform.updates import NOT_STORED
from surface.deform.working import middles, with_room, work_arrays


def test_the_middle_of_a_cell_is_the_mean_of_its_vertices() -> None:
    vertices = np.random.default_rng(1).normal(size=(9, 3)).astype(np.float32)
    found = middles(vertices, np.array([0, 1, 5, 9]))
    assert found.dtype == np.float64
    wanted = [vertices[k].astype(np.float64).mean(axis=0) for k in (slice(0, 1), slice(1, 5), slice(5, 9))]
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert np.array_equal(middles(np.zeros((0, 3)), np.zeros(4, np.int64)), np.zeros((3, 3)))


def test_means_of_float32_are_taken_in_float64() -> None:
    far = np.full((100_000, 3), 16_777_216.0, np.float32)
    far[::2] += 2.0
    np.testing.assert_array_equal(middles(far, np.array([0, 100_000])), [[16_777_217.0] * 3])


def test_rows_are_copied_and_four_numbers_of_the_last_can_be_read() -> None:
    rows = np.arange(6.0).reshape(2, 3)
    found = with_room(rows)
    assert np.array_equal(found, rows) and not np.shares_memory(found, rows)
    assert found.base is not None and found.base.size >= 2 * 3 + 1 and not found.base[2:].any()


@pytest.mark.parametrize("normals", [True, False])
def test_arrays_have_a_place_for_every_vertex_tile_cell_and_point(normals: bool) -> None:
    surface = shapes.hills(8)
    mesh = surface.tessellate(chord_error=1.0)
    tiles, m, c, n = 77, len(mesh.vertices), len(mesh.cell_start) - 1, surface.n
    made = work_arrays(mesh, surface.points, tiles, normals)
    sizes = {
        "inv_w": 8 * tiles, "dw": 16 * tiles * normals, "numerators": (72 if normals else 24) * tiles,
        "touched": tiles, "vertices": 3 * m, "normals": 3 * m * normals, "extent": 7,
        **dict.fromkeys(("origin", "differences", "ranges", "hits", "affected", "recomputed"), c),
        **dict.fromkeys(("pull", "span", "drift", "heavy"), c), **dict.fromkeys(("points", "moved_ids", "delta"), n),
    }  # fmt: skip
    assert {name: len(array) for name, array in made.items()} == sizes
    single = {name for name, array in made.items() if array.dtype == np.float32}
    assert single == {"inv_w", "dw", "numerators", "vertices", "normals"}
    assert (made["differences"] == NOT_STORED).all()
    np.testing.assert_array_equal(made["points"], surface.points)
    np.testing.assert_array_equal(made["origin"], middles(mesh.vertices, mesh.cell_start))
    zero = made.keys() - {"differences", "points", "origin"}
    assert not any(made[name].any() for name in zero)


def test_every_array_of_an_update_comes_from_here_or_from_what_keeps_weights() -> None:
    surface = shapes.hills(8)
    deformation = surface.deformation(surface.tessellate(chord_error=1.0))
    made = work_arrays(deformation.mesh, surface.points, 3, True).keys()
    others = Lists.__dataclass_fields__.keys() | deformation.storage.arrays.keys() | {"local", "scratch", "starts"}
    assert set(NAMES) - made <= others and made <= set(NAMES)


def test_a_mesh_without_cells_has_room_for_one_range() -> None:
    surface = shapes.hills(8)
    mesh = surface.tessellate(chord_error=1.0)

    class Empty:
        vertices, cell_start = mesh.vertices[:0], np.zeros(1, np.int64)

    assert work_arrays(Empty, surface.points, 0, True)["ranges"].shape == (1, 2)  # type: ignore[arg-type]
