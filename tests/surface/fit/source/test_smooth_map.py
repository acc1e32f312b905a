"""Maps are smoothed inside; borders stay, long waves stay, and nothing turns over."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import N, slit_sheet

from surface.fit.source import smooth_map as module
from surface.fit.source.islands import Island, boundary_loops, find_islands, signed_areas
from surface.fit.source.mesh import FitMesh, triangles
from surface.fit.source.smooth_map import smooth_map


@pytest.fixture(scope="module")
def flat() -> FitMesh:
    mesh = slit_sheet()
    return replace(mesh, vertices=mesh.vertices * [1.0, 1.0, 0.0])


def inner(island: Island) -> np.ndarray:
    out = np.ones(len(island.uv), bool)
    out[np.concatenate(boundary_loops(island))] = False
    return out


def wavy(mesh: FitMesh, amount: np.ndarray) -> Island:
    (island,) = find_islands(mesh)
    return replace(island, uv=island.uv + amount * inner(island)[:, None])


def test_a_map_that_is_linear_on_the_surface_stays(flat):
    (island,) = find_islands(flat)
    np.testing.assert_allclose(smooth_map(flat, island).uv, island.uv, atol=1e-9)


def test_bends_from_face_to_face_go_and_borders_stay(flat):
    noise = np.random.default_rng(2).uniform(-0.25, 0.25, (len(find_islands(flat)[0].uv), 2)) / N
    rough = wavy(flat, noise)
    smooth = smooth_map(flat, rough)
    (true,) = find_islands(flat)
    free = inner(rough)
    np.testing.assert_array_equal(smooth.uv[~free], rough.uv[~free])
    before, after = (np.sqrt(((i.uv - true.uv)[free] ** 2).mean()) for i in (rough, smooth))
    assert after < 0.4 * before
    np.testing.assert_array_equal(smooth.vertex, rough.vertex)
    np.testing.assert_array_equal(smooth.faces, rough.faces)


def test_long_waves_stay(flat):
    (true,) = find_islands(flat)
    u, v = true.uv.T
    wave = 0.03 * np.sin(2 * np.pi * u) * np.sin(np.pi * v)
    long = wavy(flat, np.column_stack([wave, 0 * wave]))
    smooth = smooth_map(flat, long)
    free = inner(long)
    left = (smooth.uv - true.uv)[free, 0] @ wave[free] / (wave[free] @ wave[free])
    assert left > 0.9


def test_a_change_is_made_only_as_far_as_no_face_turns_over(flat):
    (island,) = find_islands(flat)
    middle = int(np.argmin(np.abs(island.uv - [0.25, 0.25]).sum(axis=1)))
    for step, kept in ((0.5 / N, 1.0), (3.0 / N, 0.25), (1e3, 0.0)):
        change = np.zeros_like(island.uv)
        change[middle, 0] = step
        done = module._unturned(island, triangles(island.faces), change)
        np.testing.assert_allclose(done.uv - island.uv, kept * change, atol=1e-12)
        assert (signed_areas(done) > 0).all()
    turned = replace(island, uv=island.uv * [-1.0, 1.0])  # what was turned before says nothing
    np.testing.assert_array_equal(module._unturned(turned, triangles(island.faces), change).uv, turned.uv + change)


def test_an_island_without_inner_points_stays(flat):
    (island,) = find_islands(flat)
    one = island.subset(np.arange(len(island.faces)) == 5)
    assert smooth_map(flat, one) is one
